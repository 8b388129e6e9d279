"""Text and flat shapes on a finished picture: names of views and of what is in them, banners."""

import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image, ImageDraw, ImageFont

from auvsim.video.canvas import Box, Picture
from auvsim.video.layer import Colour

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


def shortened(text: str, style: Style, room: float) -> str:
    """The text, or as much of it as fits into so many pixels."""
    while text_width(text, style) > room and len(text) > 4:
        text = text[:-2].rstrip(" .…") + "…"
    return text


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
    text = shortened(text, style, view.width - round(32 * scale))
    height = round(44 * scale)
    darken(picture, Box(view.x, view.y, view.width, height), 0.7)
    write(picture, text, view.x + round(16 * scale), view.y + round(29 * scale), style)
