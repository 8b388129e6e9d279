"""What a video shows of an imaging sonar: which frames its log holds, and the views of them."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from auvsim.analysis import sonar_path
from auvsim.base.frames import Array
from auvsim.navigation.sonar_frames import SectorFrames
from auvsim.sensors.imaging_sonar import ImagingSonarSettings, geometry
from auvsim.simulation.sensor_settings import on_board
from auvsim.video.canvas import Box, Picture
from auvsim.video.motion import Motion
from auvsim.video.playback import Playback
from auvsim.video.sonar_fan import Fan
from auvsim.video.sonar_map import GrowingMap
from estimators.map_path.frames import PolarGrid, SectorGrid

MAP, SONAR = "map", "sonar"
VIEWS = (MAP, SONAR)
EVERY = 2.0  # time from one frame that is laid on the map to the next, where the log holds no keyframes [s]
CELL = 0.5  # of such frames [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """The frames that a log holds of one sonar."""

    times: Array  # (n,) [s]
    levels: Any  # (n, beams, bins) half decibels, bytes
    bearings: Array  # (beams,) [rad]
    ranges: Array  # (bins,) [m]
    ahead: float  # of the vehicle's origin, where the sonar is [m]


class Laid(NamedTuple):
    """Frames to be laid on a map, and where."""

    times: Array  # (k,) [s]
    poses: Array  # (k, 3) north, east [m], heading [rad]
    images: Array  # (k, rows, columns)
    grid: SectorGrid
    caption: str  # by what poses


def frames_of(playback: Playback) -> Frames | None:
    """The frames of the only vehicle's sonar; None where the log holds none (`log_frames` of the sonar)."""
    if not playback.lone:
        return None
    motion = playback.first
    settings = playback.settings[motion.name].sensors if motion.name in playback.settings else None
    for name, own in on_board(settings) if settings is not None else ():
        if isinstance(own, ImagingSonarSettings) and name in motion.log and motion.log[name]["value"].ndim == 3:
            group = motion.log[name]
            bearings, ranges = geometry(own)
            return Frames(
                times=group["time"], levels=group["value"], bearings=bearings, ranges=ranges, ahead=own.nose
            )  # fmt: skip
    return None


def laid_of(playback: Playback, frames: Frames | None) -> Laid | None:
    """What a map is made of: the keyframes at their poses by all that was measured, as in feature_map.png.

    Where a log holds none, the sonar's frames at the poses that were estimated at their time; None without frames.
    """
    if not playback.lone:
        return None
    motion = playback.first
    path = sonar_path.sonar_path(motion.log)
    if path is not None:
        return Laid(path.times, path.poses, path.images, path.grid, "keyframes at their poses by the end")
    return None if frames is None else estimated(frames, motion)


def estimated(frames: Frames, motion: Motion) -> Laid | None:
    """Frames some seconds apart, where enough floor was seen, at the poses estimated then; None if there is none."""
    reach = 0.95 * float(frames.ranges[-1])
    rows = math.ceil(reach / CELL)
    grid = SectorGrid(
        cell=CELL, shape=(rows, 2 * rows), ranges=(max(float(frames.ranges[0]), 4.0 * CELL), reach), ahead=frames.ahead,
        half_sector=min(math.radians(60.0), 0.98 * float(frames.bearings[-1])),
    )  # fmt: skip
    polar = PolarGrid(bearings=tuple(frames.bearings.tolist()), ranges=tuple(frames.ranges.tolist()))
    maker, altitudes = SectorFrames(polar=polar, grid=grid), _altitudes(motion, frames.times)
    last, found = -math.inf, []
    for k, (time, altitude) in enumerate(zip(frames.times.tolist(), altitudes.tolist(), strict=True)):
        belief = motion.at(time).belief
        if time - last < EVERY or belief is None or not 0.3 < altitude < 0.5 * float(frames.ranges[-1]):
            continue
        last = time
        intensity = 10.0 ** (0.05 * np.asarray(frames.levels[k], dtype=float))
        image = maker.frame(intensity, altitude=altitude, stamp=time).intensity
        found.append((time, (belief.position[0], -belief.position[1], belief.heading), image))
    if not found:
        return None
    times, poses, images = (np.array(column) for column in zip(*found, strict=True))
    return Laid(times, poses, images, grid, "frames at their poses as estimated then")


def _altitudes(motion: Motion, times: Array) -> Array:
    """Height above the floor (n,) by gauge and altimeter [m]; NaN where that is not logged."""
    mission = motion.log["mission"]
    if "floor" not in mission or not len(times):
        return np.full(len(times), math.nan)
    depth = -np.interp(times, motion.times, motion.positions[:, 2])
    return np.interp(times, mission["time"], mission["floor"]) - depth


class SonarViews:
    """Draws the views of a lone vehicle's sonar.

    Args:
        playback: the run.
    """

    def __init__(self, playback: Playback) -> None:
        frames = frames_of(playback)
        laid = laid_of(playback, frames)
        self._fan = None if frames is None else Fan(frames.times, frames.levels, frames.bearings, frames.ranges)
        self._map = None if laid is None else GrowingMap(laid.times, laid.poses, laid.images, laid.grid,
                                                         playback.first, playback.docks, laid.caption)  # fmt: skip

    @property
    def views(self) -> tuple[str, ...]:
        """Those that the log has frames for."""
        return tuple(name for name, own in ((MAP, self._map), (SONAR, self._fan)) if own is not None)

    def draw(self, view: str, picture: Picture, box: Box, time: float, step: float) -> None:
        """Draws a view into a rectangle of a picture; times must not go back.

        Args:
            view: one of `views`.
            picture: to draw on.
            box: where.
            time: of the run [s].
            step: time in the video since the picture before [s].
        """
        own = self._map if view == MAP else self._fan
        assert own is not None
        picture[box.y : box.y + box.height, box.x : box.x + box.width] = own.draw(box, time, step)

    def name(self, view: str) -> str:
        """What stands in the corner of a view, once it is drawn."""
        own = self._map if view == MAP else self._fan
        assert own is not None
        return own.name
