"""The latest frame of an imaging sonar as a fan, ahead upwards, with scales of range and bearing."""

import math
from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from auvsim.base.frames import Array
from auvsim.video import overlay
from auvsim.video.canvas import Box, Picture

DARKEST, BRIGHTEST = 0.0, 30.0  # levels of the colours [dB]
SMOOTHED = (3, 2)  # beams and bins over which speckle is averaged
HELD = 0.5  # for which a frame stands at least, in the video [s]
_COLOURS = (255 * colormaps["inferno"](np.linspace(0.0, 1.0, 256))[:, :3]).astype(np.uint8)


class Fan:
    """Draws frames; where time runs fast, only some of them, so that each can be seen.

    Args:
        times: of the frames (n,) [s].
        levels: (n, beams, bins) [half decibels].
        bearings: of the beams (beams,), rising evenly [rad].
        ranges: of the bins (bins,), rising evenly [m].
    """

    def __init__(self, times: Array, levels: Any, bearings: Array, ranges: Array) -> None:
        self._times, self._levels, self._bearings, self._ranges = times, levels, bearings, ranges
        self._shown, self._stood = -1, math.inf
        self._drawn: tuple[Box, int, Picture] | None = None  # the last one, its box and frame

    @property
    def name(self) -> str:
        """Which frame is shown, and its colours."""
        when = "no frame yet" if self._shown < 0 else f"frame of {self._times[self._shown]:.0f} s"
        return f"sonar, {when}, {DARKEST:.0f} to {BRIGHTEST:.0f} dB above noise"

    def draw(self, box: Box, time: float, step: float) -> Picture:
        """The latest frame at a time [s]; a frame stands for a while, in steps [s] of the video."""
        latest = int(np.searchsorted(self._times, time, side="right")) - 1
        self._stood += step
        if latest != self._shown and (self._stood >= HELD - 1e-9 or step <= 0.0):
            self._shown, self._stood = latest, 0.0
        if self._drawn is None or self._drawn[:2] != (box, self._shown):
            self._drawn = (box, self._shown, self._picture(box))
        return self._drawn[2]

    def _picture(self, box: Box) -> Picture:
        """The fan of the frame that is shown."""
        reach, half = float(self._ranges[-1]), float(self._bearings[-1])
        size = min(max(10.0, box.height / 20.0), 16.0)  # of letters [pixels]
        room = overlay.text_width("20 m", overlay.Style(size)) + 6
        widest = math.sin(min(half, 0.5 * math.pi)) * reach
        scale = min((0.95 * box.height - 2.2 * size) / reach, (0.5 * box.width - room) / widest)  # pixels a metre
        middle, bottom = box.width // 2, round(0.95 * box.height)
        forward, starboard = np.meshgrid(
            (bottom - np.arange(box.height)) / scale, (np.arange(box.width) - middle) / scale, indexing="ij"
        )
        drawn = self._shaded(forward, starboard)
        self._scales(drawn, (forward, starboard), (middle, bottom), scale, size)
        return drawn

    def _shaded(self, forward: Array, starboard: Array) -> Picture:
        from scipy.ndimage import uniform_filter

        drawn = np.full((*forward.shape, 3), overlay.PANEL, dtype=np.uint8)
        beam, bin_, seen = self._cells(forward, starboard)
        if self._shown < 0:
            return drawn
        level: Array = uniform_filter(0.5 * np.asarray(self._levels[self._shown], dtype=float), SMOOTHED)  # pyright: ignore[reportArgumentType, reportAssignmentType]
        shade = np.clip((level[beam[seen], bin_[seen]] - DARKEST) / (BRIGHTEST - DARKEST), 0.0, 1.0)
        drawn[seen] = _COLOURS[(255 * shade).astype(int)]
        return drawn

    def _cells(self, forward: Array, starboard: Array) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.bool_]]:
        """Beam and bin of places [m], and which of them lie in the fan."""
        b, r = self._bearings, self._ranges
        beam = np.rint((np.arctan2(starboard, forward) - b[0]) / (b[1] - b[0])).astype(int)
        bin_ = np.rint((np.hypot(forward, starboard) - r[0]) / (r[1] - r[0])).astype(int)
        return beam, bin_, (beam >= 0) & (beam < len(b)) & (bin_ >= 0) & (bin_ < len(r))

    def _scales(
        self, drawn: Picture, places: tuple[Array, Array], foot: tuple[int, int], scale: float, size: float
    ) -> None:
        """Arcs of range, labelled along the starboard edge, and rays of bearing, labelled along the farthest arc."""
        reach, half = float(self._ranges[-1]), float(self._bearings[-1])
        distance, bearing = np.hypot(*places), np.arctan2(places[1], places[0])
        inside = (distance <= reach) & (np.abs(bearing) <= half + 1e-9) & (distance >= self._ranges[0])
        style = overlay.Style(size, overlay.WHITE)
        step = 5.0 if reach < 30.0 else 10.0 * math.ceil(reach / 60.0)
        for at in np.arange(step, reach, step):
            drawn[(np.abs(distance - at) * scale < 0.6) & inside] = overlay.GREY
            x, y = foot[0] + at * math.sin(half) * scale, foot[1] - at * math.cos(half) * scale
            overlay.write(drawn, f"{at:.0f} m", round(x) + 5, round(y + 0.9 * size), style)
        for degrees in range(-150, 151, 30):
            at = math.radians(degrees)
            if abs(at) > half + 1e-6:
                continue
            drawn[(np.abs(np.sin(bearing - at)) * distance * scale < 0.5) & inside & (np.abs(bearing - at) < 1.0)] = (
                overlay.GREY
            )
            text = f"{degrees:+d}°" if degrees else "0°"
            width = overlay.text_width(text, style)
            x, y = foot[0] + reach * math.sin(at) * scale, foot[1] - reach * math.cos(at) * scale
            left = x - width / 2 + 0.5 * width * math.sin(at)
            overlay.write(drawn, text, min(max(round(left), 2), drawn.shape[1] - width - 2), round(y - 5), style)
