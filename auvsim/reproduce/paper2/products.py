"""What the study of paper 2 leaves: tables as CSV, and pictures."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.style import dress
from auvsim.reproduce.paper2.acceptance import claims, verdicts
from auvsim.reproduce.paper2.filters import METHODS, SWEEP, TIMES
from auvsim.reproduce.paper2.runs import CURRENT, CYCLE, Run
from auvsim.reproduce.paper2.scores import Result
from auvsim.reproduce.paper2.study import LOSSES, PHYSICAL, PHYSICAL_TITLES, ROWS, Study, example
from auvsim.reproduce.products import finish, verdict_rows, write_files
from estimators.core.types import Array

COLOURS = {"reckoning": "#7f7f7f", "paper": "#1f77b4", "bank": "#2c7a2c", "ekf": "#ff7f0e", "bound": "#444444"}
LABELS = {"reckoning": "dead reckoning", "paper": "paper's filter", "bank": "bank of filters", "ekf": "range EKF"}
PHYSICAL_LABELS = {
    "reckoning": "dead reckoning", "paper": "paper's filter", "bank": "bank without states for it",
    "states": "bank with states for it", "all": "bank with all states",
}  # fmt: skip
Tracks = tuple[Run, Mapping[str, tuple[Array, Array]]]


def write(study: Study, folder: Path) -> list[Path]:
    """Writes study.csv, acceptance.csv and claims.csv, figures 2 to 5, loss.png, p1.png and mujoco.png.

    Those of a truth that was not run are left out.

    Raises:
        InputError: If one of them cannot be written.
    """
    tables: dict[str, Iterable[Sequence[Any]]] = {"study.csv": study_rows(study)}
    tables["acceptance.csv"] = verdict_rows(verdicts(study))
    figures = {}
    if study.results:
        tables["claims.csv"] = [
            ("claim", "measured", "holds"),
            *((*c[:2], "yes" if c.holds else "no") for c in claims(study)),
        ]
        runs = {noise: example(study.seed, noise) for noise in ("nominal", "matched")}
        figures = {
            "figure2.png": figure2(runs["nominal"]), "figure3.png": figure3(runs), "figure4.png": figure4(runs),
            "figure5.png": figure5(runs), "loss.png": loss_figure(study), "p1.png": p1_figure(study),
        }  # fmt: skip
    if study.physical:
        figures["mujoco.png"] = physical_figure(study)
    return write_files(folder, tables, figures)


def lines(study: Study) -> Iterable[tuple[str, str, str, str, Result, tuple[float, float]]]:
    """Truth, row, title, filter's title, result, and the row's bounds, of everything that was run."""
    none = (math.nan, math.nan)
    for name, results in study.results.items():
        for key, result in results.items():
            yield "planar", name, ROWS[name].title, METHODS[key].title, result, study.bounds.get(name, none)
    for name, results in study.physical.items():
        for key, result in results.items():
            title, bound = f"MuJoCo, {PHYSICAL_TITLES[name]}", study.physical_bounds[name]
            yield "mujoco", name, title, PHYSICAL_LABELS[key], result, bound


def study_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of study.csv: one for each row and filter."""
    names = (
        "runs", "rms_m", "rms_deviation_m", "median_rms_m", "final_rms_m", "nees_per_axis", "nees_deviation",
        "current_error_500s_ms", "current_error_1000s_ms", "current_bias_ms", "median_peak_m", "lost", "flagged_rank_2",
        "flagged_rank_3", "flagged_mirror",
    )  # fmt: skip
    yield "truth", "row", "title", "filter", *names, "bound_m", "bound_final_m", "ratio_to_bound"
    for truth, row, title, method, result, bound in lines(study):
        yield truth, row, title, method, *result, *bound, result.rms / bound[0]


def figure2(shown: Tracks) -> Figure:
    """Tracks of the leader and of the follower, true and estimated."""
    run, tracks = shown
    figure = Figure(figsize=(13.0, 5.5), layout="constrained")
    axes = figure.subplots()
    axes.plot(*run.leader.T, color="#d62728", lw=1.4, label="leader")
    axes.plot(run.truth[:, 0], run.truth[:, 1], color="black", lw=2.4, label="follower, truth")
    for key in ("reckoning", "paper", "bank"):
        means = tracks[key][0]
        axes.plot(means[:, 0], means[:, 1], color=COLOURS[key], lw=1.3, ls=(0, (4, 2)), label=LABELS[key])
    axes.set_aspect("equal", adjustable="datalim")
    dress(axes, "Axes as in the paper: its x is north here, its y east", "x, north [m]", "y, east [m]")
    finish(figure, axes, "Figure 2: tracks, weave, nominal noise")
    return figure


def figure3(runs: Mapping[str, Tracks]) -> Figure:
    """Position errors along x and y in two sets of noise."""
    return _over_time(
        runs,
        "Figure 3: position error",
        "[m]",
        lambda run, means: (means - _truth(run))[:, :2],
        ("x (north)", "y (east)"),
        40.0,
    )


def figure4(runs: Mapping[str, Tracks]) -> Figure:
    """Current errors along x and y in two sets of noise."""
    return _over_time(
        runs, "Figure 4: current error", "[m/s]", lambda run, means: (means - _truth(run))[:, 2:], ("Ux", "Uy"), 0.3
    )


def figure5(runs: Mapping[str, Tracks]) -> Figure:
    """Estimated currents along x and y in two sets of noise."""
    return _over_time(
        runs, "Figure 5: estimated current; 0.5 m/s is true", "[m/s]", lambda run, means: means[:, 2:], ("Ux", "Uy"),
        0.3, CURRENT,
    )  # fmt: skip


