"""Views of an imaging sonar in a video: its latest frame as a fan, and the map that grows of the frames so far."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from auvsim.base.frames import Array
from auvsim.sensors.imaging_sonar import ImagingSonarSettings, geometry
from auvsim.simulation.sensor_settings import on_board
from auvsim.video import marks, overlay
from auvsim.video.canvas import Box, Picture
from auvsim.video.motion import Motion
from auvsim.video.playback import Dock, Playback

VIEWS = ("map", "sonar")
DARKEST, BRIGHTEST = -5.0, 40.0  # levels of a frame's colours [dB]
CONTRAST = 6.0  # of the map: echo by the mean of its range, from dark to bright and back [dB]
CELL, SQUARE = 0.5, 50.0  # of the map, and of the lines over it [m]
EVERY = 2.0  # time from one frame that is laid on the map to the next [s]
SMOOTHED = (3, 5)  # beams and bins whose levels are averaged before they go on the map
UNSEEN = (62, 70, 76)
_FAN = (255 * colormaps["inferno"](np.linspace(0.0, 1.0, 256))[:, :3]).astype(np.uint8)
_SAND = (255 * colormaps["cividis"](np.linspace(0.0, 1.0, 256))[:, :3]).astype(np.uint8)


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """The frames that a log holds of one sonar, and where its vehicle believed to be."""

    times: Array  # (n,) [s]
    levels: Any  # (n, beams, bins) half decibels, bytes
    bearings: Array  # (beams,) [rad]
    ranges: Array  # (bins,) [m]
    poses: Array  # (n, 3) north, east [m], heading [rad] as estimated then; NaN before there was an estimate
    ahead: float  # of the vehicle's origin, where the sonar is [m]
    altitudes: Array  # (n,) above the floor by gauge and altimeter [m]; NaN where it was not heard

    @property
    def reach(self) -> float:
        """Farthest range [m]."""
        return float(self.ranges[-1])

    def sample(
        self, level: Array, forward: Array, starboard: Array, altitude: float = 0.0
    ) -> tuple[Array, NDArray[np.bool_]]:
        """What a frame (beams, bins) shows at places [m] ahead and to starboard, and which of them it sees."""
        slant = np.sqrt(forward**2 + starboard**2 + altitude**2)
        bearing, step = np.arctan2(starboard, forward), self.ranges[1] - self.ranges[0]
        beam = np.rint((bearing - self.bearings[0]) / (self.bearings[1] - self.bearings[0])).astype(int)
        bin_ = np.rint((slant - self.ranges[0]) / step).astype(int)
        seen = (beam >= 0) & (beam < level.shape[0]) & (bin_ >= 0) & (bin_ < level.shape[1])
        return np.where(seen, level[np.where(seen, beam, 0), np.where(seen, bin_, 0)], 0.0), seen


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
            return Frames(times=group["time"], levels=group["value"], bearings=bearings, ranges=ranges, ahead=own.nose,
                          poses=_poses(motion, group["time"]), altitudes=_altitudes(motion, group["time"]))  # fmt: skip
    return None


def _poses(motion: Motion, times: Array) -> Array:
    believed = [motion.at(float(time)).belief for time in times]
    return np.array([
        (math.nan,) * 3 if b is None else (b.position[0], -b.position[1], b.heading) for b in believed
    ]).reshape(-1, 3)  # fmt: skip


def _altitudes(motion: Motion, times: Array) -> Array:
    mission = motion.log["mission"]
    if "floor" not in mission or not len(times):
        return np.full(len(times), math.nan)
    depth = -np.interp(times, motion.times, motion.positions[:, 2])
    return np.interp(times, mission["time"], mission["floor"]) - depth


class SonarViews:
    """Draws the views of a sonar.

    Args:
        frames: what it saw.
        motion: of its vehicle.
        docks: that are shown on the map.
    """

    def __init__(self, frames: Frames, motion: Motion, docks: dict[str, Dock]) -> None:
        self._frames, self._motion, self._docks = frames, motion, docks
        places = np.vstack((motion.positions[:, :2] * (1.0, -1.0), *(d.mouth[None, :2] * (1.0, -1.0)
                                                                     for d in docks.values())))  # fmt: skip
        self._low = np.floor(places.min(axis=0) - frames.reach - 2.0)
        shape = np.ceil((places.max(axis=0) + frames.reach + 2.0 - self._low) / CELL).astype(int) + 1
        self._total, self._counts = np.zeros(shape), np.zeros(shape)
        self._laid, self._last = 0, -math.inf

    def draw(self, view: str, picture: Picture, box: Box, time: float) -> None:
        """Draws a view into a rectangle of a picture; times must not go back."""
        drawn = self._fan(box, time) if view == "sonar" else self._map(box, time)
        picture[box.y : box.y + box.height, box.x : box.x + box.width] = drawn

    def name(self, view: str, time: float) -> str:
        """What stands in the corner of a view."""
        if view == "sonar":
            latest = self._latest(time)
            when = "no frame yet" if latest < 0 else f"frame of {self._frames.times[latest]:.0f} s"
            return f"sonar, {when}, {DARKEST:.0f} to {BRIGHTEST:.0f} dB above noise"
        return f"feature map by the estimate of the time, north up, squares of {SQUARE:.0f} m"

    def _latest(self, time: float) -> int:
        return int(np.searchsorted(self._frames.times, time, side="right")) - 1

    def _fan(self, box: Box, time: float) -> Picture:
        """The latest frame, ahead upwards, with arcs of range."""
        frames, latest = self._frames, self._latest(time)
        widest = math.sin(min(float(frames.bearings[-1]), 0.5 * math.pi)) * frames.reach
        scale = min(0.94 * box.height / frames.reach, 0.48 * box.width / widest)  # pixels a metre
        middle, bottom = box.width // 2, round(0.97 * box.height)
        forward, starboard = np.meshgrid(
            (bottom - np.arange(box.height)) / scale, (np.arange(box.width) - middle) / scale, indexing="ij"
        )
        level = frames.levels[max(latest, 0)] if len(frames.times) else np.zeros((8, 8))
        value, seen = frames.sample(np.asarray(level, dtype=float), forward, starboard)
        shade = np.clip((0.5 * value - DARKEST) / (BRIGHTEST - DARKEST), 0.0, 1.0)
        drawn = _FAN[(255 * shade).astype(int)]
        drawn[~seen | (latest < 0)] = overlay.PANEL
        step = 5.0 if frames.reach < 30.0 else 10.0 * math.ceil(frames.reach / 60.0)
        for distance in np.arange(step, frames.reach, step):
            arc = (np.abs(np.hypot(forward, starboard) - distance) * scale < 0.6) & seen
            drawn[arc] = overlay.GREY
            across = distance * math.sin(float(frames.bearings[-1])) * scale
            down = distance * math.cos(float(frames.bearings[-1])) * scale
            style, text = overlay.Style(max(10.0, box.height / 20.0), overlay.WHITE), f"{distance:.0f} m"
            x = min(round(middle + across) + 4, box.width - overlay.text_width(text, style) - 2)
            overlay.write(drawn, text, x, round(bottom - down), style)
        return drawn

    def _lay(self, time: float) -> None:
        """Lays the frames up to a time on the map."""
        from scipy.ndimage import uniform_filter

        frames = self._frames
        while self._laid <= self._latest(time):
            k, self._laid = self._laid, self._laid + 1
            altitude = float(frames.altitudes[k])
            near = 0.3 < altitude < 0.5 * frames.reach
            if not near or frames.times[k] - self._last < EVERY or not np.isfinite(frames.poses[k]).all():
                continue
            self._last = float(frames.times[k])
            north, east, heading = frames.poses[k]
            rows, columns = (
                np.arange(
                    max(round((at - low - frames.reach) / CELL), 0), min(round((at - low + frames.reach) / CELL), n)
                )
                for at, low, n in zip((north, east), self._low, self._total.shape, strict=True)
            )
            to_north = self._low[0] + CELL * rows[:, None] - north
            to_east = self._low[1] + CELL * columns[None, :] - east
            c, s = math.cos(heading), math.sin(heading)
            level = uniform_filter(0.5 * np.asarray(frames.levels[k], dtype=float), SMOOTHED)  # less speckle  # pyright: ignore[reportArgumentType]
            level -= np.median(level, axis=0)
            value, seen = frames.sample(
                level, c * to_north + s * to_east - frames.ahead, c * to_east - s * to_north, altitude
            )
            self._total[np.ix_(rows, columns)] += value * seen
            self._counts[np.ix_(rows, columns)] += seen

    def _map(self, box: Box, time: float) -> Picture:
        """The mean of the frames so far, with the paths."""
        self._lay(time)
        size = np.array(self._total.shape) * CELL
        scale = min(box.height / size[0], box.width / size[1])  # pixels a metre
        rows = ((np.arange(box.height)[::-1] + 0.5 - 0.5 * (box.height - scale * size[0])) / scale / CELL).astype(int)
        columns = ((np.arange(box.width) + 0.5 - 0.5 * (box.width - scale * size[1])) / scale / CELL).astype(int)
        inside = ((rows >= 0) & (rows < self._total.shape[0]))[:, None] & (
            (columns >= 0) & (columns < self._total.shape[-1])
        )[None, :]
        at = np.ix_(rows.clip(0, self._total.shape[0] - 1), columns.clip(0, self._total.shape[-1] - 1))
        counts = np.where(inside, self._counts[at], 0)
        shade = np.clip(0.5 + self._total[at] / np.maximum(counts, 1) / (2.0 * CONTRAST), 0.0, 1.0)
        drawn = _SAND[(255 * shade).astype(int)]
        drawn[counts == 0] = UNSEEN
        corner = np.array((0.5 * (box.width - scale * size[1]), box.height - 0.5 * (box.height - scale * size[0])))
        return self._paths(drawn, time, lambda p: np.stack(
            (corner[0] + (p[..., 1] - self._low[1]) * scale, corner[1] - (p[..., 0] - self._low[0]) * scale), axis=-1
        ))  # fmt: skip

    def _paths(self, drawn: Picture, time: float, pixel: Any) -> Picture:
        """The map with squares, both paths up to a time, the docks and the vehicle."""
        motion, image = self._motion, Image.fromarray(drawn)
        draw, (height, width) = ImageDraw.Draw(image), drawn.shape[:2]
        for k in range(-40, 41):
            x, y = pixel(np.array((SQUARE * k, SQUARE * k)))
            draw.line((x, 0, x, height), fill=(92, 102, 110))
            draw.line((0, y, width, y), fill=(92, 102, 110))
        for times, places, colour in (
            (motion.times, motion.positions, marks.TRUE),
            (motion.belief_times, motion.belief_positions, marks.ESTIMATE),
        ):
            path = places[: np.searchsorted(times, time, side="right"), :2] * (1.0, -1.0)
            if len(path) > 1:
                draw.line([tuple(p) for p in pixel(path).tolist()], fill=overlay.rgb(colour), width=2)
        for dock in self._docks.values():
            x, y = pixel(dock.mouth[:2] * (1.0, -1.0))
            draw.ellipse((x - 6, y - 6, x + 6, y + 6), outline=overlay.rgb(marks.DOCK), width=3)
        now = motion.at(time)
        nose = np.array((math.cos(now.heading), math.sin(now.heading)))
        aside = np.array((-nose[1], nose[0]))
        tip = [
            now.position[:2] * (1.0, -1.0) + a * nose + b * aside for a, b in ((6.0, 0.0), (-3.0, 2.5), (-3.0, -2.5))
        ]
        draw.polygon([tuple(pixel(p).tolist()) for p in tip], fill=(255, 255, 255), outline=(0, 20, 30))
        result = np.array(image)
        for name, dock in self._docks.items():
            x, y = pixel(dock.mouth[:2] * (1.0, -1.0)).tolist()
            text = "dock" if len(self._docks) == 1 else name
            overlay.label(result, text, (round(x), round(y)), overlay.rgb(marks.DOCK), height / 720.0)
        return result
