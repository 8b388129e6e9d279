"""The gate: each fault of each scalar sensor is named, and readings with their usual noise pass."""

import math
from typing import Any

import numpy as np
import pytest

from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.navigation.gate import Gate
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.depth import DepthSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.feedback import FeedbackSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.sensors.range import RangeSettings
from auvsim.vehicles import library

ACTUATION = library.vehicle("remus100").actuation
SENSORS: dict[str, Any] = {
    "compass": CompassSettings(), "depth": DepthSettings(), "gyro": GyroSettings(enabled=True),
    "dvl": DvlSettings(enabled=True), "range_a": RangeSettings(), "feedback": FeedbackSettings(),
}  # fmt: skip
# Component that goes wrong, a value that jumps, and one that cannot be.
FAULTS = {
    "compass": (0, 2.5, 40.0), "depth": (0, 60.0, -9999.0), "gyro": (2, 6.0, 99.0), "dvl": (1, 9.0, 300.0),
    "range_a": (0, 400.0, -50.0),
}  # fmt: skip


def readings(sensor: str, count: int, seed: int = 0) -> list[Reading]:
    """A vehicle that turns at 12 deg/s and dives at 0.3 m/s, at its sensors' rates, with their noise."""
    settings, noise = SENSORS[sensor], np.random.default_rng(seed)
    found = []
    for k in range(count):
        t = 3.0 + k / settings.rate
        value = {
            "compass": lambda t: (wrap(0.2 * t + math.radians(1.0) * noise.normal()), 0.01 * noise.normal(), 0.02),
            "depth": lambda t: (5.0 + 0.3 * t + 0.05 * noise.normal(),),
            "gyro": lambda t: (0.0003 * noise.normal(), 0.0003 * noise.normal(), 0.2 + 0.0003 * noise.normal()),
            "dvl": lambda t: tuple(np.array((1.5, 0.1, 0.02, 1.4, 0.1, 0.02)) + 0.02 * noise.normal(size=6)),
            "range_a": lambda t: (120.0 - 1.5 * t + 0.2 * noise.normal(),),
            "feedback": lambda t: (0.1, -0.1, 0.1, -0.1, 90.0),
        }[sensor](t)
        found.append(Reading(sensor, t, t, np.array(value), k))
    return found


def judged(gate: Gate, sensor: str, given: list[Reading]) -> list[str]:
    return [gate.judge(reading) for reading in given]


def altered(reading: Reading, component: int, value: float) -> Reading:
    changed = reading.value.copy()
    changed[component] = value
    return reading._replace(value=changed)


@pytest.mark.parametrize("sensor", SENSORS)
def test_usual_noise_passes(sensor: str):
    """Ten thousand readings; fin angles that do not move are no fault."""
    assert set(judged(Gate(SENSORS, ACTUATION), sensor, readings(sensor, 10_000 if sensor != "range_a" else 15))) == {
        ""
    }


@pytest.mark.parametrize("sensor", FAULTS)
def test_each_fault_is_named_and_costs_no_good_reading(sensor: str):
    component, spike, impossible = FAULTS[sensor]
    good, wrong = readings(sensor, 12), {}
    wrong[3] = (altered(good[3], component, math.nan), "not_finite")
    wrong[5] = (altered(good[5], component, impossible), "impossible")
    wrong[7] = (altered(good[7], component, spike), "spike")
    wrong[8] = (good[8]._replace(stamp=good[8].stamp + 1e5), "clock")
    wrong[9] = (good[9]._replace(stamp=good[9].stamp - 1e5), "clock")
    given = [wrong[k][0] if k in wrong else reading for k, reading in enumerate(good)]
    expected = [wrong[k][1] if k in wrong else "" for k in range(12)]
    assert judged(Gate(SENSORS, ACTUATION), sensor, given) == expected


@pytest.mark.parametrize("sensor", FAULTS)
def test_a_frozen_value_is_named_after_twenty_readings(sensor: str):
    """And not where a log rounds its values."""
    good = readings(sensor, 60)
    given = [r if k < 5 else r._replace(value=good[5].value) for k, r in enumerate(good)]
    reasons = judged(Gate(SENSORS, ACTUATION), sensor, given)
    assert reasons[:25] == [""] * 25
    assert set(reasons[27:]) == {"frozen"}
    assert set(judged(Gate(SENSORS, ACTUATION, frozen=False), sensor, given)) == {""}


def test_a_lost_track_of_a_dvl_is_no_fault():
    good = readings("dvl", 8)
    for k in (2, 3):
        good[k].value[:3] = math.nan
    good[5].value[3:] = math.nan
    assert judged(Gate(SENSORS, ACTUATION), "dvl", good) == [""] * 8


def test_feedback_that_is_no_number_is_refused():
    """One would otherwise end the estimator."""
    reading = altered(readings("feedback", 1)[0], 4, math.nan)
    passed, refused = Gate(SENSORS, ACTUATION).passed([reading])
    assert passed == []
    assert [(o.kind, o.reason, o.accepted) for o in refused] == [("feedback", "not_finite", False)]
