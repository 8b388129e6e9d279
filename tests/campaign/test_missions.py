"""Campaigns of other missions than docking, and of several vehicles: columns, success, errors, what stops them."""

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pyarrow import parquet

from auvsim import cli
from auvsim.analysis.summary import summarise
from auvsim.base.errors import InputError
from auvsim.campaign import columns, execution, plan, report, statistics, table
from auvsim.campaign.criterion import Criterion
from auvsim.campaign.folder import Folder
from auvsim.campaign.local import Pool
from auvsim.simulation import scenario
from auvsim.simulation.run import run

CURRENT = {"kind": "uniform", "speed": {"uniform": [0.0, 0.2]}, "direction_deg": {"uniform": [-180.0, 180.0]}}
TRACK = {"kind": "track", "pattern": {"kind": "waypoints", "points": [[-90.0, 50.0], [-60.0, 50.0]]}}
AWAY = {"north": -100.0, "east": 50.0, "depth": 10.0, "speed": 1.5, "heading_deg": 0.0}
FLEET = {
    "duration": 45.0,
    "water": {"current": CURRENT},
    "structures": {"west": {}, "east": {"east": 300.0}},
    "vehicles": {
        "first": {"mission": {"kind": "docking", "dock": "west"}, "start": {"range": {"uniform": [100.0, 150.0]}}},
        "mower": {"mission": TRACK, "start": AWAY, "sensors": {"usbl": {"dock": "west"}}},
        "second": {
            "mission": {"kind": "docking", "dock": "east"},
            "start": {"structure": "east", "range": 100.0},
            "sensors": {"usbl": {"dock": "east"}},
        },
    },
}  # fmt: skip
FLEET["vehicles"]["first"]["sensors"] = {"usbl": {"dock": "west"}}


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    """A process."""
    with Pool(1) as started:
        yield started


@pytest.fixture(scope="module")
def fleet(pool: Pool, tmp_path_factory: pytest.TempPathFactory) -> Folder:
    """Two trials of three vehicles; in the second variant the mower has nothing to do."""
    pins = {"vehicles": {"mower": {"mission": {"pattern": {"points": [[-90.0, 50.0]]}}}}}
    values = {"seed": 3, "trials": 2, "base": FLEET, "variants": {"a": {}, "b": pins}, "keep": "failures"}
    return execution.run(plan.parse(values), tmp_path_factory.mktemp("fleet") / "c", pool)


def test_a_row_for_each_vehicle(fleet: Folder) -> None:
    """Each says what that vehicle's part of the same run says, run alone here; others' columns are empty."""
    rows = {(row["variant"], row["trial"], row["vehicle"]): row for row in table.rows(fleet)}
    assert list(rows)[:4] == [("a", 0, "first"), ("a", 0, "mower"), ("a", 0, "second"), ("a", 1, "first")]
    assert len(rows) == 12
    alone = run(scenario.parse(fleet.plan.values("a", 1)), seed=3, trial=1)
    for name in ("first", "mower", "second"):
        row, summary = rows["a", 1, name], summarise(alone.vehicle(name))
        assert row["mission"] == summary["mission"]
        assert (row["position_rms"], row["time"]) == (summary["estimate"]["all"]["position_rms"], summary["time"])
        assert (row["fixes_sent"], row["fixes_refused"]) == (summary["fixes_sent"], summary["fixes_refused"])
        for column in ("attempts", "waypoints", "cross_track_rms", "peak_contact_force"):
            assert row[column] == summary.get(column)
        assert row["position_rms_under_way"] == summary["estimate"].get("under_way", {}).get("position_rms")
    assert len({row["position_rms"] for row in rows.values()}) > 3
    assert (
        rows["a", 1, "first"]["vehicles.first.start.range"]
        == fleet.plan.values("a", 1)["vehicles"]["first"]["start"]["range"]
    )


def test_success_of_several_is_that_of_all(fleet: Folder) -> None:
    """Who docks does not do so in 45 s, and the mower finishes: a success each by its own mission, none together."""
    rows = list(table.rows(fleet))
    assert [row["success"] for row in rows[:3]] == [False, True, False]
    assert [row["docked"] for row in rows[:3]] == [False, None, False]
    assert [row["finished"] for row in rows[:3]] == [None, True, None]
    assert [row["failure"] for row in rows[:3]] == ["timeout", None, "timeout"]
    rates = {
        (r.variant, r.quantity): (r.successes, r.trials) for r in statistics.rates(rows, ("a", "b"), fleet.plan.layout)
    }
    assert rates["a", "success"] == (0, 2)
    assert rates["a", "finished"] == (2, 2)
    assert rates["a", "docked"] == (0, 2)
    assert fleet.log_path("a", 0).is_file()  # it failed, so its log is kept


