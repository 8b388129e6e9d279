"""Tasks in processes of their own."""

import math
import os
from functools import partial

import pytest

from auvsim.base.errors import InputError, unknown_name
from auvsim.base.tasks import Task, run_tasks


def fail(name: str) -> None:
    raise unknown_name("vehicle", name, ["lauv"])


def test_results_by_key_and_progress_by_weight() -> None:
    """Each result stands under its task's key; progress grows to the sum of the weights, the heaviest task first."""
    tasks = [Task(key=(n,), work=partial(math.sqrt, n), weight=n + 1.0) for n in range(4)]
    seen: list[tuple[float, float]] = []
    results = run_tasks(tasks, 1, lambda done, total: seen.append((done, total)))
    assert results == {(n,): math.sqrt(n) for n in range(4)}
    assert seen[-1] == (10.0, 10.0)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    assert seen[0][0] == 4.0


def test_tasks_run_in_other_processes() -> None:
    found = run_tasks([Task(key=("pid",), work=os.getpid)])
    assert found["pid",] != os.getpid()


def test_no_tasks() -> None:
    assert run_tasks([]) == {}


def test_an_error_of_a_task_is_raised() -> None:
    with pytest.raises(InputError, match="no vehicle 'remus'; there are lauv"):
        run_tasks([Task(key=(), work=partial(fail, "remus"))], 1)
