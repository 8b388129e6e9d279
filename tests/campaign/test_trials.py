"""Campaigns of real trials: each is what `auvsim dock` runs, on every engine, and an error is a row."""

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from pyarrow import parquet

from auvsim import cli
from auvsim.analysis.summary import summarise
from auvsim.base.errors import InputError
from auvsim.campaign import execution, plan, table
from auvsim.campaign.cluster import Cluster
from auvsim.campaign.folder import Folder
from auvsim.campaign.local import Pool
from auvsim.cli import products
from auvsim.data import log
from auvsim.simulation import scenario
from auvsim.simulation.run import run

PLAN = {
    "name": "short",
    "seed": 12,
    "trials": 2,
    "sampling": "sobol",
    "base": {"duration": 20.0},
    "keep": "failures",  # nobody docks in 20 s
    "variants": {"plain": {}, "raises": {"estimator": {"kind": "campaign_estimators:raising"}}},
}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Folder]:
    """A campaign on two processes."""
    with Pool(2) as pool:
        yield execution.run(plan.parse(PLAN), tmp_path_factory.mktemp("campaigns") / "short", pool)


def test_a_trial_is_that_of_a_single_run(done: Folder) -> None:
    """Its log is the same bit for bit as in this process, and its row says what the log says."""
    rows = {(row["variant"], row["trial"]): row for row in table.rows(done)}
    for trial in (0, 1):
        alone = run(scenario.parse(done.plan.values("plain", trial)), seed=12, trial=trial)
        row = rows["plain", trial]
        kept = log.read(done.path / row["log"])
        assert log.differences(kept, alone) == []
        summary = summarise(alone.vehicle())
        quality = summary["estimate"]["all"]
        assert (row["docked"], row["failure"], row["attempts"]) == (False, "timeout", summary["attempts"])
        assert (row["position_rms"], row["samples"]) == (quality["position_rms"], quality["samples"])
        assert row["fixes_sent"] == summary["fixes_sent"]
        assert row["current.speed"] == done.plan.values("plain", trial)["current"]["speed"]
        assert row["real_time_factor"] == row["time"] / row["wall_time"]
    assert rows["plain", 0]["command"] == f"auvsim campaign {done.path} --trial 0 --variant plain"


def test_an_error_is_a_row(done: Folder) -> None:
    """Whose code raised, and what; nothing in it is of one run only, such as addresses in memory."""
    failed = [row for row in table.rows(done) if row["variant"] == "raises"]
    assert len(failed) == 2
    for row in failed:
        assert (row["docked"], row["failure"], row["attempts"], row["seed"]) == (False, "diverged", 1, 12)
        assert row["failure_text"] == (
            "estimator 'campaign_estimators:raising' of 'remus100' failed: FloatingPointError: lost at 5.5 s by "
            "<object object at 0x...>"
        )
        assert row["estimator.kind"] == "campaign_estimators:raising"
        assert row["vehicle.start.range"] == done.plan.values("plain", row["trial"])["vehicle"]["start"]["range"]
        assert row["log"] is not None  # everything up to there


def test_parquet_and_csv_hold_the_rows(done: Folder) -> None:
    """Both have every column, number and gap."""
    rows = [{name: value for name, value in row.items() if name not in ONLY_HERE} for row in table.rows(done)]
    assert parquet.read_table(done.path / "table.parquet").to_pylist() == rows
    schema = parquet.read_schema(done.path / "table.parquet")
    assert schema.field("miss_distance").metadata[b"units"] == b"m"
    with open(done.path / "table.csv", newline="") as stream:
        texts = list(csv.DictReader(stream))
    for text, row in zip(texts, rows, strict=True):
        assert list(text) == list(row)
        for name, value in row.items():
            if isinstance(value, float):
                assert float(text[name]) == value
            elif isinstance(value, bool):
                assert text[name] == str(value).lower()
            else:
                assert text[name] == ("" if value is None else str(value))
    with open(done.path / "timings.csv", newline="") as stream:
        times = list(csv.DictReader(stream))
    assert len(times) == 4
    assert all(0.0 < float(each["cpu_time"]) < math.inf for each in times)