def loss_figure(study: Study) -> Figure:
    """Rms over the share of lost packets, beside the bound."""
    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axes = figure.subplots()
    rows = [f"loss_{100 * loss:.0f}" for loss in LOSSES]
    share = 100.0 * np.array(LOSSES)
    for key in ("paper", "ekf", "bank"):
        results = [study.results[row][key] for row in rows]
        _intervals(axes, share, results, COLOURS[key], LABELS[key])
    axes.plot(share, [study.bounds[row][0] for row in rows], color=COLOURS["bound"], ls="--", lw=1.6, label="bound")
    axes.set(yscale="log", xticks=share)
    dress(axes, "Rms of the position after 500 s, with 95 % intervals", "packets lost [%]", "rms [m]")
    finish(figure, axes, f"Lost packets, weave, nominal noise, {study.results[rows[0]]['bank'].runs} runs")
    return figure


def p1_figure(study: Study) -> Figure:
    """Rms of the paper's filter over the first covariance."""
    figure = Figure(figsize=(8.5, 5.0), layout="constrained")
    axes = figure.subplots()
    places = np.arange(float(len(SWEEP)))
    results = [study.results["p1"][f"p1_{k}"] for k in range(len(SWEEP))]
    _intervals(axes, places, results, COLOURS["paper"], "paper's filter, rms")
    axes.plot(places, [r.median for r in results], "s:", color=COLOURS["paper"], label="paper's filter, median run")
    axes.axhline(study.bounds["p1"][0], color=COLOURS["bound"], ls="--", label="bound")
    axes.set(yscale="log", xticks=places)
    axes.set_xticklabels([f"{p:g} m²\n{u:g} m²/s²" for p, u in SWEEP])
    dress(axes, "Position after 500 s", "variances of P1: position, current", "error [m]")
    finish(figure, axes, f"The first covariance, weave, nominal noise, {results[0].runs} runs")
    return figure


def physical_figure(study: Study) -> Figure:
    """Rms and NEES on MuJoCo's truth, by what is wrong."""
    figure = Figure(figsize=(12.0, 5.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    places = np.arange(float(len(PHYSICAL)))
    shown = {"bank": ("#d62728", "s"), "states": ("#2c7a2c", "o"), "all": ("#9467bd", "D")}
    for number, (key, (colour, marker)) in enumerate(shown.items()):
        results = [study.physical[row][key] for row in PHYSICAL]
        style = {"fmt": marker, "color": colour, "ms": 5, "label": PHYSICAL_LABELS[key]}
        x = places + 0.2 * (number - 1)
        left.errorbar(x, [r.rms for r in results], yerr=[1.96 * r.rms_deviation for r in results], **style)
        right.errorbar(x, [r.nees for r in results], yerr=[1.96 * r.nees_deviation for r in results], **style)
    left.scatter(
        places, [study.physical_bounds[row][0] for row in PHYSICAL], marker="_", s=900, color="#444444", label="bound"
    )
    right.axhspan(0.8, 1.5, color="#2c7a2c", alpha=0.12, label="to reach with states for it")
    right.set(yscale="log")
    for axes, title, label in (
        (left, "Rms of the position after 500 s", "rms [m]"),
        (right, "NEES per axis", "NEES [-]"),
    ):
        axes.set_xticks(places, [PHYSICAL_TITLES[row] for row in PHYSICAL], rotation=20.0, ha="right")
        dress(axes, title, "", label)
    left.set_ylim(bottom=0.0)
    runs = study.physical["none"]["bank"].runs
    finish(figure, [left, right], f"REMUS-100 in MuJoCo, weave in (0.5, 0.5) m/s, {runs} runs, 95 % intervals")
    return figure


def _intervals(axes: Axes, x: Array, results: Sequence[Result], colour: str, label: str) -> None:
    values = np.array([r.rms for r in results])
    reach = 1.96 * np.nan_to_num([r.rms_deviation for r in results])
    axes.errorbar(
        x, values, yerr=(np.minimum(reach, 0.9 * values), reach), fmt="o-", color=colour, capsize=3, label=label
    )


def _truth(run: Run) -> Array:
    return run.truth[CYCLE::CYCLE]


def _over_time(
    runs: Mapping[str, Tracks], title: str, unit: str, quantity: Any, axes_names: tuple[str, str], least: float,
    middle: Array | None = None,
) -> Figure:  # fmt: skip
    """A quantity (k, 2) over time of the paper's filter and the bank: sets of noise in columns, axes in rows."""
    figure = Figure(figsize=(12.0, 7.0), layout="constrained")
    panels = figure.subplots(2, len(runs), sharex=True, squeeze=False)
    for column, (noise, (run, tracks)) in enumerate(runs.items()):
        for row, name in enumerate(axes_names):
            axes = panels[row, column]
            centre = 0.0 if middle is None else float(middle[row])
            axes.axhline(centre, color="black", lw=0.8)
            reach = least
            for key in ("paper", "bank"):
                values = quantity(run, tracks[key][0])[:, row]
                axes.plot(TIMES, values, color=COLOURS[key], lw=1.3, label=LABELS[key])
                reach = max(reach, 1.1 * float(np.quantile(np.abs(values - centre), 0.99)))
            axes.set(ylim=(centre - reach, centre + reach), xlim=(0.0, TIMES[-1]))
            dress(axes, f"{name}, noise {noise}", "time [s]" if row else "", f"{name} {unit}")
    finish(figure, panels.ravel(), f"{title}; one run of each set of noise")
    return figure
