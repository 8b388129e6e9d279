"""Campaigns run: nothing is lost, deaths are charged to the right trial, tables are the same whatever happened."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from auvsim.analysis.statistics import wilson
from auvsim.campaign import execution, table
from auvsim.campaign.folder import Folder, open_folder
from auvsim.campaign.local import Pool
from auvsim.campaign.plan import Plan

Planned = Callable[..., Plan]
AGAIN = "; it had not finished the first time either"
pytestmark = pytest.mark.usefixtures("light")


def run(plan: Plan, path: Path, jobs: int = 2) -> Folder:
    """Runs a campaign."""
    with Pool(jobs) as pool:
        return execution.run(plan, path, pool)


def tables(path: Path) -> list[bytes]:
    """What must be the same in each run."""
    return [(path / name).read_bytes() for name in ("table.parquet", "table.csv")]


def rows(folder: Folder) -> dict[tuple[str, int], dict]:
    """By variant and trial."""
    return {(row["variant"], row["trial"]): row for row in table.rows(folder)}


def test_the_same_table_on_one_and_two_processes(planned: Planned, tmp_path: Path) -> None:
    """Byte for byte; another seed gives another."""
    for name, plan, jobs in (("one", planned(), 1), ("two", planned(), 2), ("other", planned(seed=5), 2)):
        run(plan, tmp_path / name, jobs)
    assert tables(tmp_path / "one") == tables(tmp_path / "two")
    assert tables(tmp_path / "one") != tables(tmp_path / "other")
    state = open_folder(tmp_path / "two").state
    assert state["complete"]
    assert (state["jobs"], state["engine"]) == (2, "processes")
    assert (tmp_path / "one" / "timings.csv").read_bytes() != (tmp_path / "two" / "timings.csv").read_bytes()


def test_a_trial_that_kills_its_process_is_charged_alone(planned: Planned, tmp_path: Path) -> None:
    """It runs twice, all others once; the one that a stranger killed once is as if nothing had been."""
    marks = tmp_path / "marks"
    marks.mkdir()
    found = rows(run(planned("kill:3,7", marks), tmp_path / "killed"))
    dead = {place for place, row in found.items() if row["failure"] == "died"}
    assert dead == {("a", 3), ("a", 7), ("b", 3), ("b", 7)}
    for place, row in found.items():
        variant, trial = place
        assert len((marks / f"{variant}-{trial}").read_text()) == (2 if place in dead else 1)
        if place in dead:
            assert row["error_message"] == f"its process was killed by signal 9{AGAIN}"
            assert (row["docked"], row["attempts"], row["seed"]) == (False, 0, 4)
            assert row["current.speed"] is not None

    once = tmp_path / "once"
    once.mkdir()
    again = run(planned("once:3", once), tmp_path / "survived")
    assert {row["failure"] for row in table.rows(again)} == {None, "timeout"}
    retries = {(r["variant"], r["trial"]): r["run"]["retries"] for r in again.records()}
    assert {place for place, count in retries.items() if count} == {("a", 3), ("b", 3)}


@pytest.mark.parametrize(
    ("ending", "failure", "message"),
    [
        ("hang", "hung", "its process was not done after 0.5 s"),
        ("stop", "hung", "its process was not done after 0.5 s"),
        ("exit", "died", "its process left with exit code 3"),
    ],
)
def test_other_endings(ending: str, failure: str, message: str, planned: Planned, tmp_path: Path) -> None:
    """A trial that hangs, even one that is stopped, ends at the time limit; the campaign does not wait longer."""
    plan = planned(f"{ending}:1", trials=3, timeout=0.5)
    found = rows(run(plan, tmp_path / "c"))
    assert len(found) == 6
    for place, row in found.items():
        assert (row["failure"] == failure) == (place[1] == 1)
        if place[1] == 1:
            assert row["error_message"] == message + AGAIN


def test_nothing_that_is_done_runs_again(planned: Planned, tmp_path: Path) -> None:
    """Of a campaign half of which is there, only the rest runs; a longer one goes on; the table is that of one run."""
    marks = tmp_path / "marks"
    marks.mkdir()
    first = run(planned(marks=marks), tmp_path / "c")
    before = tables(tmp_path / "c")
    for trial in range(5, 12):
        first.record_path("b", trial).unlink()
    first.record_path("a", 2).write_text("{")
    run(planned(marks=marks), tmp_path / "c")
    counts = {path.name: len(path.read_text()) for path in marks.iterdir()}
    assert {name for name, count in counts.items() if count == 2} == {"a-2", *(f"b-{k}" for k in range(5, 12))}
    assert tables(tmp_path / "c") == before
    run(planned(marks=marks, trials=20), tmp_path / "c")
    assert len(rows(open_folder(tmp_path / "c"))) == 40
    run(planned(marks=marks, trials=20), tmp_path / "at once")
    assert tables(tmp_path / "c") == tables(tmp_path / "at once")


def test_a_stopping_rule_stops_at_the_same_trial(planned: Planned, tmp_path: Path) -> None:
    """Where the wider of the intervals is narrow enough, looked at after each block; on one process as on two."""
    stop = {"width": 0.35, "block": 6}
    plan = planned(trials=200, stop=stop)
    expected = next(n for n in range(6, 200, 6) if width(2 * n // 3, n) < 0.35)  # two of three light trials dock
    for name, jobs in (("one", 1), ("two", 2)):
        done = run(plan, tmp_path / name, jobs)
        assert done.state["stopped"] == expected
        assert len(rows(done)) == 2 * expected
    assert tables(tmp_path / "one") == tables(tmp_path / "two")
    assert run(plan, tmp_path / "one").state["stopped"] == expected  # and nothing is left to do


def width(successes: int, trials: int) -> float:
    """Of Wilson's interval."""
    low, high = wilson(successes, trials)
    return high - low


