"""Paper 1's study on two truths, the planar model's and MuJoCo's: tables and a picture of one beside the other."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.style import dress
from auvsim.reproduce.paper1 import mujoco as paper1_mujoco
from auvsim.reproduce.paper1 import study as paper1_study
from auvsim.reproduce.paper1.mujoco import MujocoStudy
from auvsim.reproduce.paper1.planar import Study
from auvsim.reproduce.paper1.products import DOTS, claimed_nees, interval
from auvsim.reproduce.paper1.study import FILTERS, Result
from auvsim.reproduce.products import finish, write_files

Results = Mapping[str, Result]  # by filter
DRAWN = ("augmented", "imm_biases")


def write(planar: Study | None, mujoco: MujocoStudy, folder: Path) -> list[Path]:
    """Writes study_mujoco.csv and, beside the study on planar truth, truths.csv and truths.png.

    Raises:
        InputError: If one of them cannot be written.
    """
    tables, figures = {"study_mujoco.csv": study_rows(mujoco)}, {}
    if planar is not None:
        tables["truths.csv"] = truths_rows(planar, mujoco)
        figures["truths.png"] = truths_figure(planar, mujoco)
    return write_files(folder, tables, figures)


def study_rows(study: MujocoStudy) -> Iterable[Sequence[Any]]:
    """Heading and lines of study_mujoco.csv: one for each row and filter."""
    yield (
        "row", "title", "filter", "runs", "rms_m", "mean_m", "maximum_m", "mean_peak_m", "worst_run_rms_m",
        "nees_per_dof", "state_nees_per_dof", "ratio", "ratio_low", "ratio_high", "bound_m", "ratio_to_bound",
    )  # fmt: skip
    for name, results in study.results.items():
        bound = study.bounds.get(name, math.nan)
        for key, result in results.items():
            yield (
                name, paper1_mujoco.ROWS[name].title, key, study.runs[name], result.rms, result.mean, result.maximum,
                result.peak, result.worst_rms, claimed_nees(key, result), result.state_nees, result.ratio,
                *interval(result), bound, result.rms / bound,
            )  # fmt: skip


def truths_rows(planar: Study, mujoco: MujocoStudy) -> Iterable[Sequence[Any]]:
    """Heading and lines of truths.csv: one for each row and filter whose covariance is meant to hold its error."""
    truths, quantities = ("planar", "mujoco"), ("runs", "rms_m", "nees_per_dof", "ratio", "ratio_low", "ratio_high")
    yield (
        "row",
        "title",
        "filter",
        *(f"{truth}_{quantity}" for truth in truths for quantity in quantities),
    )
    for name, both in beside(planar, mujoco):
        for key in (key for key in DOTS if key in both[1]):
            columns = []
            for study, results in zip((planar, mujoco), both, strict=True):
                r = results.get(key)
                columns += [""] * 6 if r is None else [study.runs[name], r.rms, r.nees, r.ratio, *interval(r)]
            yield name, title(name), key, *columns


def beside(planar: Study, mujoco: MujocoStudy) -> Iterator[tuple[str, tuple[Results, Results]]]:
    """Each row on MuJoCo's truth: results by filter on the planar truth, none if it lacks the row, and on MuJoCo's."""
    for name, results in mujoco.results.items():
        yield name, (planar.results.get(name, {}), results)


def title(name: str) -> str:
    """What a row is called where both truths stand side by side."""
    rows = paper1_study.ROWS if name in paper1_study.ROWS else paper1_mujoco.ROWS
    return rows[name].title


def truths_figure(planar: Study, mujoco: MujocoStudy) -> Figure:
    """Ratios of rms to the paper's filter with their 95 % intervals, and NEES, row by row on both truths."""
    rows = list(beside(planar, mujoco))
    figure = Figure(figsize=(13.0, 2.0 + 0.5 * len(rows)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for number, key in enumerate(DRAWN):
        colour, marker = DOTS[key]
        for truth, (name, face) in enumerate((("planar truth", "white"), ("MuJoCo truth", colour))):
            known = [(k, both[truth][key]) for k, (_, both) in enumerate(rows) if key in both[truth]]
            heights = np.array([k for k, _ in known]) + 0.2 * (2 * number + truth - 1.5)
            ratios = np.array([result.ratio for _, result in known])
            reach = np.nan_to_num([1.96 * result.ratio_deviation for _, result in known])
            style = {"fmt": marker, "color": colour, "mfc": face, "ms": 5.5, "lw": 1.1}
            below = np.minimum(reach, 0.95 * ratios)  # a logarithmic axis has no zero
            left.errorbar(ratios, heights, xerr=(below, reach), label=f"{FILTERS[key].title}, {name}", **style)
            right.errorbar([result.nees for _, result in known], heights, **style)
    left.set(yticks=range(len(rows)), ylim=(len(rows) - 0.5, -0.5))
    left.set_yticklabels([title(name) for name, _ in rows])
    _scale(left, (0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5))
    _scale(right, (0.2, 0.5, 1, 2, 5, 10, 20, 50))
    dress(left, "Left of the line: better than the paper's filter", "rms error relative to the paper's filter", "")
    dress(right, "On the line: consistent; right of it: overconfident", "NEES of the position per axis", "")
    finish(figure, left, "Paper 1's study on the planar model's truth and on MuJoCo's")
    return figure


def _scale(axes: Axes, ticks: Sequence[float]) -> None:
    """A logarithmic axis with a line at 1."""
    axes.axvline(1.0, color="#1f77b4", lw=1.4)
    axes.set_xscale("log")
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
