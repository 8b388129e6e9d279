"""The mean of a sampled rate: against the integral of the straight lines between its readings."""

import math

import numpy as np
import pytest

from auvsim.navigation.rate_mean import RateMean

STAMPS = np.array((0.05, 0.12, 0.31, 0.33, 0.58, 0.71, 0.9, 1.4))
RATES = np.array((0.2, 0.5, -0.1, 0.3, 0.32, 0.9, -0.4, 0.1))


def integral(begin: float, end: float) -> float:
    """Of the lines between readings, held beyond the first and the last, by a fine trapezoid rule."""
    fine = np.linspace(begin, end, 200_001)
    return float(np.trapezoid(np.interp(fine, STAMPS, RATES), fine))


def test_it_is_the_integral_between_updates_that_no_reading_falls_on() -> None:
    """Over each update by itself, so that all together are the whole; readings arrive with the update after them."""
    mean, given, last = RateMean(), 0, 0.0
    mean.mean(0.0)
    for time in (0.2, 0.45, 0.5, 1.0):
        while given < len(STAMPS) and STAMPS[given] <= time:
            mean.add(float(STAMPS[given]), float(RATES[given]))
            given += 1
        # What comes after the update is not known yet: the last reading is held.
        fine = np.linspace(last, time, 200_001)
        known = np.interp(fine, STAMPS[:given], RATES[:given])
        assert mean.mean(time) == pytest.approx(np.trapezoid(known, fine) / (time - last), abs=1e-6)
        last = time


def test_readings_that_were_there_in_time_are_all_of_it() -> None:
    """The same with readings up to and past the update."""
    mean = RateMean()
    mean.mean(0.1)
    for stamp, rate in zip(STAMPS.tolist(), RATES.tolist(), strict=True):
        mean.add(stamp, rate)
    assert mean.mean(0.6) == pytest.approx(integral(0.1, 0.6) / 0.5, abs=1e-6)
    assert mean.mean(1.7) == pytest.approx(integral(0.6, 1.7) / 1.1, abs=1e-6)


def test_without_any_reading_nothing_turns_and_bad_ones_are_left_out() -> None:
    """One that is late, twice there or no number changes nothing."""
    mean = RateMean()
    assert (mean.mean(0.5), mean.mean(1.0)) == (0.0, 0.0)
    for stamp, rate in ((1.1, 0.3), (1.1, 9.0), (1.05, 9.0), (1.2, math.nan), (1.3, 0.3)):
        mean.add(stamp, rate)
    assert mean.mean(1.5) == pytest.approx(0.3)


def test_a_sensor_that_fell_silent_turns_nothing() -> None:
    """Its last rate would turn a vehicle for the rest of a mission."""
    mean = RateMean()
    mean.mean(1.0)
    mean.add(1.5, 0.3)
    assert [mean.mean(2.0), mean.mean(2.4), mean.mean(3.0)] == [pytest.approx(0.3)] * 3
    assert mean.mean(3.5) == 0.0
    mean.add(3.8, -0.2)
    assert mean.mean(4.0) < 0.0