def test_means_of_several_are_over_them_before_they_are_compared(fleet: Folder) -> None:
    """By hand: a pair is a trial, not a vehicle."""
    rows = list(table.rows(fleet))
    found = {d.quantity: d for d in statistics.differences(rows, ("a", "b"), fleet.plan.layout)}
    assert found["position_rms"].pairs == 2
    means = {name: sum(row["position_rms"] for row in rows if row["variant"] == name) / 6.0 for name in ("a", "b")}
    assert found["position_rms"].value == pytest.approx(means["b"] - means["a"], abs=1e-12)
    assert found["position_rms"].value != 0.0


def test_the_table_of_several_has_all_their_columns(fleet: Folder) -> None:
    """In both files, and in the order of the missions."""
    with open(fleet.path / "table.csv", newline="") as stream:
        names = next(csv.reader(stream))
    assert names[:8] == ["variant", "trial", "seed", "vehicle", "mission", "success", "docked", "docked_first"]
    assert names.index("heading_error_deg") < names.index("finished") < names.index("cross_track_rms")
    assert {"position_rms_final", "position_rms_under_way"} <= set(names)
    assert "position_rms_docked" not in names
    schema = parquet.read_schema(fleet.path / "table.parquet")
    assert schema.names == names
    assert schema.field("success").metadata[b"meaning"] == b"docking: docked; track: finished"


def test_the_report_of_several(fleet: Folder, capsys: pytest.CaptureFixture) -> None:
    """Says so; each vehicle's line names it."""
    text = report.write(fleet.path).read_text()
    assert "a: success of all vehicles in 0 of 2 trials" in text
    assert text.count("<td>mower</td>") == 4
    assert cli.main(["report", str(fleet.path)]) == 0
    assert ": 4 trials, seed 3" in capsys.readouterr().out


def test_a_track(pool: Pool, tmp_path: Path) -> None:
    """Without docking in table and report; a bound of a number is its success, by which it stops."""
    start = {"range": 300.0, "bearing_deg": 0.0, **AWAY}
    base = {"duration": 60.0, "current": CURRENT, "vehicle": {"start": start}, "dock": {"heading_deg": 0.0}}
    base |= {"mission": TRACK}
    values = {"trials": 6, "base": base, "success": {"metric": "cross_track_rms", "below": 1e6}}
    values |= {"stop": {"width": 0.7, "block": 2}}
    done = execution.run(plan.parse(values), tmp_path / "c", pool)
    assert done.state["stopped"] == 2  # Wilson's interval of 2 in 2 is 0.66 wide
    rows = list(table.rows(done))
    assert [row["success"] for row in rows] == [row["finished"] for row in rows] == [True, True]
    assert all(row["cross_track_rms"] < 5.0 and row["waypoints"] == 2 for row in rows)
    assert not {"docked", "miss_distance", "vehicle", "mission"} & set(rows[0])
    text = report.write(done.path).read_text()
    assert "all: success in 2 of 2 trials" in text
    shown = re.sub(r"<(style|script).*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL)
    assert "Miss distance" not in shown
    assert "dock" not in shown
    stricter = plan.parse({**values, "success": {"metric": "cross_track_rms", "above": 1e6}, "trials": 4})
    again = execution.run(stricter, tmp_path / "c", pool)  # the same trials, judged otherwise
    assert [row["success"] for row in table.rows(again)] == [False] * len(list(table.rows(again)))


def test_a_manoeuvre(pool: Pool, tmp_path: Path) -> None:
    """It starts as `auvsim manoeuvre` has it start, away from the dock; its one phase has no columns of its own."""
    base = {"duration": 40.0, "manoeuvre": {"kind": "straight", "duration": 30.0}}
    done = execution.run(plan.parse({"trials": 1, "base": base}), tmp_path / "c", pool)
    (row,) = table.rows(done)
    assert (row["finished"], row["failure"], row["error_type"]) == (True, None, None)
    assert row["time"] == pytest.approx(30.0, abs=0.2)
    assert "vehicle.start.range" not in row
    assert row["samples"] > 0
    assert "position_rms_manoeuvre" not in row


OWN = {"duration": 30.0, "mission": {"kind": "campaign_missions:Wait", "settings": {"time": 12.0}}}


def test_a_mission_of_ones_own(pool: Pool, tmp_path: Path) -> None:
    """Its metrics are columns of their types; without one that says success it is that nothing failed."""
    pins = {"late": {"mission": {"settings": {"time": 40.0}}}}
    done = execution.run(plan.parse({"trials": 1, "base": OWN, "variants": {"own": {}, **pins}}), tmp_path / "c", pool)
    own, late = table.rows(done)
    assert (own["calm"], own["halves"], own["mood"]) == (True, 2, "good")
    assert own["deepest"] == pytest.approx(done.plan.values("own", 0)["vehicle"]["start"]["depth"], abs=1.0)
    assert (own["success"], own["failure"]) == (True, None)
    assert (late["success"], late["failure"], late["failure_text"]) == (False, "timeout", "not finished within 30 s")
    schema = parquet.read_schema(done.path / "table.parquet")
    types = {name: str(schema.field(name).type) for name in ("calm", "deepest", "halves", "mood")}
    assert types == {"calm": "bool", "deepest": "double", "halves": "int64", "mood": "string"}
    calm = plan.parse({"trials": 1, "base": OWN, "success": "calm"})
    assert calm.layout.success == "calm"
    assert list(calm.layout.columns)[3:7] == ["calm", "deepest", "halves", "mood"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Vague", "mission 'campaign_missions:Vague': metric 'deepest' is 'deep', not of the declared type float"),
        ("Silent", "mission 'campaign_missions:Silent': its metrics cannot be had: KeyError: 'no such group'"),
    ],
)
def test_metrics_that_are_wrong_are_an_error_of_the_trial(name: str, message: str, pool: Pool, tmp_path: Path) -> None:
    """One row that says so; what it counts is 0, what it asks is false."""
    base = {**OWN, "mission": {"kind": f"campaign_missions:{name}", "settings": {"time": 3.0}}}
    done = execution.run(plan.parse({"trials": 1, "base": base}), tmp_path / "c", pool)
    (row,) = table.rows(done)
    assert (row["failure"], row["error_message"]) == ("error", message)
    assert (row["success"], row["calm"], row["halves"], row["deepest"]) == (False, False, 0, None)


