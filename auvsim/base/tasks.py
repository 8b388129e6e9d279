"""Independent tasks on all cores, each in a process of its own."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

THREADED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
Progress = Callable[[float, float], None]  # called with the weight done and the total weight


@dataclass(frozen=True, kw_only=True, slots=True)
class Task:
    """A call without arguments that another process can unpickle."""

    key: tuple
    work: Callable[[], Any]
    weight: float = 1.0  # expected duration relative to the other tasks


def run_tasks(tasks: Sequence[Task], jobs: int | None = None, progress: Progress | None = None) -> dict[tuple, Any]:
    """Runs tasks in parallel and returns their results by key.

    Args:
        tasks: Started in order of decreasing weight, so that no core waits for a long one at the end.
        jobs: Number of processes; one per core if None.
        progress: Called after each task.
    """
    tasks = sorted(tasks, key=lambda task: -task.weight)
    total, finished = sum(task.weight for task in tasks), 0.0
    for library in THREADED:  # a task has one core: threads of linear algebra would only wait for each other
        os.environ.setdefault(library, "1")
    # Spawned, not forked: MuJoCo, OpenGL, BLAS and numba may hold threads and locks of this process.
    pool = ProcessPoolExecutor(
        max(1, min(jobs or os.cpu_count() or 1, len(tasks))),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_exit_on_interrupt,
    )
    try:
        futures: dict[Future, Task] = {pool.submit(task.work): task for task in tasks}
        results = {}
        for future in as_completed(futures):
            task = futures[future]
            results[task.key] = future.result()
            finished += task.weight
            if progress:
                progress(finished, total)
        return {task.key: results[task.key] for task in tasks}
    except KeyboardInterrupt:
        for process in multiprocessing.active_children():  # which Ctrl-C may not have reached
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _exit_on_interrupt() -> None:
    """Lets Ctrl-C, which reaches the workers too, end them at once and silently; the parent reports it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
