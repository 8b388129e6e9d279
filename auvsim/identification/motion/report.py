"""Report of a motion model: one self-contained page and one picture; its first line says how far to trust the model."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.style import dress
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.base.templates import environment
from auvsim.identification.motion.files import intervals
from auvsim.identification.motion.identify import MotionIdentification, verdicts
from auvsim.identification.motion.uncertainty import Held
from auvsim.identification.report import svg

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
    """Renders the report as one HTML page."""
    return (
        environment("auvsim.identification")
        .get_template("motion/report.html.j2")
        .render(
            found=found,
            verdicts=verdicts(found),
            picture=svg(overview(found)),
            horizons=horizon_rows(found),
            step_headings=("step", *(f"{s:.0f} s [%]" for s in found.judged.horizons)),
            steps=[(step, *(f"{100 * e:.2f}" for e in errors)) for step, errors in found.steps],
            candidates=_candidates(found),
            coefficients=[(t, f"{v:.4g}", f"{low:.4g} to {high:.4g}") for t, v, low, high in intervals(found)],
        )
    )


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


def _candidates(found: MotionIdentification) -> list[tuple[str, ...]]:
    return [
        (
            c.structure.name, str(len(c.structure.terms)), c.step, f"{100 * c.error:.2f}", f"{100 * c.deviation:.2f}",
            found.choice.mark(c),
        )
        for c in found.choice.candidates
    ]  # fmt: skip


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
    dress(axes, "Predictions", "open loop for [s]", "position error relative to the distance run [%]")


def _bars(axes: Axes, found: MotionIdentification) -> None:
    shown = found.choice.candidates[:12][::-1]
    colours = ["#1f5fa8" if c is found.choice.chosen else "#b9c6d6" for c in shown]
    places = np.arange(len(shown))
    axes.barh(places, [100 * min(c.error, 1.0) for c in shown], color=colours)
    axes.set_yticks(places, [f"{c.structure.name}: {c.step}" for c in shown])
    dress(axes, "Structures and steps", f"error after {found.choice.horizon:.0f} s, cross-validated [%]", "")
