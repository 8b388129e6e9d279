"""Text and flat shapes on a finished picture: the panel of numbers, the legend, the names of views, banners."""

import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image, ImageDraw, ImageFont

from auvsim.analysis.style import phase_colour, phase_name
from auvsim.video import marks
from auvsim.video.canvas import Box, Picture
from auvsim.video.layer import Colour
from auvsim.video.playback import Moment, Playback

WHITE, GREY = (255, 255, 255), (165, 185, 195)
PANEL = (12, 30, 38)
PANEL_WIDTH, PANEL_HEIGHT = 416, 252  # size for which the panel is laid out [pixels]
Rgb = tuple[int, int, int]


class Style(NamedTuple):
    """How text looks."""

    size: float  # [pixels]
    colour: Rgb = WHITE
    bold: bool = False


def rgb(colour: Colour | str) -> Rgb:
    """A colour in bytes."""
    red, green, blue = to_rgb(colour if isinstance(colour, str) else colour[:3])
    return round(255 * red), round(255 * green), round(255 * blue)


@lru_cache
def _font(size: float, bold: bool) -> ImageFont.FreeTypeFont:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)


def text_width(text: str, style: Style) -> int:
    """Width of a line of text [pixels]."""
    return math.ceil(_font(style.size, style.bold).getbbox(text, anchor="ls")[2])


def write(picture: Picture, text: str, x: int, baseline: int, style: Style) -> None:
    """Writes a line of text from `x` on its baseline; what does not fit into the picture is left out."""
    font = _font(style.size, style.bold)
    left, top, right, bottom = font.getbbox(text, anchor="ls")
    column, row = max(x + math.floor(left), 0), max(baseline + math.floor(top), 0)
    part = picture[row : max(baseline + math.ceil(bottom), 0), column : max(x + math.ceil(right), 0)]
    if part.size:
        image = Image.fromarray(part)
        ImageDraw.Draw(image).text((x - column, baseline - row), text, style.colour, font, anchor="ls")
        part[:] = np.asarray(image)


def darken(picture: Picture, box: Box, strength: float = 0.6) -> None:
    """Lays the panel's colour over a rectangle, so that text can be read on it."""
    part = picture[max(box.y, 0) : box.y + box.height, max(box.x, 0) : box.x + box.width]
    part[:] = (part * (1.0 - strength) + np.array(PANEL) * strength).astype(np.uint8)


def fill(picture: Picture, box: Box, colour: Rgb) -> None:
    """Fills a rectangle."""
    picture[max(box.y, 0) : box.y + box.height, max(box.x, 0) : box.x + box.width] = colour


def tag(picture: Picture, text: str, view: Box, scale: float) -> None:
    """The name of a view in its lower left corner."""
    style = Style(12.0 * scale, WHITE)
    height = round(20 * scale)
    width = min(text_width(text, style) + round(14 * scale), view.width)
    darken(picture, Box(view.x, view.y + view.height - height, width, height))
    write(picture, text, view.x + round(7 * scale), view.y + view.height - round(6 * scale), style)


def label(picture: Picture, text: str, place: tuple[int, int] | None, colour: Rgb, scale: float) -> None:
    """A name beside a place in the picture, if it is in the picture."""
    if place is not None:
        style = Style(15.0 * scale, colour, bold=True)
        for offset in (1, 0):  # a shadow first
            shaded = style._replace(colour=(0, 20, 30)) if offset else style
            write(picture, text, place[0] + round(12 * scale) + offset, place[1] + offset, shaded)


def banner(picture: Picture, text: str, view: Box, scale: float) -> None:
    """What has just happened, across the top of a view; shortened to fit."""
    text, style = " ".join(text.split()), Style(19.0 * scale, WHITE, bold=True)
    room = view.width - round(32 * scale)
    while text_width(text, style) > room and len(text) > 4:
        text = text[:-2].rstrip(" .…") + "…"
    height = round(44 * scale)
    darken(picture, Box(view.x, view.y, view.width, height), 0.7)
    write(picture, text, view.x + round(16 * scale), view.y + round(29 * scale), style)


def panel(picture: Picture, playback: Playback, moment: Moment, speed: float, corner: Box, solid: bool) -> None:
    """The numbers of the moment and the legend.

    Args:
        picture: to draw on.
        playback: the trial.
        moment: what is shown.
        speed: speed-up; 0 stands for a stopped picture.
        corner: where the panel goes; its width sets the size of everything.
        solid: whether it hides what is behind it.
    """
    k = corner.width / PANEL_WIDTH
    box = Box(corner.x, corner.y, corner.width, min(corner.height, picture.shape[0] - corner.y))
    fill(picture, box, PANEL) if solid else darken(picture, box)

    def put(text: str, x: float, baseline: float, style: Style) -> None:
        sized = style._replace(size=style.size * k)
        write(picture, text, corner.x + round(x * k), corner.y + round(baseline * k), sized)

    attributes = playback.log.attributes
    put(f"{playback.vehicle_name} docking", 16, 30, Style(19, WHITE, bold=True))
    number = f"seed {attributes['seed']}, trial {attributes['trial']}"
    put(number, 400 - text_width(number, Style(13)), 29, Style(13, GREY))
    chip = Box(corner.x + round(16 * k), corner.y + round(42 * k), round(230 * k), round(30 * k))
    fill(picture, chip, rgb(phase_colour(moment.phase)))
    put(phase_name(moment.phase) if moment.phase >= 0 else "start", 26, 63, Style(19, WHITE, bold=True))
    put(f"attempt {moment.attempt}", 262, 63, Style(17, WHITE))
    for (name, value), (column, row) in zip(_numbers(moment, speed), np.ndindex(3, 2), strict=True):
        x, y = 16 + 134 * column, 98 + 50 * row
        put(name, x, y, Style(12, GREY))
        put(value, x, y + 23, Style(19, WHITE, bold=True))
    _legend(picture, corner, k)


def _numbers(moment: Moment, speed: float) -> list[tuple[str, str]]:
    """Names and values, column by column."""
    error = "no fix yet"
    if moment.belief is not None:
        error = f"{math.dist(moment.belief.position[:2], moment.position[:2]):.2f} m"
    return [
        ("time", f"{moment.time:.1f} s"),
        ("shown", "still" if speed <= 0.0 else f"× {speed:.0f}" if speed >= 1.95 else f"× {speed:.1f}"),
        ("nose to dock", f"{moment.range:.2f} m" if moment.range < 20.0 else f"{moment.range:.0f} m"),
        ("over ground", f"{moment.speed:.2f} m/s"),
        ("estimate off by", error),
        ("current", f"{float(np.linalg.norm(moment.current)):.2f} m/s"),
    ]


def _legend(picture: Picture, corner: Box, k: float) -> None:
    entries = (
        ("true track", marks.TRUE, 14),
        ("estimate, 2σ", marks.ESTIMATE, 14),
        ("dock and axis", marks.DOCK, 14),
        ("fix", marks.FIX, 7),
        ("refused fix", marks.REFUSED, 7),
        ("current", marks.CURRENT, 14),
    )
    for (text, colour, width), (row, column) in zip(entries, np.ndindex(2, 3), strict=True):
        x, y = corner.x + round((16 + 134 * column) * k), corner.y + round((206 + 26 * row) * k)
        height = 7 if width == 7 else 4
        fill(picture, Box(x, y - round((4 + height / 2) * k), round(width * k), max(round(height * k), 1)), rgb(colour))
        write(picture, text, x + round(20 * k), y, Style(13 * k, WHITE))
