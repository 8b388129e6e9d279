"""Processes of this machine that work for a campaign; one that dies or hangs takes nothing with it but its own trial.

`concurrent.futures` breaks as a whole when a worker dies, and cannot say which task killed it. Here each process does
one task at a time, so that a death has one task to be charged to.
"""

import contextlib
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from multiprocessing.connection import Pipe, wait
from tempfile import TemporaryFile
from typing import Any

from auvsim.campaign.worker import BEGUN

GRACE = 2.0  # after its time limit, in which a process ends itself and leaves its traceback [s]
START = 300.0  # in which it must have started [s]
TAIL = 4000  # of what a process wrote to standard error before it died [bytes]
# Many small matrices: threads inside a process would only take turns with the other processes.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


@dataclass(frozen=True, kw_only=True, slots=True)
class Death:
    """A process that died over a task, or was killed because it hung."""

    hung: bool
    reason: str  # how it ended, in words
    output: str = ""  # the end of what it wrote to standard error


class Process:
    """One process, see `worker`."""

    def __init__(self) -> None:
        self._errors = TemporaryFile()  # noqa: SIM115 (lives as long as the process)
        self.connection, theirs = Pipe()
        with theirs:
            search = os.pathsep.join(part or os.getcwd() for part in sys.path)
            self._popen = subprocess.Popen(
                [sys.executable, "-P", "-m", "auvsim.campaign.worker", str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=self._errors,  # what an estimator prints must not mix with what the command prints
                stderr=self._errors,
                env={**os.environ, **ONE_THREAD, "PYTHONPATH": search},
            )
        self.task: Any = None
        self.outcome: bytes | Death = b""  # of the task, once it is over
        self._begun = 0.0
        self._timeout = 0.0
        self._limit = 0.0

    def begin(self, message: bytes, timeout: float, task: Any = None) -> None:
        """Gives it a pickled pair of function and argument, and so many seconds for it; `task` is a note."""
        self._errors.seek(0)
        self._errors.truncate()
        self.task = task
        self._begun, self._timeout, self._limit = time.monotonic(), timeout, START
        with contextlib.suppress(OSError):  # it is dead, as `over` will find
            self.connection.send_bytes(str(timeout).encode())
            self.connection.send_bytes(message)

    @property
    def patience(self) -> float:
        """How long it may still take [s]."""
        return max(self._begun + self._limit - time.monotonic(), 0.0)

    def over(self) -> bool:
        """Whether its task is done, and its pickled result the outcome; or never will be, and that is a Death."""
        try:
            while self.connection.poll():
                message = self.connection.recv_bytes()
                if message != BEGUN:
                    self.outcome = message
                    return True
                self._begun, self._limit = time.monotonic(), self._timeout + GRACE
        except (EOFError, OSError):
            self.outcome = self._death()
            return True
        if self.patience == 0.0:
            self._popen.kill()
            self.outcome = self._death()
            return True
        return False

    def kill(self) -> None:
        """Ends it."""
        self._popen.kill()
        self._popen.wait()
        self.connection.close()

    @property
    def alive(self) -> bool:
        """Whether it can have another task."""
        return not self.connection.closed

    def _death(self) -> Death:
        late = self.patience <= GRACE
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(1.0)  # it may be about to leave
        self.kill()
        size = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, size - TAIL))
        output = self._errors.read().decode(errors="replace")
        code = self._popen.returncode
        if late or "Timeout (" in output:  # faulthandler's word, when it ended a process that hung
            return Death(hung=True, reason=f"was not done after {self._timeout:g} s", output=output)
        reason = f"was killed by signal {-code}" if code < 0 else f"left with exit code {code}"
        return Death(hung=False, reason=reason, output=output)


def unpacked(outcome: bytes | Death) -> Any:
    """The result of a task, or a Death."""
    return outcome if isinstance(outcome, Death) else pickle.loads(outcome)


class Pool:
    """Up to `jobs` processes, started when there is work for them.

    `with Pool(2) as pool: for task, outcome in pool.run(function, tasks, timeout=60.0): ...`
    """

    name = "processes"

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self._idle: list[Process] = []
        self._busy: dict[Any, Process] = {}

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *reason: object) -> None:
        for process in [*self._idle, *self._busy.values()]:
            process.kill()
        self._idle.clear()
        self._busy.clear()

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any], *, timeout: float) -> Iterator[tuple[Any, Any]]:
        """Each task with what the function returns for it, or a Death, in the order in which they end.

        Args:
            function: Of one task; it must be importable in another process.
            tasks: Taken one by one, as processes become free.
            timeout: After which a task counts as hung [s].
        """
        remaining, busy = iter(tasks), self._busy
        try:
            while True:
                for task in islice(remaining, self.jobs - len(busy)):
                    process = self._idle.pop() if self._idle else Process()
                    process.begin(pickle.dumps((function, task)), timeout, task)
                    busy[process.connection] = process
                if not busy:
                    return
                wait(list(busy), min(process.patience for process in busy.values()))
                for process in [process for process in busy.values() if process.over()]:
                    del busy[process.connection]
                    if process.alive:
                        self._idle.append(process)
                    yield process.task, unpacked(process.outcome)
        finally:
            for process in busy.values():
                process.kill()
            busy.clear()
