"""A process that does one thing after another for another process, and dies with it.

`python -P -m auvsim.campaign.worker FILE_DESCRIPTOR`: functions and their arguments come in through the pipe, pickled,
with the time they may take; what the functions return goes back.
"""

import faulthandler
import gc
import pickle
import signal
import sys
from multiprocessing.connection import Connection

BEGUN = b""  # said of each task before it is done: from here on time counts


def main() -> None:
    """Works until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the parent says what is to happen
    faulthandler.enable()  # a crash leaves its traceback on standard error, where the parent finds it
    connection = Connection(int(sys.argv[1]))
    loaded = False
    try:
        while True:
            timeout, message = float(connection.recv_bytes()), connection.recv_bytes()
            function, argument = pickle.loads(message)
            connection.send_bytes(BEGUN)
            # A thread of its own in C, which ends a process that hangs even if the parent no longer lives.
            faulthandler.dump_traceback_later(timeout, exit=True)
            result = function(argument)
            faulthandler.cancel_dump_traceback_later()
            connection.send_bytes(pickle.dumps(result))
            if not loaded:  # what the first task imported stays: to look through it for garbage takes 80 ms each time
                gc.collect()
                gc.freeze()
                loaded = True
    except (EOFError, BrokenPipeError, ConnectionResetError):  # the parent has gone
        return


if __name__ == "__main__":
    main()
