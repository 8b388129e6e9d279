"""Followers with the estimators of papers 2 and 3 in whole runs: they are right, and as wrong as they say."""

import numpy as np
import pytest

from auvsim import load_scenario
from auvsim.base.errors import InputError
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
