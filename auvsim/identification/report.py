"""The report of an identification: one HTML page that needs no network, and the same as one picture."""

import io
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
from markupsafe import Markup
from matplotlib.figure import Figure

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.base.templates import environment
from auvsim.identification import pictures
from auvsim.identification.pipeline import NAMES, Identification
from auvsim.physics.planar_sets import UNITS

DPI = 100


@dataclass(frozen=True, kw_only=True, slots=True)
class ParameterRow:
    """Line of the table of parameters."""

    name: str
    start: float
    value: float
    low: float  # of the 95 % interval
    high: float
    profiled: bool  # whether the interval is that of the likelihood ratio
    unit: str
    relative: float  # standard deviation relative to the value
    weak: bool  # whether the data alone do not identify it


def write(found: Identification, folder: Path) -> tuple[Path, Path]:
    """Writes report.html and report.png, each whole or not at all.

    Raises:
        InputError: If they cannot be written.
    """
    page, picture = folder / "report.html", folder / "report.png"
    try:
        with whole(page) as partial:
            partial.write_text(html(found), encoding="utf-8")
        with whole(picture) as partial:
            pictures.overview(found).savefig(partial, dpi=DPI, format="png")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None
    return page, picture


def html(found: Identification) -> str:
    """Renders the report as one HTML page."""
    judged = pictures.hardest(found)
    states = Figure(figsize=(11.5, 8.0), layout="constrained")
    pictures.states_panels(states, judged)
    residuals = zip(NAMES, found.fit.residual_rms.tolist(), found.fit.whiteness, strict=True)
    return (
        environment("auvsim.identification")
        .get_template("report.html.j2")
        .render(
            found=found,
            origin=_origin(found),
            parameters=list(_parameters(found)),
            residuals=[row for row in residuals if not math.isnan(row[1])],  # of what was measured
            states=svg(states),
            track=_panel(lambda axes: pictures.track_panel(axes, judged), (6.0, 5.2)),
            growth=_panel(lambda axes: pictures.growth_panel(axes, found), (6.0, 5.2)),
            parameter_panel=_panel(lambda axes: pictures.parameter_panel(axes, found, numbers=False), (6.0, 5.8)),
            correlation=_panel(lambda axes: pictures.correlation_panel(axes, found), (6.0, 5.8)),
        )
    )


def _panel(draw: Callable[[Any], None], size: tuple[float, float]) -> Markup:
    figure = Figure(figsize=size, layout="constrained")
    draw(figure.subplots())
    return svg(figure)


def svg(figure: Figure) -> Markup:
    """The figure as an element of the page, the same for the same numbers."""
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "auvsim", "svg.fonttype": "none", "font.family": "sans-serif"}):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    text = stream.getvalue()
    return Markup(text[text.index("<svg") :])


def _origin(found: Identification) -> str:
    steps = ", ".join(fit.method for fit in found.fits)
    fitted = sum(record.duration for record in found.fitted)
    return (
        f"{steps}; {fitted:.0f} s of {len(found.fitted)} records, mean {found.speed:.2f} m/s through the water; "
        f"started from {found.start_text}"
    )


def _parameters(found: Identification) -> Iterator[ParameterRow]:
    assessed = found.identifiability
    for name, relative in zip(assessed.names, assessed.relative.tolist(), strict=True):
        low, high = found.intervals[name]
        yield ParameterRow(
            name=name, start=getattr(found.start, name), value=getattr(found.fit.parameters, name), low=low, high=high,
            profiled=name in found.profiled, unit=UNITS[name], relative=relative, weak=name in assessed.weak,
        )  # fmt: skip
