"""Views of a sonar: an echo comes where it was, on the fan and on the map, which grows with time."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvsim.video import sonar
from auvsim.video.canvas import Box
from auvsim.video.sonar import CELL, Frames, SonarViews

BEARINGS, RANGES = np.radians(np.linspace(-60.0, 60.0, 61)), np.arange(0.5, 20.0, 0.25)
POSE, NOSE, ALTITUDE = np.array([7.0, -12.0, 0.8]), 1.5, 4.0
BOX = Box(0, 0, 400, 300)


def frames(bearing: float = 0.35, distance: float = 11.0) -> Frames:
    """Two frames, 5 s apart: first nothing, then an echo at a bearing, as far away on the floor."""
    levels = np.zeros((2, len(BEARINGS), len(RANGES)))
    beam = int(np.argmin(np.abs(BEARINGS - bearing)))
    bin_ = int(np.argmin(np.abs(RANGES - math.hypot(distance, ALTITUDE))))
    levels[1, beam - 1 : beam + 2, bin_ - 2 : bin_ + 3] = 60.0
    return Frames(
        times=np.array([10.0, 15.0]), levels=levels, bearings=BEARINGS, ranges=RANGES,
        poses=np.vstack((POSE + np.array((-3.0, 2.0, 0.5)), POSE)), ahead=NOSE, altitudes=np.full(2, ALTITUDE),
    )  # fmt: skip


@pytest.fixture
def views() -> SonarViews:
    motion: Any = SimpleNamespace(
        positions=np.array([[0.0, 0.0, -5.0], [30.0, 25.0, -5.0]]), times=np.array([0.0, 20.0]),
        belief_times=np.array([0.0, 20.0]), belief_positions=np.array([[0.0, 0.0, -5.0], [30.0, 25.0, -5.0]]),
        at=lambda time: SimpleNamespace(position=np.array([0.0, 0.0, -5.0]), heading=0.0),
    )  # fmt: skip
    return SonarViews(frames(), motion, {})


def drawn(views: SonarViews, view: str, time: float) -> np.ndarray:
    """A view's picture."""
    picture = np.zeros((BOX.height, BOX.width, 3), dtype=np.uint8)
    views.draw(view, picture, BOX, time)
    return picture


def test_an_echo_is_on_the_map_where_it_was(views: SonarViews) -> None:
    """Ahead of the transducer, which is ahead of the vehicle, by its bearing and the way on the floor."""
    drawn(views, "map", 16.0)
    mean = views._total / np.maximum(views._counts, 1)
    place = views._low + CELL * np.array(np.unravel_index(int(np.argmax(mean)), mean.shape))
    heading = POSE[2]
    expected = POSE[:2] + NOSE * np.array((math.cos(heading), math.sin(heading)))
    expected = expected + 11.0 * np.array((math.cos(heading + 0.35), math.sin(heading + 0.35)))
    np.testing.assert_allclose(place, expected, atol=0.8)  # a beam is 0.4 m wide there, averaged over three


def test_the_map_grows_with_the_frames(views: SonarViews) -> None:
    """Nothing before the first, one frame's floor after it, more after the second."""
    seen = []
    for time in (9.0, 12.0, 16.0):
        drawn(views, "map", time)
        seen.append(int(np.count_nonzero(views._counts)))
    assert seen[0] == 0 < seen[1] < seen[2]
    # A sector of 120 deg from where 0.5 m of slant range is too near to 19.2 m on the floor.
    assert seen[1] * CELL**2 == pytest.approx(math.pi / 3.0 * (RANGES[-1] ** 2 - ALTITUDE**2), rel=0.05)


def test_an_echo_is_on_the_fan_at_its_slant_range(views: SonarViews) -> None:
    """Its pixels lie to starboard, at its bearing from the lower middle; before the first frame there is none."""
    dark, fan = drawn(views, "sonar", 5.0), drawn(views, "sonar", 16.0)
    level = (0.5 * 60.0 - sonar.DARKEST) / (sonar.BRIGHTEST - sonar.DARKEST)
    rows, columns = np.nonzero((fan == sonar._FAN[int(255 * level)]).all(axis=2))
    across, up = columns.mean() - BOX.width // 2, round(0.97 * BOX.height) - rows.mean()
    assert math.atan2(across, up) == pytest.approx(0.35, abs=0.06)
    scale = 0.48 * BOX.width / (RANGES[-1] * math.sin(math.radians(60.0)))  # the sector fills the width
    assert math.hypot(across, up) / scale == pytest.approx(math.hypot(11.0, ALTITUDE), abs=0.3)
    assert (dark[:40, 150:250] == dark[0, 0]).all()
    assert views.name("sonar", 5.0).startswith("sonar, no frame yet")
    assert "frame of 15 s" in views.name("sonar", 16.0)


def test_bad_levels_and_far_floors_stay_off_the_map(views: SonarViews) -> None:
    """Above half the reach too little floor is seen; without an altitude it is not known where it is."""
    for altitude in (0.6 * RANGES[-1], math.nan):
        high = SonarViews(
            Frames(**{**vars(frames()), "altitudes": np.full(2, altitude)}), views._motion, {}
        )  # fmt: skip
        drawn(high, "map", 16.0)
        assert not high._counts.any()
    assert sonar.VIEWS == ("map", "sonar")
