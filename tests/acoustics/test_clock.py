"""Clocks: what they show of the time, and their random walk."""

import numpy as np
import pytest

from auvsim.acoustics.clock import Clock, ClockSettings
from auvsim.base.randomness import stream


def clock(seed=0, **settings):
    return Clock(ClockSettings(**settings), stream(seed, 0, "auv/clock"))


def test_offset_drift_and_leap():
    found = clock(offset=0.25, drift_ppm=-40.0, jump=2.0, jump_time=100.0)
    assert found.read(50.0) == pytest.approx(50.25 - 50.0 * 40e-6, abs=1e-12)
    assert found.read(100.0) == pytest.approx(102.25 - 100.0 * 40e-6, abs=1e-12)


def test_the_time_at_which_it_shows_something():
    found = clock(offset=-0.5, drift_ppm=200.0)
    assert found.read(found.when(80.0, near=70.0)) == pytest.approx(80.0, abs=1e-12)


def test_what_it_shows_does_not_depend_on_when_it_was_read():
    one, other = clock(walk=1e-3), clock(walk=1e-3)
    for time in np.linspace(0.0, 90.0, 301):
        one.read(time)
    assert one.read(90.7) == other.read(90.7)


def test_its_walk_grows_with_the_root_of_time():
    """400 clocks: the sd of 300 s is 300^0.5 of the density; a sample's sd is good to 1 / sqrt(800) = 3.5 %."""
    walks = np.array([clock(seed, walk=2e-3).read(300.0) - 300.0 for seed in range(400)])
    assert walks.std() == pytest.approx(2e-3 * 300.0**0.5, rel=4 * 0.035)
    assert abs(walks.mean()) < 4 * 2e-3 * 300.0**0.5 / 20.0
