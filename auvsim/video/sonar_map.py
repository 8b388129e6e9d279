"""The feature map as it grows in a video, north up, with the paths so far, a scale and the docks."""

import math
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from auvsim.analysis.sonar_map import CELL
from auvsim.base.frames import Array
from auvsim.video import marks, overlay
from auvsim.video.canvas import Box, Picture
from auvsim.video.motion import Motion
from auvsim.video.playback import Dock
from estimators.map_path.feature_map import Mosaic
from estimators.map_path.frames import SectorGrid

SQUARE, MARGIN = 50.0, 6.0  # side of the squares, and room round all that is shown [m]
BANNER = 46.0 / 720.0  # part of the picture's height on which banners stand
UNSEEN, LINE, INK = (62, 70, 76), (92, 102, 110), (230, 238, 242)
ARROWHEAD = ((6.0, 0.0), (-3.0, 2.5), (-3.0, -2.5))  # the vehicle, ahead and to starboard [m]


class GrowingMap:
    """Draws the map of the frames so far.

    Args:
        times: of the frames (k,), rising [s].
        poses: where they are laid (k, 3): north, east [m], heading [rad].
        images: (k, rows, columns).
        grid: of the frames.
        motion: of the vehicle.
        docks: that are shown.
        caption: by what the frames are laid.
    """

    def __init__(
        self, times: Array, poses: Array, images: Array, grid: SectorGrid, motion: Motion, docks: dict[str, Dock],
        caption: str = "",
    ) -> None:  # fmt: skip
        self._times, self._poses, self._images = times, poses, images
        self._motion, self._docks, self._caption = motion, docks, caption
        whole = Mosaic(poses, grid, CELL)
        for image, pose in zip(images, poses, strict=True):
            whole.add(image, pose)
        self._dark, self._bright = np.nanpercentile(whole.map.image, (2.0, 99.5))
        self.mosaic, self._laid = Mosaic(poses, grid, CELL), 0
        self._shades: Picture | None = None  # of the map's cells so far
        self._drawn_map: tuple[Box, int, Picture] | None = None  # the map as last drawn, its box and number of frames
        west, east, south, north = whole.map.extent
        self._corner = np.array((south, west))  # of the map
        places = [np.array(((south, west), (north, east))), _level(motion.positions)]
        places += [_level(dock.mouth[None]) for dock in docks.values()]
        shown = np.concatenate(places)
        self._low, self._high = shown.min(axis=0) - MARGIN, shown.max(axis=0) + MARGIN

    @property
    def name(self) -> str:
        """What is shown."""
        return f"feature map, {self._caption}; north up, squares of {SQUARE:.0f} m"

    def draw(self, box: Box, time: float, step: float) -> Picture:
        """The mean of the frames up to a time [s], with the paths; times must not go back."""
        self._lay(time)
        size = self._high - self._low
        room = (1.0 - BANNER) * box.height
        scale = min(room / size[0], box.width / size[1])  # pixels a metre
        bottom, left = box.height - 0.5 * (room - scale * size[0]), 0.5 * (box.width - scale * size[1])
        north = self._low[0] + (bottom - np.arange(box.height) - 0.5) / scale
        east = self._low[1] + (np.arange(box.width) + 0.5 - left) / scale

        def pixel(places: Array) -> Array:
            """Columns and rows (..., 2) of places (..., 2) north, east."""
            x = left + (places[..., 1] - self._low[1]) * scale
            return np.stack((x, bottom - (places[..., 0] - self._low[0]) * scale), axis=-1)

        if self._drawn_map is None or self._drawn_map[:2] != (box, self._laid):
            self._drawn_map = (box, self._laid, self._looked_up(north, east))
        return self._drawn(self._drawn_map[2], time, pixel, scale)

    def _lay(self, time: float) -> None:
        """Lays the frames up to a time, and shades the map anew if there are any."""
        before = self._laid
        while self._laid < len(self._times) and self._times[self._laid] <= time:
            self.mosaic.add(self._images[self._laid], self._poses[self._laid])
            self._laid += 1
        if self._shades is None or self._laid > before:
            image = self.mosaic.map.image
            unseen = np.isnan(image)
            share = (np.where(unseen, self._dark, image) - self._dark) / max(self._bright - self._dark, 1e-12)
            shades = np.repeat((255 * np.clip(share, 0.0, 1.0)).astype(np.uint8)[..., None], 3, axis=2)
            shades[unseen] = UNSEEN
            self._shades = shades

    def _looked_up(self, north: Array, east: Array) -> Picture:
        """The map at rows (h,) and columns (w,) of a picture [m]."""
        assert self._shades is not None
        count = self._shades.shape
        rows, columns = (
            np.floor((at - corner) / CELL).astype(int) for at, corner in zip((north, east), self._corner, strict=True)
        )
        drawn = self._shades[np.ix_(rows.clip(0, count[0] - 1), columns.clip(0, count[1] - 1))]
        drawn[(rows < 0) | (rows >= count[0])] = UNSEEN
        drawn[:, (columns < 0) | (columns >= count[1])] = UNSEEN
        return drawn

    def _drawn(self, drawn: Picture, time: float, pixel: Any, scale: float) -> Picture:
        """The map with squares, both paths up to a time, docks, vehicle, scale and north."""
        motion, image = self._motion, Image.fromarray(drawn)
        draw, (height, width) = ImageDraw.Draw(image), drawn.shape[:2]
        for k in range(math.floor(self._low.min() / SQUARE) - 40, math.ceil(self._high.max() / SQUARE) + 41):
            x, y = pixel(np.array((SQUARE * k, SQUARE * k)))
            draw.line((x, 0, x, height), fill=LINE)
            draw.line((0, y, width, y), fill=LINE)
        for times, places, colour, broad in (
            (motion.belief_times, motion.belief_positions, marks.ESTIMATE, 4),  # so that both are seen where they agree
            (motion.times, motion.positions, marks.TRUE, 2),
        ):
            path = _level(places[: np.searchsorted(times, time, side="right")])
            if len(path) > 1:
                line = [tuple(p) for p in pixel(path).tolist()]
                draw.line(line, fill=overlay.rgb(colour), width=max(round(broad * height / 720.0), 1), joint="curve")
        for dock in self._docks.values():
            x, y = pixel(_level(dock.mouth))
            draw.ellipse((x - 6, y - 6, x + 6, y + 6), outline=overlay.rgb(marks.DOCK), width=3)
        self._vehicle(draw, time, pixel)
        self._scale(draw, height, scale)
        result = np.array(image)
        for name, dock in self._docks.items():
            x, y = pixel(_level(dock.mouth)).tolist()
            text = "dock" if len(self._docks) == 1 else name
            overlay.label(result, text, (round(x), round(y)), overlay.rgb(marks.DOCK), height / 720.0)
        self._words(result, scale)
        return result

    def _vehicle(self, draw: ImageDraw.ImageDraw, time: float, pixel: Any) -> None:
        now = self._motion.at(time)
        ahead = np.array((math.cos(now.heading), math.sin(now.heading)))
        aside = np.array((-ahead[1], ahead[0]))
        tip = [_level(now.position) + a * ahead + b * aside for a, b in ARROWHEAD]
        draw.polygon([tuple(pixel(p).tolist()) for p in tip], fill=(255, 255, 255), outline=(0, 20, 30))

    def _scale(self, draw: ImageDraw.ImageDraw, height: int, scale: float) -> None:
        """A bar as long as a square, and an arrow to the north, in the lower left corner."""
        k = height / 720.0
        x, y = 26 * k, height - 46 * k
        draw.line((x, y, x + SQUARE * scale, y), fill=INK, width=max(round(3 * k), 1))
        for end in (x, x + SQUARE * scale):
            draw.line((end, y - 5 * k, end, y + 5 * k), fill=INK, width=max(round(2 * k), 1))
        draw.line((x, y - 24 * k, x, y - 66 * k), fill=INK, width=max(round(3 * k), 1))
        draw.polygon([(x, y - 82 * k), (x - 7 * k, y - 62 * k), (x + 7 * k, y - 62 * k)], fill=INK)

    def _words(self, picture: Picture, scale: float) -> None:
        k = picture.shape[0] / 720.0
        x, y = 26 * k, picture.shape[0] - 46 * k
        overlay.write(picture, f"{SQUARE:.0f} m", round(x + 8 * k), round(y - 8 * k), overlay.Style(14 * k, INK))
        overlay.write(picture, "N", round(x + 12 * k), round(y - 60 * k), overlay.Style(16 * k, INK, bold=True))


def _level(places: Array) -> Array:
    """North and east (..., 2) of places (..., 3) in MuJoCo's world."""
    return places[..., :2] * (1.0, -1.0)
