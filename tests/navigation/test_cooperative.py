"""Followers with the estimators of papers 2 and 3 in whole runs: they are right, and as wrong as they say."""

from dataclasses import replace

import numpy as np
import pytest

from auvsim import load_scenario
from auvsim.base.errors import InputError
from auvsim.navigation.estimate import Estimate, estimator_events
from auvsim.navigation.heard import along, bend
from auvsim.simulation.run import Simulation, run


def follower(kind, duration, tell=None, **sensors):
    return load_scenario(
        "leader_follower", duration=duration,
        vehicles={
            "leader": {"modem": {"tell": tell or {}}},
            "follower": {"estimator": {"kind": kind}, "sensors": sensors},
        },
    )  # fmt: skip


def judged(log, since):
    """Largest error and mean NEES per degree of freedom of the follower's position after a time [s]."""
    own = log.vehicle("follower")
    estimate, truth = own["estimate"], own["truth"]
    there = np.array([np.interp(estimate["time"], truth["time"], truth["position"][:, k]) for k in range(2)]).T
    late = estimate["time"] > since
    error, covariance = estimate["position"][late, :2] - there[late], estimate["covariance"][late, :2, :2]
    nees = [e @ np.linalg.solve(P, e) / 2 for e, P in zip(error, covariance, strict=True)]
    return np.hypot(*error.T).max(), np.mean(nees)


def test_the_bank_finds_an_unknown_current():
    """280 m would be off without packets; errors stay alike for 100 s, whose NEES is below 4.6 in 99 of 100 runs."""
    log = run(follower("motion_radius", 400.0), seed=8)
    worst, nees = judged(log, 300.0)
    assert worst < 30.0
    assert nees < 4.6
    assert log.vehicle("follower")["estimate"]["current"][-1] == pytest.approx((0.5, 0.5), abs=0.1)


@pytest.mark.parametrize("tell", [{}, {"delay": 15.0}], ids=["at once", "15 s late"])
def test_late_packets_are_used(tell):
    log = run(follower("path_prediction", 300.0, tell, dvl={"maximum_altitude": 250.0}), seed=8)
    worst, nees = judged(log, 150.0)
    assert worst < 25.0
    assert nees < 4.6
    fates = log.vehicle("follower")["measurements"]
    kinds = {"state"} | ({"pulse"} if tell else set())
    received = log.vehicle("follower")["received"]
    assert set(received["kind"].tolist()) == kinds
    assert fates["accepted"][fates["sensor"] == "leader"].sum() == len(received["time"])


@pytest.mark.parametrize(
    ("kind", "sensors", "text"),
    [
        ("motion_radius", {"dvl": {"enabled": False}}, r"'motion_radius' of 'follower': needs a DVL"),
        ("path_prediction", {"gyro": {"enabled": False}}, r"'path_prediction' of 'follower': needs a gyro"),
    ],
)
def test_what_is_missing_is_named(kind, sensors, text):
    with pytest.raises(InputError, match=text):
        Simulation(follower(kind, 10.0, **sensors), seed=0)


def test_a_range_is_longer_than_its_tangent():
    """Mean and variance over a million errors across it; the next terms of the series are (sd / range)^2 of them."""
    distance, deviation = 200.0, 15.0
    across = deviation * np.random.default_rng(0).standard_normal(1_000_000)
    longer = np.hypot(distance, across) - distance
    mean, variance = bend(deviation**2, distance)
    assert mean == pytest.approx(longer.mean(), rel=0.02)
    assert variance == pytest.approx(longer.var(), rel=0.05)


def test_variance_along_a_way():
    """Of a covariance with unlike axes: as the quadratic form has it, for a way of any length, or none."""
    P = np.array(((4.0, -1.5), (-1.5, 9.0)))
    block = P[0, 0], P[0, 1], P[1, 1]
    way = np.array((3.0, -0.7))
    assert along((3.0, -0.7), *block) == pytest.approx(way @ P @ way / (way @ way))
    assert along((6.0, -1.4), *block) == pytest.approx(along((3.0, -0.7), *block))
    assert along((0.0, 0.0), *block) == 9.0


def straight(kind, duration, course_deg=8.0, follows_deg=8.0):
    """Leader and follower hold their headings."""
    held = [{"kind": "weave", "course_deg": course, "amplitude_deg": 0.0} for course in (course_deg, follows_deg)]
    return load_scenario(
        "leader_follower", duration=duration,
        vehicles={
            "leader": {"mission": {"pattern": held[0]}},
            "follower": {
                "mission": {"pattern": held[1]}, "estimator": {"kind": kind}, "start": {"heading_deg": follows_deg}
            },
        },
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["range_ekf", "motion_radius"])
def test_blind_geometry_is_told_with_its_reason(kind):
    log = run(straight(kind, 300.0), seed=8)
    events = log.vehicle("follower")["event"]
    texts = events["text"][events["kind"] == "doubtful"].tolist()
    assert any("no motion relative to the leader" in text or "a constant course" in text for text in texts)
    assert "told" not in events["kind"].tolist()


@pytest.mark.slow
@pytest.mark.parametrize(("follows_deg", "most"), [(8.0, 8.0), (30.0, 2.0)], ids=["parallel", "oblique"])
def test_an_extended_filter_does_not_think_that_it_sees_what_nobody_can(follows_deg, most):
    """Six runs of 900 s; to first order alone NEES is 1400 in parallel, where rank is 2 of 4."""
    logs = [run(straight("range_ekf", 900.0, follows_deg=follows_deg), seed=s) for s in range(6)]
    assert np.mean([judged(log, 250.0)[1] for log in logs]) < most


def test_doubts_are_told_where_they_begin_and_when_they_end():
    """Numbers in a doubt may change without a further event; another doubt is one."""
    sure = Estimate.unknown(0.0)
    blind, longer, mirror = (
        replace(sure, warnings=warnings)
        for warnings in (("rank 2: 30 s",), ("rank 2: 32 s",), ("rank 2: 34 s", "mirror: 0.1"))
    )
    assert estimator_events(None, sure) == []
    assert estimator_events(sure, blind) == [("doubtful", "rank 2: 30 s")]
    assert estimator_events(blind, longer) == []
    assert estimator_events(longer, mirror) == [("doubtful", "mirror: 0.1")]
    assert [kind for kind, _ in estimator_events(mirror, sure)] == ["told"]
