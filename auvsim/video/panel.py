"""The panel of a video: the numbers of the moment and the legend."""

import math

import numpy as np

from auvsim.analysis.style import phase_colour, phase_name
from auvsim.video import marks
from auvsim.video.canvas import Box, Picture
from auvsim.video.motion import Motion, VehicleMoment
from auvsim.video.overlay import GREY, PANEL, WHITE, Style, darken, fill, rgb, shortened, text_width, write
from auvsim.video.playback import Moment, Playback
from auvsim.video.pulses import HEARD, LOST

WIDTH, HEIGHT = 416, 252  # size for which it is laid out [pixels]
HELD = 2.0  # time without an estimate after which its last error says nothing [s]
ROWS = 4  # vehicles that find room in it


class Panel:
    """A panel in a picture; places and sizes are those of the layout.

    Args:
        picture: to draw on.
        corner: where it goes; its width sets the size of everything.
        solid: whether it hides what is behind it.
    """

    def __init__(self, picture: Picture, corner: Box, solid: bool) -> None:
        self._picture, self._corner, self._k = picture, corner, corner.width / WIDTH
        box = Box(corner.x, corner.y, corner.width, min(corner.height, picture.shape[0] - corner.y))
        fill(picture, box, PANEL) if solid else darken(picture, box)

    def put(self, text: str, x: float, baseline: float, style: Style) -> None:
        """Writes a text."""
        k, corner = self._k, self._corner
        write(
            self._picture,
            text,
            corner.x + round(x * k),
            corner.y + round(baseline * k),
            style._replace(size=style.size * k),
        )

    def block(self, x: float, y: float, width: float, height: float, colour: marks.Colour | str) -> None:
        """Fills a rectangle."""
        k, corner = self._k, self._corner
        size = round(width * k), max(round(height * k), 1)
        fill(self._picture, Box(corner.x + round(x * k), corner.y + round(y * k), *size), rgb(colour))


def panel(picture: Picture, playback: Playback, moment: Moment, speed: float, corner: Box, solid: bool) -> None:
    """The numbers of the moment and the legend.

    Args:
        picture: to draw on.
        playback: the run.
        moment: what is shown.
        speed: speed-up; 0 stands for a stopped picture.
        corner: where the panel goes; its width sets the size of everything.
        solid: whether it hides what is behind it.
    """
    on = Panel(picture, corner, solid)
    mission = playback.first.log.mission.split(":")[-1]
    title = f"{playback.first.name} {mission}" if playback.lone else f"{len(playback.motions)} vehicles"
    attributes = playback.log.attributes
    number = f"seed {attributes['seed']}, trial {attributes['trial']}"
    left = 400 - text_width(number, Style(13))
    heading = Style(19, WHITE, bold=True)
    on.put(shortened(title, heading, left - 26), 16, 30, heading)
    on.put(number, left, 29, Style(13, GREY))
    if playback.lone:
        _lone(on, playback.first, moment, speed)
    else:
        _fleet(on, playback, moment, speed)
    _legend(on, playback, moment)


def _lone(on: Panel, motion: Motion, moment: Moment, speed: float) -> None:
    """Phase and numbers of the only vehicle."""
    now = moment.followed
    on.block(16, 42, 230, 30, phase_colour(motion.phase_names, now.phase))
    on.put(_phase(motion, now), 26, 63, Style(19, WHITE, bold=True))
    if now.count:
        on.put(now.count, 262, 63, Style(17, WHITE))
    numbers = [
        ("time", f"{moment.time:.1f} s"),
        ("speed-up", _shown(speed)),
        ("depth", f"{-now.position[2]:.1f} m") if math.isnan(now.range) else ("nose to dock", _range(now)),
        ("over ground", f"{now.speed:.2f} m/s"),
        ("estimate off by", error(now)),
        ("current", _current(now)),
    ]
    for (name, value), (column, row) in zip(numbers, np.ndindex(3, 2), strict=True):
        x, y = 16 + 134 * column, 98 + 50 * row
        on.put(name, x, y, Style(12, GREY))
        on.put(value, x, y + 23, Style(19, WHITE, bold=True))


