"""The trim of the depth: zero until it is needed, scheduled with speed, and warnings at its limit."""

import math

import numpy as np
import pytest

from auvsim.control.trim import FAR, HELPLESS, PATIENCE, Trim
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run

LIMIT, PERIOD = math.radians(20.0), 0.1


def feed(trim, error, *, seconds, speed=1.0, setpoint=12.0, limited=False, begun_from=0.0):
    for tick in range(round(seconds / PERIOD)):
        now = error(tick * PERIOD) if callable(error) else error
        trim.update(setpoint, now, speed, limited, begun_from)
    return trim


def fresh(gain=0.006):
    return Trim(gain, LIMIT, PERIOD)


@pytest.mark.parametrize(
    "case",
    [
        {"error": 0.29},
        {"error": lambda time: 2.5 * math.exp(-0.12 * time)},  # a level vehicle on its way at 1 m/s
        {"error": 2.0, "limited": True},
        {"error": 2.0, "speed": -0.8},
    ],
    ids=["small", "shrinking", "limited", "astern"],
)
def test_it_stays_zero_without_need(case):
    trim = feed(fresh(), seconds=60.0, **case)
    assert not trim.begun
    assert trim.pitch(1.0) == 0.0


def test_it_begins_where_an_error_stays_and_takes_over():
    trim = feed(fresh(), 0.8, seconds=PATIENCE - 2 * PERIOD, begun_from=0.05, speed=1.5)
    assert not trim.begun
    feed(trim, 0.8, seconds=4 * PERIOD, begun_from=0.05, speed=1.5)
    assert trim.begun
    kept = trim.pitch(1.0)
    assert trim.pitch(1.5) == pytest.approx(0.05, abs=1e-3)  # and what it has learnt since
    feed(trim, -0.5, seconds=10.0, speed=1.5)
    assert trim.pitch(1.0) == pytest.approx(kept - 0.006 * 0.5 * 10.0, abs=1e-9)


def test_it_is_scheduled_with_speed_and_limited():
    """The lift that a pitch gives grows with the square of the speed."""
    trim = feed(fresh(gain=0.0), 0.8, seconds=PATIENCE + 2 * PERIOD, begun_from=0.04)
    assert trim.pitch(2.0) == pytest.approx(0.04 / 4.0, abs=1e-12)
    assert trim.pitch(0.8) == pytest.approx(0.04 / 0.64, abs=1e-12)
    assert trim.pitch(0.0) == LIMIT
    trim = feed(fresh(), 0.8, seconds=PATIENCE + 2 * PERIOD, begun_from=0.04)
    kept = trim.pitch(1.0)
    feed(trim, FAR + 0.1, seconds=50.0)
    assert trim.pitch(1.0) == kept  # far off it stands still
    feed(trim, 1.0, seconds=50.0, limited=True)
    assert trim.pitch(1.0) == kept  # nor does it wind up


def test_a_new_depth_begins_anew():
    trim = fresh()
    for setpoint in (10.0, 11.0, 12.0, 13.0):
        feed(trim, 1.0, seconds=0.8 * PATIENCE, setpoint=setpoint)
    assert not trim.begun


def test_helpless_is_who_gains_nothing_at_the_limit():
    assert feed(fresh(), 2.0, seconds=HELPLESS + 2 * PERIOD, limited=True).helpless
    assert not feed(fresh(), 2.0, seconds=HELPLESS - 2 * PERIOD, limited=True).helpless
    assert not feed(fresh(), 0.4, seconds=3 * HELPLESS, limited=True).helpless
    assert not feed(fresh(), lambda time: 20.0 - 0.1 * time, seconds=60.0, limited=True).helpless  # a slow dive
    drifting = feed(fresh(), lambda time: 2.0 + 0.3 * time, seconds=HELPLESS + 1.0, limited=True)
    assert drifting.helpless
    assert not feed(drifting, 2.0, seconds=PERIOD).helpless


def trial(number, **pinned):
    plan = sampling.merge(sampling.default_plan(), pinned)
    return run(scenario.parse(sampling.draw(plan, 31, number)), seed=31, trial=number)


def test_a_level_vehicle_is_steered_as_without_it():
    """Whole trials of the default plan, bit for bit."""
    for number in range(2):
        logs = [trial(number, control={"trim": trim}) for trim in (True, False)]
        for group in ("truth", "command"):
            for name, values in logs[0].groups[f"vehicles/remus100/{group}"].items():
                assert np.array_equal(values, logs[1].groups[f"vehicles/remus100/{group}"][name]), (number, name)


def test_a_vehicle_that_floats_keeps_its_depth():
    """9 N: without trim it stays 0.6 m too shallow on its way in, beyond what the old integral reaches."""
    depths = []
    for trim in (True, False):
        log = trial(4, control={"trim": trim}, vehicle={"ballast": {"net_buoyancy": 9.0}})
        truth = log.groups["vehicles/remus100/truth"]
        late = (truth["time"] > 160.0) & (truth["time"] < 240.0)
        depths.append(truth["position"][late, 2].mean() - 20.0)
        assert "authority" not in log.groups["event"]["kind"].tolist()
    assert abs(depths[0]) < 0.25
    assert depths[1] < -0.4


def test_more_than_it_can_hold_is_a_warning():
    """25 N want more than 20 degrees of pitch at 1 m/s; one event for the stretch."""
    log = trial(4, vehicle={"ballast": {"net_buoyancy": 25.0}}, duration=400.0)
    kinds = log.groups["event"]["kind"].tolist()
    assert kinds.count("authority") >= 1
    text = log.groups["event"]["text"].tolist()[kinds.index("authority")]
    assert text == "the largest pitch of 20 deg does not bring it to its depth"
