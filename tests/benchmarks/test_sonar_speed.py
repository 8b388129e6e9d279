"""Frames a second of the imaging sonar, over grids of several sizes; run with --benchmark-enable to see them."""

import math

import numpy as np
import pytest
from surroundings import Around

from auvsim.base.frames import euler_to_quaternion
from auvsim.physics.truth import Truth
from auvsim.sensors.imaging_sonar import ImagingSonar, ImagingSonarSettings
from auvsim.water.terrain_grid import Corner, GriddedFloor

HEIGHT = 5.0  # above the floor [m]
LEAST = 200.0  # frames a second on one core, of the fastest of many; one busy with other work as well is slower


def rough(points: int, spacing: float = 0.1) -> Around:
    """A rough floor of so many points along each side, the vehicle over its middle."""
    rise = np.random.default_rng(1).normal(0.0, 0.03, (points, points))
    side = 0.5 * spacing * points
    return Around(terrain=GriddedFloor(Corner(-side, -side, spacing, spacing), 20.0 + rise))


@pytest.mark.parametrize("points", [512, 4096])
def test_a_frame(benchmark, points: int) -> None:
    """One frame with speckle: floor, shadows, beams and noise."""
    sonar = ImagingSonar(ImagingSonarSettings(beams=256, bins=400), np.random.default_rng(1))
    attitude = (0.0, -0.02, 0.3)
    truth = Truth(
        time=0.0, position=np.array([3.0, -2.0, 20.0 - HEIGHT]), quaternion=euler_to_quaternion(*attitude),
        attitude=np.array(attitude), nu=np.zeros(6), current=np.zeros(3), actuators=np.zeros(3),
    )  # fmt: skip
    world = rough(points)
    reading = benchmark(sonar.measure, truth, world)
    assert reading is not None
    if benchmark.stats is not None:  # only where times are taken
        assert 1.0 / benchmark.stats.stats.min > LEAST
    frame = sonar.mean(truth, world)
    assert frame.shape == (256, 400)
    near = sonar.ranges < 0.9 * HEIGHT / math.cos(0.1)
    assert frame[:, ~near].mean() > frame[:, near].mean()  # the floor begins below the vehicle
