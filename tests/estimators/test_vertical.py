"""The offset of a depth gauge against fixes: known answers, tilt of the dock, outliers, consistency over seeds."""

import math

import numpy as np
import pytest

from estimators.docking.usbl import UsblFix, UsblModel
from estimators.docking.vertical import VerticalFilter

MODEL = UsblModel(transceiver=(0.0, 0.0, -1.0))
TRANSPONDER = -0.1
DOCK = 20.0


def approach(seed: int, offset: float, tilt: tuple[float, float], outliers: float = 0.0) -> VerticalFilter:
    """A filter after an approach from 100 m to 5 m, a little to starboard, at 17 m; the dock's attitude reads zero."""
    generator = np.random.default_rng(seed)
    found = VerticalFilter(MODEL, TRANSPONDER, offset=0.5, tilt=math.radians(0.5))
    depth = 17.0
    for k, away in enumerate(np.linspace(100.0, 5.0, 20)):
        time = 5.0 * k
        found.gauge(time, depth + offset)
        found.gauge(time + 0.5, depth + offset)
        # In the dock's own axes, pitched up and rolled by the tilt: what lies ahead appears lower, for small angles.
        north, east, down = -away, 3.0, depth + TRANSPONDER - DOCK + 1.0
        measured = np.array((north - tilt[0] * down, east + tilt[1] * down, down + tilt[0] * north - tilt[1] * east))
        measured += MODEL.deviation(float(np.linalg.norm(measured))) * generator.standard_normal(3)
        if generator.uniform() < outliers:
            measured[2] += 10.0
        found.fix(UsblFix(stamp=time + 0.2, received=time + 1.8, position=measured, heading=0.4), DOCK)
    return found


def test_offset_is_found_though_the_dock_is_tilted() -> None:
    """0.6 m too much, by a dock that pitches 0.4 and rolls -0.3 degrees more than it says."""
    found = approach(1, 0.6, (math.radians(0.4), math.radians(-0.3)))
    assert found.offset == pytest.approx(0.6, abs=3.0 * math.sqrt(found.variance))
    assert (
        math.sqrt(found.variance) < 0.05
    )  # half a degree of tilt is 0.04 m at 5 m; fixes at several distances tell it from the offset


def test_outliers_move_little() -> None:
    """Every fifth fix 10 m too low: as good as without, but for the fixes that are lost."""
    found = approach(3, -0.4, (0.0, 0.0), outliers=0.2)
    assert found.offset == pytest.approx(-0.4, abs=0.1)


def test_variance_explains_the_errors() -> None:
    """Mean NEES of 60 seeds, one degree of freedom each: chi-square of 60 is in 0.66 to 1.40 of 60 at 99 %.

    Below it is allowed here: the filter also reckons with noise of the gauge, which these readings do not have.
    """
    generator, nees = np.random.default_rng(7), []
    for seed in range(60):
        offset, tilt = 0.5 * generator.standard_normal(), np.radians(0.5) * generator.standard_normal(2)
        found = approach(seed, offset, (tilt[0], tilt[1]))
        nees.append((found.offset - offset) ** 2 / found.variance)
    assert 0.05 < np.mean(nees) < 1.40


def test_nothing_is_learnt_from_a_fix_without_a_gauge() -> None:
    found = VerticalFilter(MODEL, TRANSPONDER)
    found.fix(UsblFix(stamp=1.0, received=2.0, position=(-10.0, 0.0, 0.0), heading=0.0), DOCK)
    assert found.offset == 0.0
    assert found.variance == pytest.approx(0.25)
