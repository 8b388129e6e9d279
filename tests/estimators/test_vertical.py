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


LIGHT = math.radians(0.5)  # noise of an elevation and of its levelling together, and the constant error's deviation


def by_light(seed: int, offset: float, error: float, wrong: float = 0.0) -> VerticalFilter:
    """A filter after one far fix and 20 sights of the light from 14 to 3 m, with the camera 0.2 m below the origin.

    Args:
        seed: Of the noises.
        offset: Of the gauge [m].
        error: Constant error of the camera's elevation [rad].
        wrong: Share of sights that are 20 degrees too high.
    """
    generator, depth = np.random.default_rng(seed), 19.5
    found = VerticalFilter(MODEL, TRANSPONDER, offset=0.5, tilt=0.0087, lights={"other": LIGHT, "eye": LIGHT})
    found.gauge(0.0, depth + offset)
    measured = np.array((-100.0, 3.0, depth + TRANSPONDER - DOCK + 1.0)) + 0.34 * generator.standard_normal(3)
    found.fix(UsblFix(stamp=0.0, received=0.5, position=measured, heading=0.4), DOCK)
    for k, away in enumerate(np.linspace(14.0, 3.0, 20)):
        found.gauge(0.5 * k + 0.5, depth + offset)
        elevation = math.atan2(depth + 0.2 - DOCK, away) + error + LIGHT * generator.standard_normal()
        elevation += math.radians(20.0) if generator.uniform() < wrong else 0.0
        found.light(0.5 * k + 0.5, "eye", elevation, LIGHT, away, 0.2)
    return found


def test_the_light_tells_the_offset_and_how_the_camera_is_mounted() -> None:
    """Over 60 seeds consistent, as above, and within 0.08 m: 0.5 degrees of its constant error are 0.026 m at 3 m."""
    generator, errors, nees = np.random.default_rng(7), [], []
    for seed in range(60):
        offset, error = 0.5 * generator.standard_normal(), LIGHT * generator.standard_normal()
        found = by_light(seed, offset, error)
        errors.append(found.offset - offset)
        nees.append(errors[-1] ** 2 / found.variance)
        assert found.belief.mean[3] == 0.0  # the other camera has seen nothing
        assert abs(found.belief.mean[4] - error) < 4.0 * math.sqrt(found.belief.covariance[4, 4])
    assert 0.4 < np.mean(nees) < 1.40
    assert math.sqrt(np.mean(np.square(errors))) < 0.08
    assert math.sqrt(by_light(0, 0.3, 0.0).variance) < 0.06


def test_sights_of_something_else_move_little() -> None:
    """Every fifth one 20 degrees too high, 1.1 to 5 m: as good as without, but for those that are lost."""
    assert by_light(3, -0.4, 0.0, wrong=0.2).offset == pytest.approx(-0.4, abs=0.15)


def test_nothing_is_learnt_from_a_light_before_the_dock_has_said_how_deep_it_lies() -> None:
    found = VerticalFilter(MODEL, TRANSPONDER, lights={"eye": LIGHT})
    found.gauge(1.0, 19.0)
    found.light(1.0, "eye", 0.1, LIGHT, 8.0, 0.0)
    assert found.offset == 0.0


def test_nothing_is_learnt_from_a_fix_without_a_gauge() -> None:
    found = VerticalFilter(MODEL, TRANSPONDER)
    found.fix(UsblFix(stamp=1.0, received=2.0, position=(-10.0, 0.0, 0.0), heading=0.0), DOCK)
    assert found.offset == 0.0
    assert found.variance == pytest.approx(0.25)
