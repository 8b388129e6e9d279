"""A dock's clock that is off, told from a way that is known: its sign and size, and no alarm where it is right."""

import math

import numpy as np
import pytest

from auvsim.base.reading import Reading
from auvsim.missions.docking.lag import LagWatch
from auvsim.navigation.estimate import Estimate

DOCK_HEADING = 0.4


def watched(offset: float, seed: int = 1, turns: bool = True, outliers: float = 0.15) -> float | None:
    """What a watch says of 40 fixes of 0.5 m, one every 8 s: loops at 1.3 m/s in a current of 0.4 m/s.

    Args:
        offset: Of the dock's clock, ahead of the vehicle's [s].
        seed: Of the noises.
        turns: Whether the vehicle turns at all.
        outliers: Share of fixes that are wrong by 20 m.
    """
    noise, watch = np.random.default_rng(seed), LagWatch()
    heading, place = 0.3, np.array((-200.0, 60.0))
    cos, sin = math.cos(DOCK_HEADING), math.sin(DOCK_HEADING)
    for k in range(1, 701):
        time = 0.5 * k
        heading += 0.5 * 0.08 * math.sin(time / 25.0) * turns
        through = 1.3 * np.array((math.cos(heading), math.sin(heading)))
        place = place + 0.5 * (through + np.array((0.3, -0.26)))
        fixes = []
        if k % 16 == 0:
            seen = place + 0.5 * noise.standard_normal(2)
            if noise.uniform() < outliers:
                seen = seen + 20.0 * noise.choice((-1.0, 1.0), 2)
            x, y = seen[0] * cos + seen[1] * sin, seen[1] * cos - seen[0] * sin
            fixes = [Reading("usbl", time + offset, time + 1.5, np.array((x, y, 0.0, DOCK_HEADING, 0.0, 0.0, 20.0)), k)]
        estimate = Estimate(
            time=time, position=np.zeros(3), heading=heading, velocity=np.array((1.3, 0.0, 0.0)), current=np.zeros(2),
            covariance=np.eye(8), initialised=True,
        )  # fmt: skip
        watch.observe(fixes, estimate)
    return watch.offset()


@pytest.mark.parametrize("offset", [-8.0, -4.0, 5.0])
def test_an_offset_is_told_with_its_sign(offset: float) -> None:
    """A fix of 0.5 m is worth 0.4 s at that speed, and there are forty; offsets are tried in steps of 0.5 s."""
    found = watched(offset)
    assert found is not None
    assert found == pytest.approx(offset, abs=0.5)


@pytest.mark.parametrize(("offset", "turns"), [(0.0, True), (0.5, True), (-8.0, False)])
def test_there_is_no_alarm_without_reason(offset: float, turns: bool) -> None:
    """A clock that is right, or off by less than counts; and straight ahead a lag is no other than a place."""
    assert watched(offset, turns=turns) is None
    assert watched(offset, seed=2, turns=turns) is None
