"""Closed loops in which a sensor fails: named, counted, and of no effect; and docking without USBL."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import auvsim
from auvsim.base.errors import InputError
from auvsim.data.log import VehicleLog
from auvsim.sensors.compass import Compass
from auvsim.sensors.depth import Depth
from auvsim.sensors.dvl import Dvl
from auvsim.sensors.feedback import Feedback
from auvsim.sensors.gyro import Gyro
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run

FAULTS = {"not finite": math.nan, "impossible": -9999.0}
SENSORS: dict[str, tuple[type, int]] = {
    "depth": (Depth, 0), "compass": (Compass, 0), "gyro": (Gyro, 2), "dvl": (Dvl, 1), "feedback": (Feedback, 4),
}  # fmt: skip
SCENARIO = Path(auvsim.__file__).parent / "scenarios" / "dock_by_ranges.yaml"


def trial(duration: float = 40.0, seed: int = 3, **pinned: Any) -> VehicleLog:
    values = {
        "duration": duration,
        "vehicle": {"start": {"range": 120.0, "bearing_deg": 35.0, "heading_deg": 70.0, "depth": 17.0}},
        "dock": {"north": 40.0, "east": -25.0, "heading_deg": 20.0},
        "sensors": {"dvl": {"enabled": True}, "gyro": {"enabled": True}},
    }
    return run(scenario.parse(sampling.merge(values, pinned)), seed=seed).vehicle()


@pytest.mark.parametrize("reason", FAULTS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_one_wrong_value_is_named_and_no_more(sensor: str, reason: str, monkeypatch: pytest.MonkeyPatch):
    """The log has the reading as it was, its fate and an event; depth and heading move by less than their noise."""
    kind, component = SENSORS[sensor]
    measure, clean = kind.measure, trial()

    def faulty(self: Any, truth: Any, world: Any) -> Any:
        reading = measure(self, truth, world)
        if reading is not None and abs(reading.stamp - 20.0) < 1e-6:
            reading.value[component] = FAULTS[reason]
        return reading

    monkeypatch.setattr(kind, "measure", faulty)
    log = trial()
    assert f"readings of {sensor}: {reason}" in log["event"]["text"].tolist()
    decided = log["measurements"]
    mine = (decided["sensor"] == sensor) & (decided["reason"] == reason.replace(" ", "_"))
    assert decided["stamp"][mine] == pytest.approx([20.0])
    for quantity, limit in (("depth", 0.05), ("heading", 0.01)):
        column = {"depth": log["truth"]["position"][:, 2], "heading": log["truth"]["attitude"][:, 2]}[quantity]
        other = {"depth": clean["truth"]["position"][:, 2], "heading": clean["truth"]["attitude"][:, 2]}[quantity]
        assert np.isfinite(column).all()
        assert np.abs(column - other).max() < limit


def test_it_docks_by_ranges_alone():
    """The shipped scenario, one seed: no USBL in the log, the dock's place from the chart, and the funnel found."""
    plan = sampling.merge(sampling.default_plan(), sampling.load_plan(SCENARIO)[0])
    log = run(scenario.parse(sampling.draw(plan, 11, 0)), seed=11).vehicle()
    assert "docked" in log["event"]["kind"].tolist()
    assert "usbl" not in log
    assert log.attributes["usbl_structure"] == ""
    assert {"range_a", "range_b", "range_c"} <= set(log["measurements"]["sensor"].tolist())


def test_without_usbl_and_ranges_there_is_nothing_to_navigate_by():
    one = {"range_a": {"kind": "range", "beacon": [60.0, 0.0, 30.0]}}
    for more in ({}, one):
        with pytest.raises(InputError, match="without USBL it needs ranges to two beacons or more"):
            trial(sensors={"usbl": {"enabled": False}, **more})
    with pytest.raises(InputError, match="without USBL it needs ranges"):
        trial(
            sensors={"usbl": {"enabled": False}, **one, "range_b": {"kind": "range", "beacon": [0.0, 60.0, 30.0]}},
            estimator={"use": []},
        )


def test_unused_gyro_and_dvl_change_nothing():
    """`use: []` is the filter without them, bit for bit; by default it uses them, and knows the current better."""
    off = {"dvl": {"enabled": False}, "gyro": {"enabled": False}}
    without, unused, used = trial(sensors=off), trial(estimator={"use": []}), trial()
    assert unused["estimate"]["mean"].tobytes() == without["estimate"]["mean"].tobytes()
    assert used["estimate"]["mean"].tobytes() != without["estimate"]["mean"].tobytes()
    last = [log["estimate"]["covariance"][-1] for log in (used, without)]
    assert last[0][6, 6] < 0.1 * last[1][6, 6]