def _fleet(on: Panel, playback: Playback, moment: Moment, speed: float) -> None:
    """A row for each vehicle, in the colour of its track."""
    small = Style(12, GREY)
    values = (("time", f"{moment.time:.1f} s"), ("speed-up", _shown(speed)), ("current", _current(moment.followed)))
    for (name, value), x, indent in zip(values, (16, 150, 270), (36, 64, 54), strict=True):
        on.put(name, x, 55, small)
        on.put(value, x + indent, 55, Style(15, WHITE, bold=True))
    for text, x in (("phase", 104), ("to dock" if playback.docks else "depth", 232), ("estimate off by", 308)):
        on.put(text, x, 80, small)
    names = list(playback.motions)
    shown = names if len(names) <= ROWS else names[: ROWS - 1]
    for row, name in enumerate(shown):
        motion, now, y = playback.motions[name], moment.vehicles[name], 102 + 24 * row
        style = Style(14, rgb(marks.colour_of(playback, name)), bold=True)
        on.put(shortened(name, style, 82), 16, y, style)
        on.block(104, y - 15, 118, 20, phase_colour(motion.phase_names, now.phase))
        on.put(shortened(_phase(motion, now), Style(14), 106), 110, y, Style(14, WHITE, bold=True))
        place = f"{-now.position[2]:.1f} m" if not playback.docks else "" if math.isnan(now.range) else _range(now)
        on.put(place, 232, y, Style(14))
        on.put(error(now), 308, y, Style(14))
    if len(shown) < len(names):
        on.put(f"and {len(names) - len(shown)} more", 16, 102 + 24 * len(shown), Style(13, GREY))


def _phase(motion: Motion, now: VehicleMoment) -> str:
    return phase_name(motion.phase_names, now.phase) if now.phase >= 0 else "start"


def _shown(speed: float) -> str:
    return "still" if speed <= 0.0 else f"× {speed:.0f}" if speed >= 1.95 else f"× {speed:.1f}"


def _range(now: VehicleMoment) -> str:
    return f"{now.range:.2f} m" if now.range < 20.0 else f"{now.range:.0f} m"


def error(now: VehicleMoment) -> str:
    """Distance of the estimated position from the true one, depth included; held fast, a vehicle estimates nothing."""
    if now.belief is None:
        return "no fix yet"
    return f"{math.dist(now.belief.position, now.position):.2f} m" if now.belief.age < HELD else "–"


def _current(now: VehicleMoment) -> str:
    return f"{float(np.linalg.norm(now.current)):.2f} m/s"


def _legend(on: Panel, playback: Playback, moment: Moment) -> None:
    true = [marks.colour_of(playback, name) for name in [*playback.motions][: len(marks.FLEET)]]
    reason = playback.latest_refusal(moment.time)
    refused = shortened(f"refused: {reason.replace('_', ' ')}", Style(13), 110) if reason else "refused fix"
    entries = (
        ("true track", true, 14),
        ("estimate, 2σ", [marks.ESTIMATE], 14),
        *((("dock and axis", [marks.DOCK], 14),) if playback.docks or not playback.talks else ()),
        *(
            (("heard, lost", [HEARD, LOST], 14),)
            if playback.talks and not (playback.docks and playback.hears_fixes)
            else ()
        ),
        *((("fix", [marks.FIX], 7), (refused, [marks.REFUSED], 7)) if playback.hears_fixes else ()),
        ("current", [marks.CURRENT], 14),
    )
    for (text, colours, width), (row, column) in zip(entries, np.ndindex(2, 3), strict=False):
        x, y, height = 16 + 134 * column, 206 + 26 * row, 7 if width == 7 else 4
        piece = width / len(colours)
        for index, colour in enumerate(colours):
            on.block(x + index * piece, y - 4 - height / 2, piece, height, colour)
        on.put(text, x + 20, y, Style(13, WHITE))
