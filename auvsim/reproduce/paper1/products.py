"""What the study of paper 1 leaves: tables as CSV, and pictures."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.style import BAND, dress
from auvsim.reproduce.paired import REFERENCE
from auvsim.reproduce.paper1.acceptance import PAPER_MEANS, PAPER_VARIANCES, verdicts
from auvsim.reproduce.paper1.planar import CURVES, SETTLED, Curves, Study
from auvsim.reproduce.paper1.study import FILTERS, ROWS, Result
from auvsim.reproduce.products import finish, verdict_rows, write_files

COLOURS = {"regular_best": "#d62728", "paper": "#1f77b4", "imm_biases": "#2c7a2c"}
LABELS = {
    "regular_best": "regular EKF, its best noise",
    "paper": "paper's improved EKF",
    "imm_biases": "IMM with biases",
}
# Drawn in study.png: those of which it is the question whether they beat the paper's filter.
DOTS = {
    "augmented": ("#ff7f0e", "s"),
    "augmented_constant": ("#9467bd", "v"),
    "imm": ("#17a2a2", "D"),
    "imm_biases": ("#2c7a2c", "o"),
}
TURN = (120.0, 130.0)  # when the current turns [s]


def write(study: Study, folder: Path) -> list[Path]:
    """Writes study.csv, acceptance.csv, table1.csv, figure6.png, figure7.png and study.png.

    Raises:
        InputError: If one of them cannot be written.
    """
    tables = {"study.csv": study_rows, "acceptance.csv": acceptance_rows, "table1.csv": table1_rows}
    figures = {"figure6.png": figure6, "figure7.png": figure7, "study.png": study_figure}
    return write_files(
        folder,
        {name: make(study) for name, make in tables.items()},
        {name: draw(study) for name, draw in figures.items()},
    )


def study_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of study.csv: one for each row and filter."""
    yield (
        "row", "title", "filter", "runs", "rms_m", "mean_m", "variance_m2", "maximum_m", "mean_peak_m",
        "worst_run_rms_m", "nees_per_dof", "state_nees_per_dof", "ratio", "ratio_low", "ratio_high", "bound_m",
        "ratio_to_bound",
    )  # fmt: skip
    for name, results in study.results.items():
        bound = study.bounds.get(name, math.nan)
        for key, result in results.items():
            yield (
                name, ROWS[name].title, key, study.runs[name], result.rms, result.mean, result.variance,
                result.maximum, result.peak, result.worst_rms, claimed_nees(key, result), result.state_nees,
                result.ratio, *interval(result), bound, result.rms / bound,
            )  # fmt: skip


def acceptance_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of acceptance.csv: one for each thing to reach."""
    return verdict_rows(verdicts(study))


def table1_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of table1.csv: the error's mean and variance beside the paper's, by distance."""
    yield "distance_m", "mean_m", "paper_mean_m", "mean_ratio", "variance_m2", "paper_variance_m2"
    for name in SETTLED:
        if name in study.results:
            result, mean = study.results[name][REFERENCE], PAPER_MEANS[name]
            distance = ROWS[name].conditions.radius
            yield distance, result.mean, mean, result.mean / mean, result.variance, PAPER_VARIANCES[name]


def interval(result: Result) -> tuple[float, float]:
    """95 % interval of a ratio; NaN of a single run."""
    return result.ratio - 1.96 * result.ratio_deviation, result.ratio + 1.96 * result.ratio_deviation


def claimed_nees(key: str, result: Result) -> float:
    """NEES of a filter whose covariance is meant to hold its whole error; NaN for those that leave the current out."""
    return result.nees if key in ("augmented", "augmented_constant", "unscented", "imm", "imm_biases") else math.nan


