"""A Dask cluster that works for a campaign: on this machine, or wherever a scheduler has workers.

A Dask worker only minds processes of ours (`local.Process`), one for each of its threads. So a trial that crashes or
hangs is found and charged there as it is on one machine, and no Dask worker dies of it.
"""

import contextlib
import logging
import pickle
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from multiprocessing.connection import wait
from typing import Any

from auvsim.base.errors import AuvsimError, InputError
from auvsim.campaign.local import Death, Process, unpacked

AHEAD = 2  # tasks for each thread of the cluster that are under way, so that none waits for the next
CONNECTING = 60.0  # how long to look for the scheduler and its workers [s]
WATCH = 5.0  # how often to see that they are still there, when nothing else is heard of them [s]

_idle: list[Process] = []  # of this Dask worker
_lock = threading.Lock()


class Cluster:
    """Up to `jobs` threads of Dask workers, each with a process; `with Cluster(...) as cluster: cluster.run(...)`.

    Args:
        address: Of a scheduler, such as `tcp://host:8786`; None starts a cluster on this machine.
        jobs: Workers of the latter.

    Raises:
        InputError: Without Dask, a scheduler there, or workers.
    """

    name = "dask"

    def __init__(self, address: str | None, jobs: int) -> None:
        try:
            import distributed
        except ImportError:
            raise InputError("the engine dask needs Dask: pip install 'auvsim[cluster]'") from None
        _hush()
        with contextlib.ExitStack() as starting:
            local = address is None
            if local:
                with _deaf():
                    cluster = distributed.LocalCluster(
                        n_workers=jobs, threads_per_worker=1, dashboard_address=":0", silence_logs=logging.ERROR
                    )
                address = starting.enter_context(cluster).scheduler_address
            try:
                self._client = starting.enter_context(distributed.Client(address, timeout=CONNECTING))
                self._client.wait_for_workers(jobs if local else 1, timeout=CONNECTING)
            except (OSError, TimeoutError, ValueError) as error:
                text = " ".join(str(error).split()) or type(error).__name__
                raise InputError(f"no Dask cluster at {address}: {text}") from None
            self._stack = starting.pop_all()
        self.jobs = sum(self._client.nthreads().values())

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(self, *reason: Any) -> None:
        with contextlib.suppress(Exception):  # a scheduler that is gone cannot be told
            self._stack.close()

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any], *, timeout: float) -> Iterator[tuple[Any, Any]]:
        """Each task with what the function returns for it on the workers, or a Death, in the order in which they end.

        Raises:
            AuvsimError: If the scheduler is lost.
        """
        remaining = iter(tasks)
        under_way: dict[Any, Any] = {}
        finished: queue.Queue = queue.Queue()

        def submit(count: int) -> None:
            for task in islice(remaining, count):
                future = self._client.submit(call, pickle.dumps((function, task)), timeout, pure=False)
                under_way[future] = task
                future.add_done_callback(finished.put)

        try:
            submit(AHEAD * self.jobs)
            looked = time.monotonic()
            while under_way:
                future = self._next(finished)
                task = under_way.pop(future)
                outcome = self._outcome(future)
                future.release()
                yield task, outcome
                submit(1)
                if time.monotonic() > looked + WATCH:  # a cluster may grow
                    submit(max(AHEAD * self._workers() - len(under_way), 0))
                    looked = time.monotonic()
        finally:
            with contextlib.suppress(Exception):
                self._client.cancel(list(under_way), force=True)

    def _next(self, finished: queue.Queue) -> Any:
        """The next future that is done; looks whether there still is somebody to do it."""
        seen = time.monotonic()
        while True:
            try:
                return finished.get(timeout=WATCH)
            except queue.Empty:
                if self._workers():
                    seen = time.monotonic()
                elif time.monotonic() - seen > CONNECTING:
                    raise _lost("Dask cluster has lost all workers") from None

    def _workers(self) -> int:
        """How many threads there are; 0 also if nobody answers."""
        try:
            return sum(self._client.nthreads().values())
        except Exception:  # whatever a cluster without a scheduler raises
            return 0

    def _outcome(self, future: Any) -> Any:
        from distributed import KilledWorker

        try:
            return unpacked(future.result())
        except KilledWorker:
            return Death(hung=False, reason="died with its Dask worker")
        except Exception as error:
            if future.status == "error" and self._workers():
                raise
            raise _lost(f"Dask scheduler is lost ({type(error).__name__})") from None


def _lost(what: str) -> AuvsimError:
    return AuvsimError(f"the {what}; what is finished is kept, the same command goes on from there")


@contextlib.contextmanager
def _deaf() -> Iterator[None]:
    """What processes begin in here never hear of Ctrl-C, which reaches all: to be told by the parent is enough."""
    if threading.current_thread() is not threading.main_thread():  # Python lets no other one choose
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _hush() -> None:
    """Keeps Dask's log off the terminal: what matters it tells by exceptions, the rest is pages of tracebacks."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).handlers.clear()
    logger = logging.getLogger("distributed")
    logger.addHandler(logging.NullHandler())
    logger.propagate = False


def call(message: bytes, timeout: float) -> bytes | Death:
    """What a Dask worker does with a pickled function and task: has a process of its own do it."""
    with _lock:
        process = _idle.pop() if _idle else None
    process = process or Process()
    process.begin(message, timeout)
    while not process.over():
        wait([process.connection], process.patience)
    if process.alive:
        with _lock:
            _idle.append(process)
    return process.outcome
