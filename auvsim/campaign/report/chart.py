"""Small SVG charts: scales with round ticks, intervals on them. Colours come from the classes `v0` to `v7`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.ticker import MaxNLocator

from auvsim.campaign.report.markup import Markup, number, tag

COLOURS = 8  # classes of colours in report.css
HEIGHT = 20.0  # of a line of a table [px]
MIDDLE = HEIGHT / 2.0
WIDTH = 220.0  # of a column of intervals [px]
STEPS = (1, 2, 2.5, 5, 10)  # between round ticks, times a power of ten
SIDE = 20.0  # left and right of a column of intervals, where the ends' labels reach out [px]


def colour(variant: int) -> str:
    """The class that gives a variant its colour."""
    return f"v{variant % COLOURS}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Scale:
    """Values from `low` to `high` on pixels from `start` to `end`."""

    low: float
    high: float
    start: float
    end: float
    logarithmic: bool = False

    def __call__(self, value: float) -> float:
        """The pixel of a value; beyond the ends, the end."""
        low, high, value = (math.log(x) if self.logarithmic else x for x in (self.low, self.high, max(value, self.low)))
        return self.start + (self.end - self.start) * min(max((value - low) / (high - low), 0.0), 1.0)

    def ticks(self, count: int = 4) -> list[float]:
        """Round values inside, about as many."""
        if self.logarithmic:
            decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            found = [m * 10.0**d for d in decades for m in (1, 2, 5) if self.low <= m * 10.0**d <= self.high]
            powers = [10.0**d for d in decades if self.low <= 10.0**d <= self.high]
            return found if len(found) <= count + 1 else powers[:: math.ceil(len(powers) / (count + 1))]
        found = MaxNLocator(count, steps=STEPS).tick_values(self.low, self.high).tolist()
        slack = 1e-9 * (self.high - self.low)
        return [tick if abs(tick) > slack else 0.0 for tick in found if self.low - slack <= tick <= self.high + slack]


def svg(width: float, height: float, *children: object, **attributes: object) -> Markup:
    """A drawing that keeps its size in pixels unless the page is narrower."""
    return tag(
        "svg", *children, viewbox=f"0 0 {width:g} {height:g}", width=width, height=height, role="img", **attributes
    )


def interval_scale(values: Sequence[float], bounds: tuple[float, float] = (-math.inf, math.inf)) -> Scale:
    """A scale for intervals that share a column: round ends round all finite values, within the bounds."""
    finite = [value for value in values if math.isfinite(value)] or [0.0]
    low, high = min(finite), max(finite)
    low, high = (low - 0.5, high + 0.5) if low == high else (low, high)
    ticks = MaxNLocator(4, steps=STEPS).tick_values(low, high)
    low, high = max(float(ticks[0]), bounds[0]), min(float(ticks[-1]), bounds[1])
    return Scale(low=low, high=high, start=SIDE, end=WIDTH - SIDE)


def interval(
    scale: Scale, value: float | None, low: float, high: float, variant: int, zero: float | None = None
) -> Markup:
    """One line of a column of intervals: a thick line from `low` to `high`, a dot at the value, a thin line at zero."""
    parts = [_upright(scale, tick, "tick") for tick in scale.ticks()]
    parts += [_upright(scale, zero, "zero")] if zero is not None else []
    if math.isfinite(low) and math.isfinite(high):
        parts += [tag("line", x1=scale(low), x2=scale(high), y1=MIDDLE, y2=MIDDLE, class_="interval")]
    return _line(scale, value, variant, parts)


def band(scale: Scale, value: float, low: float, high: float, variant: int) -> Markup:
    """One line of a column of values: a band where the value is expected, a dot where it is."""
    width = max(scale(high) - scale(low), 3.0)
    parts = [tag("rect", x=scale(low), y=0, width=width, height=HEIGHT, class_="band")]
    parts += [_upright(scale, tick, "tick") for tick in scale.ticks()]
    return _line(scale, value, variant, parts)


def _upright(scale: Scale, value: float, kind: str) -> Markup:
    return tag("line", x1=scale(value), x2=scale(value), y1=-4, y2=HEIGHT + 4, class_=kind)


def _line(scale: Scale, value: float | None, variant: int, parts: list[Markup]) -> Markup:
    known = [value] if value is not None and math.isfinite(value) else []
    dot = [tag("circle", cx=scale(x), cy=MIDDLE, r=4.5, class_="dot") for x in known]
    return svg(scale.end + SIDE, HEIGHT, parts, dot, class_=colour(variant), aria_hidden="true")


def ruler(scale: Scale, factor: float = 1.0, unit: str = "") -> Markup:
    """The heading of a column of intervals: its ticks, in units of 1 / factor."""
    ticks = scale.ticks()
    labels = [number(factor * tick, 3) for tick in ticks]
    parts = [
        tag("text", _short(label) + (unit if tick == ticks[-1] else ""), x=scale(tick), y=12, text_anchor="middle")
        for label, tick in zip(labels, ticks, strict=True)
    ]
    return svg(scale.end + SIDE, 16.0, parts, aria_hidden="true")


def _short(text: str) -> str:
    """A tick without trailing zeros."""
    return (text.rstrip("0").rstrip(".") or "0") if "." in text else text