def figure6(study: Study) -> Figure:
    """Position errors on the circle of 40 m: one run above, the rms of all below."""
    curves = study.curves
    figure = Figure(figsize=(12.0, 7.5), layout="constrained")
    one, every = figure.subplots(2, 1, sharex=True)
    for key in CURVES:
        one.plot(curves.times, curves.errors[key][0], color=COLOURS[key], lw=1.4, label=LABELS[key])
        every.plot(curves.times, _rms(curves, key), color=COLOURS[key], lw=1.4)
    count = len(curves.errors[REFERENCE])
    for axes, title in ((one, "One run"), (every, f"Root mean square of {count} runs")):
        axes.set(yscale="log", ylim=(0.005, 20.0), xlim=(0.0, curves.times[-1]))
        _mark_turn(axes)
        dress(axes, title, "time [s]" if axes is every else "", "position error [m]")
    finish(figure, one, "Position error on the 40 m circle; the current of 0.5 m/s turns by 90° in 120 to 130 s")
    return figure


def figure7(study: Study) -> Figure:
    """Position error on a linear scale round the turn, and what the filters took for the current."""
    curves = study.curves
    figure = Figure(figsize=(12.0, 8.5), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for key in CURVES:
        panels[0].plot(curves.times, curves.errors[key][0], color=COLOURS[key], lw=1.4, label=LABELS[key])
    panels[0].set(ylim=(0.0, None), xlim=(0.0, curves.times[-1]))
    dress(panels[0], "Position error of that run", "", "position error [m]")
    for k, axis in enumerate(("north", "east")):
        panels[1 + k].plot(curves.times, curves.current[:, k], color="black", ls=(0, (5, 2)), lw=1.2, label="truth")
        for key in CURVES:
            panels[1 + k].plot(curves.times, curves.currents[key][:, k], color=COLOURS[key], lw=1.2)
        panels[1 + k].set(ylim=(-0.9, 0.9))
        dress(panels[1 + k], f"Current {axis}: truth and estimates", "time [s]" if k else "", "current [m/s]")
    for axes in panels:
        _mark_turn(axes)
    finish(figure, panels[:2], "The same circle: error, and the estimated current")
    return figure


def study_figure(study: Study) -> Figure:
    """Ratios of rms to the paper's filter with their 95 % intervals, row by row."""
    figure = Figure(figsize=(11.0, 1.6 + 0.5 * len(study.results)), layout="constrained")
    axes = figure.subplots()
    names = list(study.results)
    for number, (key, (colour, marker)) in enumerate(DOTS.items()):
        results = [study.results[name][key] for name in names]
        heights = np.arange(len(names)) + 0.16 * (number - 1.5)
        ratios = np.array([r.ratio for r in results])
        reach = np.nan_to_num([1.96 * r.ratio_deviation for r in results])
        below = np.minimum(reach, 0.95 * ratios)  # a logarithmic axis has no zero
        axes.errorbar(
            ratios, heights, xerr=(below, reach), fmt=marker, color=colour, ms=5, lw=1.2, label=FILTERS[key].title
        )
    axes.axvline(1.0, color="#1f77b4", lw=1.4)
    axes.axvspan(0.01, 1.0, facecolor=BAND, alpha=0.08)
    axes.set(xscale="log", yticks=range(len(names)), ylim=(len(names) - 0.5, -0.5))
    axes.set_xticks(ticks := [0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20], [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_xlim(0.01, 40.0)
    axes.set_yticklabels([ROWS[name].title for name in names])
    dress(axes, "Left of the line: better than the paper's filter", "rms error relative to the paper's filter", "")
    finish(figure, axes, f"Paper 1's study, seed {study.seed}{', quick' if study.quick else ''}: 95 % intervals")
    return figure


def _rms(curves: Curves, key: str) -> np.ndarray:
    errors = curves.errors[key]
    known = np.isfinite(errors).all(axis=0)
    return np.where(known, np.sqrt(np.mean(np.where(known, errors, 0.0) ** 2, axis=0)), math.nan)


def _mark_turn(axes: Axes) -> None:
    axes.axvspan(*TURN, facecolor=BAND, lw=0.0, zorder=0)
