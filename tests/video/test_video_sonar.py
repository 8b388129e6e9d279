"""Views of a sonar: an echo comes where it was, on the fan and on the map, which grows to the map of the pictures."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import truth, writer

from auvsim.analysis.sonar_map import CELL, map_figure
from auvsim.base.frames import Array
from auvsim.missions.docking.guidance import Docking
from auvsim.missions.survey.mission import Survey
from auvsim.video import sonar, sonar_fan
from auvsim.video.canvas import Box, Picture
from auvsim.video.motion import Motion
from auvsim.video.sonar import Frames, Laid, estimated
from auvsim.video.sonar_fan import Fan
from auvsim.video.sonar_map import UNSEEN, GrowingMap
from estimators.map_path.frames import SectorGrid

BEARINGS, RANGES = np.radians(np.linspace(-60.0, 60.0, 61)), np.arange(0.5, 20.0, 0.25)
POSE, NOSE, ALTITUDE = np.array([7.0, -12.0, 0.8]), 1.5, 4.0
BOX = Box(0, 0, 400, 300)
GRID = SectorGrid(cell=0.5, shape=(20, 40), ranges=(1.0, 10.0), half_sector=1.0, ahead=0.9)
TIMES = np.array([10.0, 15.0, 22.0])
POSES = np.array([(4.0, -9.0, 0.3), (9.0, -8.0, 0.5), (15.0, -2.0, 1.3)])


def frames(bearing: float = 0.35, distance: float = 11.0) -> Frames:
    """Two frames, 5 s apart: first nothing, then an echo at a bearing, as far away on the floor."""
    rng = np.random.default_rng(2)
    levels = rng.normal(8.0, 3.0, (2, len(BEARINGS), len(RANGES)))
    beam = int(np.argmin(np.abs(BEARINGS - bearing)))
    bin_ = int(np.argmin(np.abs(RANGES - math.hypot(distance, ALTITUDE))))
    levels[1, beam - 1 : beam + 2, bin_ - 2 : bin_ + 3] = 60.0
    return Frames(times=np.array([10.0, 15.0]), levels=levels, bearings=BEARINGS, ranges=RANGES, ahead=NOSE)


def motion(poses: Array = POSES, floor: float = 5.0 + ALTITUDE) -> Any:
    """A vehicle 5 m deep that believed in some poses at the frames' times."""
    positions = np.column_stack((poses[:, 0], -poses[:, 1], np.full(len(poses), -5.0)))
    mission = {"time": np.array([0.0, 99.0]), "floor": np.full(2, floor)}
    by_time = dict(zip(TIMES.tolist(), poses.tolist(), strict=False))

    def at(time: float) -> Any:
        north, east, heading = by_time.get(time, poses[0])
        belief = SimpleNamespace(position=np.array([north, -east, -5.0]), heading=heading)
        return SimpleNamespace(position=np.array([0.0, 0.0, -5.0]), heading=0.0, belief=belief)

    return SimpleNamespace(
        positions=positions, times=np.array([0.0, 30.0, 40.0])[: len(poses)], belief_positions=positions,
        belief_times=np.array([0.0, 30.0, 40.0])[: len(poses)], at=at, log={"mission": mission},
    )  # fmt: skip


@pytest.fixture
def images() -> Array:
    """Of three frames, of which each differs."""
    return np.random.default_rng(7).normal(size=(3, *GRID.shape))


def test_the_map_of_the_video_is_that_of_the_picture(images: Array) -> None:
    """Cell by cell and to the bit, once the last frame is laid; before, some of it is not yet seen."""
    growing = GrowingMap(TIMES, POSES, images, GRID, motion(), {})
    seen = []
    for time in (9.0, 12.0, 22.0):
        growing.draw(BOX, time, 0.04)
        seen.append(int(np.count_nonzero(growing.mosaic.map.counts)))
    assert seen[0] == 0 < seen[1] < seen[2]
    (shown,) = map_figure(images, POSES, GRID).axes[0].images
    np.testing.assert_array_equal(growing.mosaic.map.image, np.asarray(shown.get_array()))
    assert growing.mosaic.map.extent == pytest.approx(shown.get_extent())


