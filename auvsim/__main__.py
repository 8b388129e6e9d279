"""The command `auvsim`, also as `python -m auvsim`, which can be interrupted while it is still imported."""

import os
import signal
import sys

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def main() -> int:
    """Runs the command line and returns its exit code."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number, handler in before.items():
        if handler in (signal.default_int_handler, signal.SIG_DFL):
            signal.signal(number, _leave)
    from auvsim.cli import main as run

    for number, handler in before.items():
        signal.signal(number, handler)
    return run()


def _leave(*_: object) -> None:
    """Ends the process at once: nothing has been written, and what is being imported may not be left halfway."""
    os.write(2, b"auvsim: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    sys.exit(main())