ONLY_HERE = ("wall_time", "cpu_time", "real_time_factor", "command", "log", "replay")


def test_memory_does_not_grow_with_the_number_of_trials(tmp_path: Path) -> None:
    """Of this process and the worker, from the 20th to the 80th trial: less than a third of a trial's log each."""
    used: dict[int, float] = {}

    def look(progress: execution.Progress) -> None:
        here = psutil.Process()
        used[progress.done] = sum(each.memory_info().rss for each in (here, *here.children(recursive=True))) / 1e6

    with Pool(1) as pool:
        execution.run(plan.parse({"trials": 80, "base": {"duration": 60.0}}), tmp_path / "c", pool, look)
    assert used[80] - used[20] < 6.0, used  # [MB]; a log of a minute takes 0.35


def test_dask_gives_the_same_table(done: Folder, tmp_path: Path) -> None:
    """Byte for byte, of real trials and errors."""
    with Cluster(None, 1) as cluster:
        execution.run(done.plan, tmp_path / "dask", cluster)
    for name in ("table.parquet", "table.csv"):
        assert (tmp_path / "dask" / name).read_bytes() == (done.path / name).read_bytes()


def test_one_trial_again(
    done: Folder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """From the folder alone, with what `auvsim dock` leaves; the same bits as in the campaign."""
    monkeypatch.setattr(products, "plots", lambda *arguments: None)
    command = ["campaign", str(done.path), "--trial", "1", "--variant", "plain", "--no-video"]
    assert cli.main(command) == 0
    again = done.path / "replays" / "plain-1"
    assert log.differences(log.read(again / "trial.nc"), log.read(done.log_path("plain", 1))) == []
    assert {path.name for path in again.iterdir()} == {"trial.nc", "summary.json"}
    replays = {(row["variant"], row["trial"]): row["replay"] for row in table.rows(done)}
    assert {place: path for place, path in replays.items() if path} == {("plain", 1): "replays/plain-1/trial.nc"}
    capsys.readouterr()
    for arguments, text in (
        (["--trial", "1"], "command line: --trial needs --variant; there are plain, raises"),
        (["--trial", "2", "--variant", "plain"], "command line: --trial 2: the plan has trials 0 to 1"),
        (["--trial", "0", "--variant", "plane"], "no variant 'plane'; there are plain, raises"),
        (["--variant", "plain"], "command line: --variant goes with --trial"),
        (["--scheduler", "tcp://a:1"], "command line: --scheduler goes with --engine dask"),
        (["--jobs", "0"], "command line: --jobs 0 must be 1 or more"),
    ):
        assert cli.main(["campaign", str(done.path), *arguments]) == 2
        assert capsys.readouterr().err.startswith(f"auvsim: {text}")


@pytest.mark.parametrize(
    ("pins", "text"),
    [
        (
            {"estimator": {"kind": "no.where:factory"}},
            "variant 'b': vehicles.remus100.estimator: estimator 'no.where:factory': ModuleNotFound",
        ),
        ({"vehicle": {"model": "remus"}}, "no vehicle 'remus'; there are "),
        ({"vehicle": {"start": {"depth": 100.0}}}, "vehicle.start.depth: 100 m is not between"),
    ],
)
def test_what_cannot_be_set_up_is_refused_before_anything_runs(pins: dict, text: str, tmp_path: Path) -> None:
    """No trial has run then, and no folder is left."""
    from auvsim.campaign import trials

    class Here:
        name, jobs = "here", 1

        def run(self, function, tasks, *, timeout):
            assert function is trials.prepare
            yield from ((task, function(task)) for task in tasks)

    with pytest.raises(InputError, match=text):
        execution.run(plan.parse({"trials": 2, "variants": {"a": {}, "b": pins}}), tmp_path / "c", Here())
    assert list(tmp_path.iterdir()) == []


def test_workers_need_the_same_versions() -> None:
    """Results of others would not be of one kind."""
    from auvsim.campaign import trials

    versions = trials.versions() | {"mujoco": "3.0.0"}
    assert "the workers have mujoco 3.1" in str(trials.prepare(([], versions)))
    assert trials.prepare(([], trials.versions())) is None