def test_cells_are_where_their_places_are() -> None:
    """A lone bright cell of a frame lies in the picture as far from the tracks' end as on the ground, north up."""
    image = np.zeros((1, *GRID.shape))
    image[0, 12, 31] = 9.0
    pose = POSES[1]
    growing = GrowingMap(TIMES[:1], pose[None], image, GRID, motion(), {})
    picture = growing.draw(BOX, 12.0, 0.04)
    bright = (picture == 255).all(axis=2)
    bright[round(0.7 * BOX.height) :, : BOX.width // 4] = False  # the scale
    bright[:, BOX.width // 4 :] &= ~_vehicle(picture, bright)[:, BOX.width // 4 :]
    ahead, aside = GRID.centres[12, 31]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    place = pose[:2] + np.array((c * ahead - s * aside, s * ahead + c * aside))
    scale = min((1.0 - 46.0 / 720.0) * BOX.height, BOX.width) / float((growing._high - growing._low)[0])
    rows, columns = np.nonzero(bright)
    assert rows.size
    found = (growing._low[0] + (BOX.height - rows.mean()) / scale, columns.mean() / scale)
    room = 0.5 * (BOX.width - scale * float((growing._high - growing._low)[1]))
    assert found[0] == pytest.approx(place[0], abs=1.5 * CELL)
    assert growing._low[1] + found[1] - room / scale == pytest.approx(place[1], abs=1.5 * CELL)


def _vehicle(picture: Picture, bright: np.ndarray) -> np.ndarray:
    """White pixels beside the arrowhead's dark outline."""
    from scipy.ndimage import binary_propagation

    outline = (picture == (0, 20, 30)).all(axis=2)
    near = np.zeros_like(outline)
    near[1:], near[:-1] = near[1:] | outline[:-1], near[:-1] | outline[1:]
    return np.asarray(binary_propagation(near & bright, mask=bright))


def test_frames_of_any_estimator_are_laid_where_it_believed_to_be() -> None:
    """An echo lies ahead of the transducer, by its bearing and the way on the floor."""
    poses = np.vstack((POSE + np.array((-3.0, 2.0, 0.5)), POSE))
    laid = estimated(frames(), motion(poses))
    assert laid is not None
    np.testing.assert_array_equal(laid.times, (10.0, 15.0))
    np.testing.assert_allclose(laid.poses, poses)
    row, column = np.unravel_index(int(np.argmax(laid.images[1])), laid.grid.shape)
    ahead, aside = laid.grid.centres[row, column]
    # a beam is 0.4 m wide there, echoes cover three, and their middle is found within a cell
    assert math.hypot(ahead - NOSE, aside) == pytest.approx(11.0, abs=0.9)
    assert math.atan2(aside, ahead - NOSE) == pytest.approx(0.35, abs=0.06)


@pytest.mark.parametrize("floor", [5.0 + 0.6 * RANGES[-1], math.nan])
def test_far_floors_stay_off_the_map(floor: float) -> None:
    """Above half the reach too little floor is seen; without an altitude it is not known where it is."""
    assert estimated(frames(), motion(POSES[:2], floor)) is None


def test_an_echo_is_on_the_fan_at_its_slant_range() -> None:
    """Its pixels lie to starboard, at its bearing from the lower middle; before the first frame there is none."""
    own = frames()
    fan = Fan(own.times, own.levels, own.bearings, own.ranges)
    dark = fan.draw(BOX, 5.0, 0.04)
    assert fan.name.startswith("sonar, no frame yet")
    assert not (dark == sonar_fan._COLOURS[-1]).all(axis=2).any()
    picture = fan.draw(BOX, 16.0, 0.0)
    assert "frame of 15 s" in fan.name
    rows, columns = np.nonzero((picture == sonar_fan._COLOURS[-1]).all(axis=2))
    across, up = columns.mean() - BOX.width // 2, round(0.95 * BOX.height) - rows.mean()
    assert math.atan2(across, up) == pytest.approx(0.35, abs=0.06)
    # arcs every 5 m give the scale: along the heading they cross the middle column
    greys = (picture == sonar_fan.overlay.GREY).all(axis=2)[:, BOX.width // 2 - 20]
    arcs = round(0.95 * BOX.height) - np.flatnonzero(greys)
    scale = math.hypot(float(arcs.max()), 20.0) / 15.0
    assert math.hypot(across, up) / scale == pytest.approx(math.hypot(11.0, ALTITUDE), abs=0.4)


def test_a_frame_stands_for_a_while() -> None:
    """At 25 pictures a second and 40 times the speed, of the 20 frames in half a second of video one is shown."""
    own = frames()
    levels = np.repeat(own.levels, 30, axis=0)
    fan = Fan(np.arange(60.0), levels, own.bearings, own.ranges)
    shown = []
    for k in range(27):
        fan.draw(BOX, 1.6 * k, 0.04)
        shown.append(fan.name)
    assert len(set(shown)) == 3
    assert shown[0] == shown[12] != shown[13] == shown[25] != shown[26]


def test_lanes_count_waypoints_and_approaches_attempts() -> None:
    """Of a mission that logs both; on its way to either it counts nothing."""
    log, found = writer("survey"), {}
    for k, phase in enumerate(("fix", "lanes", "home", "final")):
        log.truth(truth(float(k), (k, 0.0, 5.0)))
        names = [*Docking.variables, "waypoint", "leg_cross_track", "floor"]
        own = {**dict.fromkeys(names, 0.0), "attempt": 2, "waypoint": 7}
        log.append("mission", (float(k), Survey.phases.index(phase), 0.0, 5.0, 1.5, *(own[n] for n in names)))
    moving = Motion(log.finish("complete"))
    for k, phase in enumerate(("fix", "lanes", "home", "final")):
        found[phase] = moving.at(k + 0.5).count
    assert found == {"fix": "", "lanes": "waypoint 7", "home": "", "final": "attempt 2"}


def test_views_are_those_that_there_are_frames_for(images: Array, monkeypatch) -> None:
    """A log without `log_frames` has the map of the keyframes only; the name of a view says by what poses."""
    playback: Any = SimpleNamespace(first=motion(), docks={})
    monkeypatch.setattr(sonar, "frames_of", lambda _: None)
    monkeypatch.setattr(sonar, "laid_of", lambda *_: Laid(TIMES, POSES, images, GRID, "as told"))
    views = sonar.SonarViews(playback)
    assert views.views == ("map",)
    picture = np.zeros((BOX.height, BOX.width, 3), dtype=np.uint8)
    views.draw("map", picture, BOX, 16.0, 0.04)
    assert "as told" in views.name("map")
    assert (picture == UNSEEN).all(axis=2).any()
    monkeypatch.setattr(sonar, "laid_of", lambda *_: None)
    assert sonar.SonarViews(playback).views == ()
    assert sonar.VIEWS == ("map", "sonar")
