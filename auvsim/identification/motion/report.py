"""Report of a motion model: one self-contained page and one picture; its first line says how far to trust the model."""

import io
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.style import dress
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.identification.motion.files import intervals
from auvsim.identification.motion.identify import MotionIdentification, verdicts
from auvsim.identification.motion.uncertainty import Held
from auvsim.identification.report import STYLE

DPI = 120


def write(found: MotionIdentification, folder: Path, stem: str = "report") -> tuple[Path, Path]:
    """Writes the page and the picture, each whole or not at all.

    Raises:
        InputError: If they cannot be written.
    """
    page, picture = folder / f"{stem}.html", folder / f"{stem}.png"
    try:
        with whole(page) as partial:
            partial.write_text(html(found), encoding="utf-8")
        with whole(picture) as partial:
            overview(found).savefig(partial, dpi=DPI, format="png")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None
    return page, picture


def html(found: MotionIdentification) -> str:
    """The page."""
    title = f"Motion model of {escape(found.name)}"
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "auvsim", "svg.fonttype": "none", "font.family": "sans-serif"}):
        overview(found).savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    picture = stream.getvalue()
    items = (
        f'<li class="{"good" if good else "bad"}">{escape(text)}</li>' for good, text in verdicts(found)
    )  # fmt: skip
    return "\n".join(
        (
            f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>',
            f"<style>{STYLE}</style></head><body><h1>{title}</h1>",
            f'<ul class="verdicts">{"".join(items)}</ul>',
            picture[picture.index("<svg") :],
            "<h2>Horizons</h2>", *_horizons(found),
            f"<h2>What was compared</h2><p class=small>{escape(found.choice.said)}; position error after "
            f"{found.choice.horizon:.0f} s by the distance run, and its standard error over the parts.</p>",
            *_table(("structure", "terms", "step", "error [%]", "standard error [%]", ""), _candidates(found)),
            "<h2>Coefficients</h2>",
            *_table(
                ("term", "value", "95 % interval"),
                [(t, f"{v:.4g}", f"{low:.4g} to {high:.4g}") for t, v, low, high in intervals(found)],
            ),
            "<h2>Data</h2>", *_data(found), "</body></html>\n",
        )
    )  # fmt: skip


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    yield f"<table><tr>{''.join(f'<th>{escape(h)}</th>' for h in headings)}</tr>"
    yield from (f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    yield "</table>"


def horizon_rows(found: MotionIdentification) -> list[tuple[str, ...]]:
    """Horizon, predictions, error, that of going on as it began, band, what it holds, what the coefficients' holds."""
    judged = found.judged
    columns = (
        judged.horizons, judged.count, judged.share, found.none, judged.radius, judged.inside, judged.parameters_inside
    )  # fmt: skip
    return [
        (f"{s:.0f}", f"{n}", f"{100 * e:.2f}", f"{100 * o:.2f}", f"{100 * b:.2f}", f"{100 * i:.0f}", f"{100 * p:.0f}")
        for s, n, e, o, b, i, p in zip(*columns, strict=True)
        if n
    ]


def _horizons(found: MotionIdentification) -> Iterator[str]:
    yield from _table(
        (
            "after [s]", "predictions", "error [%]", "going on as it began [%]", "95 % band [%]", "it holds [%]",
            "by coefficients alone [%]",
        ),
        horizon_rows(found),
    )  # fmt: skip
    yield (
        '<p class="small">Position error by the distance run, rms. Each prediction begins at the smoothed state and '
        "takes the record's inputs alone; no bias is fitted. The band is the longer semi-axis of its ellipse.</p>"
    )
    if found.steps:
        yield "<p>Each step of the chosen structure on what was held out:</p>"
        rows = [(step, *(f"{100 * e:.2f}" for e in errors)) for step, errors in found.steps]
        yield from _table(("step", *(f"{s:.0f} s [%]" for s in found.judged.horizons)), rows)


def _candidates(found: MotionIdentification) -> list[tuple[str, ...]]:
    return [
        (
            c.structure.name, str(len(c.structure.terms)), c.step, f"{100 * c.error:.2f}", f"{100 * c.deviation:.2f}",
            "chosen" if c is found.choice.chosen else "" if c.converged else "not converged",
        )
        for c in found.choice.candidates
    ]  # fmt: skip


def _data(found: MotionIdentification) -> Iterator[str]:
    yield "<ul>"
    for source in found.readings.sources:
        yield f"<li>{escape(source.file)} <span class=small>sha256 {source.sha256}</span></li>"
    yield f'</ul><ul class="small">{"".join(f"<li>{escape(note)}</li>" for note in found.readings.notes)}</ul>'


def overview(found: MotionIdentification) -> Figure:
    """Errors and bands by horizon, and the candidates side by side."""
    figure = Figure(figsize=(12.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    growth(left, found.judged, found.none)
    _bars(right, found)
    return figure


def growth(axes: Axes, judged: Held, none: np.ndarray) -> None:
    """Errors and bands by horizon."""
    seconds = np.array(judged.horizons)
    axes.plot(seconds, 100 * none, ls="--", color="#d95f02", label="going on as it began")
    axes.plot(seconds, 100 * judged.radius, color="#8a8a8a", label="95 % band")
    axes.plot(seconds, 100 * judged.share, marker="o", color="#1f5fa8", label="model")
    axes.set_yscale("log")
    axes.legend()
    dress(axes, "Predictions", "open loop for [s]", "position error by the distance run [%]")


def _bars(axes: Axes, found: MotionIdentification) -> None:
    shown = found.choice.candidates[:12][::-1]
    colours = ["#1f5fa8" if c is found.choice.chosen else "#b9c6d6" for c in shown]
    places = np.arange(len(shown))
    axes.barh(places, [100 * min(c.error, 1.0) for c in shown], color=colours)
    axes.set_yticks(places, [f"{c.structure.name}: {c.step}" for c in shown])
    dress(axes, "Structures and steps", f"error after {found.choice.horizon:.0f} s, cross-validated [%]", "")