def test_progress(planned: Planned, tmp_path: Path) -> None:
    """Counts up to the end, with what failed; what was there before counts as done, and not for the rate."""
    plan = planned("exit:1")
    seen: list[execution.Progress] = []
    with Pool(2) as pool:
        execution.run(plan, tmp_path / "c", pool, seen.append)
        assert [state.done for state in seen] == list(range(1, 25))
        assert {state.total for state in seen} == {24}
        assert (seen[-1].successes, seen[-1].errors, seen[-1].remaining) == (14, 2, 0.0)
        assert all(later.successes >= state.successes for state, later in pairwise(seen))
        open_folder(tmp_path / "c").record_path("a", 0).unlink()
        execution.run(plan, tmp_path / "c", pool, seen.append)
    assert [state.done for state in seen[24:]] == [24]


KILLED = """
import sys
from pathlib import Path
from campaign_jobs import nothing, trial
from auvsim.campaign import execution, plan
from auvsim.campaign.local import Pool

execution.trials.run, execution.trials.prepare = trial, nothing
with Pool(2) as pool:
    execution.run(plan.load(sys.argv[1]), Path(sys.argv[2]), pool)
"""


def test_kill_9_of_the_whole_run_loses_nothing(planned: Planned, tmp_path: Path) -> None:
    """The same plan goes on from there, and its table is that of a run that nobody killed."""
    plan = planned("slow:" + ",".join(map(str, range(6, 12))))
    (tmp_path / "plan.yaml").write_text(plan.to_yaml())
    command = [sys.executable, "-c", KILLED, str(tmp_path / "plan.yaml"), str(tmp_path / "c")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, env=environment) as process:
        deadline = time.monotonic() + 60.0
        while len(list(tmp_path.glob("c/trials/*/*/0*.json"))) < 12:
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.02)
        process.kill()
    finished = {path: path.read_bytes() for path in tmp_path.glob("c/trials/*/*/0*.json")}
    assert 12 <= len(finished) < 24
    assert all(json.loads(content) for content in finished.values())
    assert not open_folder(tmp_path / "c").state["complete"]
    run(plan, tmp_path / "c")
    assert finished.items() <= {path: path.read_bytes() for path in tmp_path.glob("c/trials/*/*/0*.json")}.items()
    run(plan, tmp_path / "unharmed")
    assert tables(tmp_path / "c") == tables(tmp_path / "unharmed")


def test_logs_are_kept_if_wanted(planned: Planned, tmp_path: Path) -> None:
    """Of all trials or of none; the rows say where."""
    for keep, count in (("none", 0), ("all", 6)):
        done = run(planned(trials=3, keep=keep), tmp_path / keep)
        logs = [row["log"] for row in table.rows(done) if row["log"]]
        assert len(logs) == count
        assert all((tmp_path / keep / log).read_bytes() == b"log" * 1000 for log in logs)
