"""Tasks of a study one after the other in this process: one that starts others for each study spends most on that."""

import pickle
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest

from auvsim.base import tasks


class InTurn:
    """What `run_tasks` uses of an executor; a call goes through the pickle that would take it to another process."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass

    def submit(self, work: Callable[[], Any]) -> Future:
        """The result of a call, or what it raised."""
        future: Future = Future()
        try:
            future.set_result(pickle.loads(pickle.dumps(work))())
        except Exception as error:
            future.set_exception(error)
        return future

    def shutdown(self, **_: Any) -> None:
        """Nothing is left to end."""


def install(patch: pytest.MonkeyPatch) -> None:
    """Makes `run_tasks` work here, until the patch is undone."""
    patch.setattr(tasks, "ProcessPoolExecutor", InTurn)