def test_columns_that_clash_are_refused() -> None:
    """Before anything runs."""
    base = {**OWN, "mission": {"kind": "campaign_missions:Clashing", "settings": {"time": 3.0}}}
    with pytest.raises(InputError, match="metric 'trial' is a column of every table; call it otherwise"):
        plan.parse({"trials": 1, "base": base})


def criterion(values: Any) -> Criterion:
    """As a plan has it."""
    return Criterion.model_validate(values)


def test_what_counts_as_success() -> None:
    """A column that says it, a bound on either side or both; what a mission has not is not asked of it."""
    row = {"docked": True, "docked_first": False, "attempts": 2, "miss_distance": 0.3, "failure": None}
    for values, expected in (
        ("docked", True),
        ("docked_first", False),
        ({"metric": "attempts", "below": 3}, True),
        ({"metric": "attempts", "below": 2}, False),
        ({"metric": "attempts", "above": 2}, False),
        ({"metric": "attempts", "above": 1, "below": 3}, True),
        ({"metric": "attempts", "above": 0, "below": 2}, False),
        ({"metric": "vertical", "below": 1}, False),  # never passed the mouth
        ({"metric": "cross_track_rms", "below": 1}, None),  # of tracks
        ("finished", None),
        (None, True),
    ):
        assert columns.judged("docking", None if values is None else criterion(values), row) is expected, values
    assert columns.judged("campaign_missions:Wait", None, {"failure": None})
    assert not columns.judged("campaign_missions:Wait", None, {"failure": "error"})
    assert columns.judged("track", None, {"finished": False, "failure": None}) is False


def test_layouts() -> None:
    """Success is a column of its own only where no mission's is that of all."""
    assert columns.layout(("docking",)).success == "docked"
    assert columns.layout(("track",)).success == "finished"
    assert columns.layout(("docking", "track"), True).success == "success"
    assert columns.layout(("docking", "track"), True, criterion("finished")).success == "finished"
    one, several = columns.layout(("docking",)), columns.layout(("docking",), True)
    assert [name for name in several.columns if name != "vehicle"] == list(one.columns)
    assert one.phases == ("search", "homing", "approach", "final", "go_around", "aborted")
    assert columns.layout(("manoeuvre",)).phases == ()
