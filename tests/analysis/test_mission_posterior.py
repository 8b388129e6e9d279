"""Errors to expect beyond first order, against posteriors by importance sampling, an implementation apart."""

import math

import numpy as np
import pytest

from auvsim.analysis.mission_posterior import Ranges, expected_error
from auvsim.base.randomness import stream
from estimators.core.models.odometry import SPACE
from estimators.core.odometry_bounds import at_once, bounds

TIMES = 10.0 * np.arange(1, 31)
BEYOND, SIGMA = 60.0, 3.0  # how far north the leader is on the same course, and the noise of a range [m]
DEVIATIONS = {"north": 3.0, "east": 2.0, "current_north": 0.3, "current_east": 0.4}
PROPOSED = (3.0, 2.0, 0.03, 0.12)  # deviations about the truth that samples have, wider than posteriors


def one_course():
    rows = np.column_stack((np.full(30, 10.0), np.tile([5.0, 9.0], (30, 1)), np.zeros((30, 3))))
    return Ranges(TIMES, rows, np.tile([-BEYOND, 0.0, 2.0], (30, 1)), np.full(30, SIGMA**2), None)


def sampled_variance(rng):
    """Variance of the position's posterior at the end of a drawn mission."""
    deviations = np.array([*DEVIATIONS.values()])
    truth, count = deviations * rng.standard_normal(4), 150_000
    ranges = math.hypot(BEYOND, 2.0) + SIGMA * rng.standard_normal(30)
    x = truth + np.array(PROPOSED) * rng.standard_normal((count, 4))  # about the truth
    logs = -0.5 * (((x / deviations) ** 2) - ((x - truth) / PROPOSED) ** 2).sum(axis=1)
    for t, r in zip(TIMES, ranges, strict=True):
        off = x[:, :2] - truth[:2] + t * (x[:, 2:] - truth[2:]) - (BEYOND, 0.0)
        logs -= 0.5 * ((r - np.sqrt((off**2).sum(axis=1) + 4.0)) / SIGMA) ** 2
    shares = np.exp(logs - logs.max())
    assert shares.sum() ** 2 / (shares**2).sum() > 20.0  # samples that count
    at = x[:, :2] + TIMES[-1] * x[:, 2:]
    mean = shares @ at / shares.sum()
    return float(shares @ ((at - mean) ** 2).sum(axis=1) / shares.sum())


def test_on_one_course_it_is_that_of_the_posterior_and_a_tenth_of_the_bound():
    """Eight missions each, whose posteriors differ by half in variance: 25 % of both together in the rms."""
    ranges, prior = one_course(), np.diag(SPACE.vector(DEVIATIONS) ** 2)
    found = expected_error(ranges, prior, np.zeros(9), TIMES[-1], stream(3, 0, "test"))
    rng = np.random.default_rng(8)
    expected = math.sqrt(np.mean([sampled_variance(rng) for _ in range(8)]))
    sights = at_once(ranges.times, ranges.displacements, range_deviation=SIGMA)
    first_order = bounds(prior, sights, ranges.relative[None, None], np.array([29]))[0, 0]
    assert found == pytest.approx(expected, rel=0.25)
    assert found < 0.4 * math.sqrt(first_order[0, 0] + first_order[1, 1])


def test_where_ranges_are_straight_it_is_the_bound():
    """The same from 40 km away, where an error of 100 m across bends a range by a tenth of a metre."""
    ranges = one_course()
    ranges = ranges._replace(relative=ranges.relative - (40_000.0, 0.0, 0.0))
    prior = np.diag(SPACE.vector(DEVIATIONS) ** 2)
    found = expected_error(ranges, prior, np.zeros(9), TIMES[-1], stream(3, 0, "test"))
    sights = at_once(ranges.times, ranges.displacements, range_deviation=SIGMA)
    first_order = bounds(prior, sights, ranges.relative[None, None], np.array([29]))[0, 0]
    # The bank's 49 currents reach as far as the normal density they stand for to some percent.
    assert found == pytest.approx(math.sqrt(first_order[0, 0] + first_order[1, 1]), rel=0.05)
