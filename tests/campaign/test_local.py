"""Worker processes that are killed, crash, leave or hang: each death has its task, and nothing else is lost."""

import os
import subprocess
import sys
import time
from itertools import count
from pathlib import Path

import psutil
import pytest
from campaign_jobs import ENDINGS, misbehave

from auvsim.campaign.local import Death, Pool


def outcomes(pool: Pool, tasks: list, timeout: float = 30.0) -> dict:
    """What became of each task."""
    return dict(pool.run(misbehave, tasks, timeout=timeout))


def test_deaths_are_told_apart_and_cost_nothing_else() -> None:
    """Four ways to end, among twenty tasks; both processes are replaced as they die."""
    tasks = [*range(8), "kill", *range(8, 12), "crash", "hang", *range(12, 16), "exit", *range(16, 20)]
    with Pool(2) as pool:
        found = outcomes(pool, tasks, timeout=1.0)
        assert outcomes(pool, [1, 2, 3]) == {1: 1, 2: 2, 3: 3}  # the pool goes on
    assert len(found) == len(tasks)
    assert all(found[task] == task for task in tasks if task not in ENDINGS)
    reasons = {task: found[task].reason for task in ENDINGS}
    assert reasons == {
        "kill": "was killed by signal 9",
        "crash": "was killed by signal 11",
        "exit": "left with exit code 3",
        "hang": "was not done after 1 s",
    }
    assert [task for task in ENDINGS if found[task].hung] == ["hang"]
    assert "in string_at" in found["crash"].output  # where it crashed
    assert "in misbehave" in found["hang"].output  # where it hung


def test_a_stopped_process_counts_as_hung() -> None:
    """One that cannot even end itself is ended."""
    with Pool(1) as pool:
        run = pool.run(misbehave, [("process",), "stop", 5], timeout=1.0)
        _, (process, _) = next(run)
        (_, stopped), (_, after) = run
        assert isinstance(stopped, Death)
        assert stopped.hung
        assert after == 5
        assert not psutil.pid_exists(process)


def test_processes_are_reused_with_one_thread_each() -> None:
    """Two processes do all tasks; their linear algebra has one thread."""
    with Pool(2) as pool:
        answers = [outcome for _, outcome in pool.run(misbehave, [("process",)] * 40, timeout=30.0)]
    assert 1 <= len({process for process, _ in answers}) <= 2
    assert all(set(threads.values()) == {"1"} for _, threads in answers)
    assert not any(psutil.pid_exists(process) for process, _ in answers)


def test_tasks_are_taken_as_needed() -> None:
    """An endless supply is no trouble, and what is left running goes when the consumer stops."""
    with Pool(2) as pool:
        endless = pool.run(misbehave, count(), timeout=30.0)
        assert sorted(outcome for _, outcome in (next(endless) for _ in range(50))) == pytest.approx(range(50), abs=2)
        endless.close()
        assert outcomes(pool, [7]) == {7: 7}


ORPHANS = """
import sys
from campaign_jobs import misbehave
from auvsim.campaign.local import Pool

pool = Pool(2)
run = pool.run(misbehave, [("process",), "hang", ("sleep", 60.0)], timeout=3.0)
print(next(run)[1][0], flush=True)
next(run)
"""


def test_processes_do_not_outlive_a_parent_that_is_killed(tmp_path: Path) -> None:
    """One waits for work, one sleeps, one hangs when the parent goes by kill -9; soon after they are gone."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen([sys.executable, "-c", ORPHANS], stdout=subprocess.PIPE, env=environment) as parent:
        assert parent.stdout is not None
        parent.stdout.readline()
        children = psutil.Process(parent.pid).children()
        assert children
        parent.kill()
    gone, alive = psutil.wait_procs(children, timeout=20.0)  # 3 s is their limit; a busy machine may add to that
    assert alive == []
    assert len(gone) == len(children)


def test_memory_is_flat() -> None:
    """Ten times as many tasks take no more memory here: less than a hundred bytes a task."""
    process = psutil.Process()
    with Pool(2) as pool:
        for number in (500, 5000):
            before, started = process.memory_info().rss, time.monotonic()
            assert sum(1 for _ in pool.run(misbehave, range(number), timeout=30.0)) == number
            grown = process.memory_info().rss - before
            assert time.monotonic() - started < 60.0
    assert grown < 5000 * 100
