"""What the study of paper 4 leaves: tables as CSV, and its figures."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvsim.analysis.style import dress
from auvsim.reproduce.paper4.acceptance import verdicts
from auvsim.reproduce.paper4.claims import claims
from auvsim.reproduce.paper4.formations import FORMATIONS, SPEEDS, TABLE2, TABLE3, VARIANCES
from auvsim.reproduce.paper4.line import OFFSETS, SIDES, Trap
from auvsim.reproduce.paper4.study import MIDDLE, STEPS, Key, Study
from auvsim.reproduce.paper4.uwb import HALL, PAPER, PLACES
from auvsim.reproduce.products import finish, verdict_rows, write_files

NORTH, EAST, BOUND, PAPERS = "#1f77b4", "#d95f02", "#222222", "#7f7f7f"
OURS = {1.0: ("#2c8c2c", "o"), 7.5: ("#9467bd", "s")}  # by step


def write(study: Study, folder: Path) -> list[Path]:
    """Writes table2.csv, table3.csv, filters.csv, line.csv, cars.csv, claims.csv, acceptance.csv and the figures.

    Raises:
        InputError: If one of them cannot be written.
    """
    tables = {
        "table2.csv": table2(study), "table3.csv": table3(study), "filters.csv": filter_rows(study),
        "line.csv": line_rows(study), "cars.csv": car_rows(study), "claims.csv": claim_rows(study),
        "acceptance.csv": verdict_rows(verdicts(study)),
    }  # fmt: skip
    figures = {
        "figure2.png": figure2(), "figures6_10.png": figures6_to_10(study), "figure11.png": figure11(study),
        "figure14.png": figure14(study), "tables.png": tables_figure(study), "line.png": line_figure(study),
    }  # fmt: skip
    return write_files(folder, tables, figures)


def table2(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of table 2, A_RMS by formation and speed, beside the paper's."""
    yield (
        "formation",
        *(f"{who}_{v:g}_m_s" for v in SPEEDS for who in ("paper", "step_1_s", "step_7.5_s", "bound_1_s")),
    )
    for f in FORMATIONS:
        row: list[Any] = [f]
        for column, v in enumerate(SPEEDS):
            row += [TABLE2[f][column], *(study.results[Key(T, v, MIDDLE, f)]["ekf"].a_rms for T in STEPS)]
            row.append(study.bound(Key(1.0, v, MIDDLE, f)))
        yield row


def table3(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of table 3, A_RMS by variance of the ranges and formation, beside the paper's."""
    yield "variance_m2", "formation", "paper", "step_1_s", "step_7.5_s", "half_interval_7.5_s", "ratio_7.5_s"
    for v in VARIANCES:
        for f in FORMATIONS:
            ours = [study.results[Key(T, 1.0, v, f)]["ekf"] for T in STEPS]
            paper = TABLE3[v][f - 1]
            yield v, f, paper, ours[0].a_rms, ours[1].a_rms, ours[1].half, ours[1].a_rms / paper


def filter_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of all filters in all cells."""
    yield (
        "step_s",
        "speed_m_s",
        "variance_m2",
        "formation",
        "filter",
        "a_rms_m",
        "half_interval_m",
        "rms_m",
        "nees",
        "bound_m",
    )
    for key, found in study.results.items():
        for name, r in found.items():
            yield *key, name, r.a_rms, r.half, r.rms, r.nees, study.bound(key)


def line_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of offsets from the line, and of manoeuvres."""
    yield "leaders", "offset_m", "filter", "rms_m", "nees", "mirrored_share", "claimed_rms_m", "bound_m"

    def row(name: str, offset: Any, key: str, t: Trap) -> Sequence[Any]:
        return name, offset, key, t.rms, t.nees, t.mirrored if name == "one side" else math.nan, t.claimed, t.bound

    for (sides, offset), trap in study.offsets.items():
        yield row(sides, offset, "ekf", trap)
    for name, traps in study.manoeuvres.items():
        for key, trap in traps.items():
            yield row(name, math.nan, key, trap)


def car_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of the cars."""
    yield "bias_deg", "formation", "runs", "mean_a_rms_m", "paper_a_rms_m", "gain", "probability_worst_2_better"
    for bias, e in study.uwb.items():
        for name, cars in e.cars.items():
            yield (
                bias,
                name,
                len(cars.a_rms),
                float(cars.a_rms.mean()),
                PAPER.get(name, math.nan),
                e.gain,
                e.probability,
            )


def claim_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of the paper's claims."""
    yield "where", "claim", "found", "verdict"
    yield from claims(study)


def figure2() -> Figure:
    """S1 over the differences of two bearings."""
    degrees = np.linspace(0.0, 180.0, 181)
    first, second = np.meshgrid(np.radians(degrees), np.radians(degrees))
    s1 = np.sin(first) ** 2 + np.sin(second) ** 2 + np.sin(first + second) ** 2
    figure = Figure(figsize=(8.0, 6.6), layout="constrained")
    axes = figure.subplots()
    mesh = axes.pcolormesh(degrees, degrees, s1, cmap="viridis", shading="gouraud")
    figure.colorbar(mesh, ax=axes, label="S1 [-]")
    lines = axes.contour(degrees, degrees, s1, levels=(0.5, 1.0, 1.5, 2.0, 2.2), colors="white", linewidths=0.9)
    axes.clabel(lines, fontsize=8.5)
    axes.plot((60.0, 120.0), (60.0, 120.0), "*", ms=15, color="#d62728", label="optimum, 2.25")
    axes.plot((90.0, 90.0), (0.0, 180.0), "--", color="#ff7f0e", lw=1.6, label="sub-optimum, 2")
    axes.plot((0.0, 180.0), (90.0, 90.0), "--", color="#ff7f0e", lw=1.6)
    axes.plot(
        (0.0, 0.0, 180.0, 180.0), (0.0, 180.0, 0.0, 180.0), "X", ms=11, color="#222222", label="worst, 0", clip_on=False
    )
    dress(
        axes, "", "bearing of leader 1 less that of leader 2 [deg]", "bearing of leader 2 less that of leader 3 [deg]"
    )
    finish(figure, axes, "Figure 2: S1, on which the least error of equal ranges depends")
    return figure


def figures6_to_10(study: Study) -> Figure:
    """Errors of the extended filter in one run of formations 1 to 5."""
    figure = Figure(figsize=(12.0, 12.0), layout="constrained")
    axes = figure.subplots(5, 1, sharex=True)
    for f, each in zip(range(1, 6), axes, strict=True):
        trace = study.traces[f]
        each.plot(trace.time, trace.errors[:, 0], color=NORTH, lw=0.8, label="north (the paper's y)")
        each.plot(trace.time, trace.errors[:, 1], color=EAST, lw=0.8, label="east (the paper's x)")
        dress(each, f"Figure {f + 5}: formation {f}", "time [s]" if f == 5 else "", "error [m]")
        each.set_xlim(0.0, trace.time[-1])
    finish(figure, axes, "Figures 6 to 10: position errors of the follower, 1 m/s, ranges of 2 m, steps of 1 s")
    return figure


def figure11(study: Study) -> Figure:
    """S1 of formations 3 and 8 as seen from the estimate."""
    figure = Figure(figsize=(10.0, 4.6), layout="constrained")
    axes = figure.subplots()
    for f, colour in ((3, NORTH), (8, EAST)):
        axes.semilogy(
            study.traces[f].time, np.maximum(study.traces[f].s1, 1e-9), color=colour, lw=0.9, label=f"formation {f}"
        )
    axes.set(xlim=(0.0, study.traces[3].time[-1]), ylim=(1e-7, 1.0))
    dress(axes, "", "time [s]", "S1 at the estimate [-]")
    finish(figure, axes, "Figure 11: S1 along the estimated path; it is the error that makes it, the true one is 0")
    return figure


def figure14(study: Study) -> Figure:
    """Tracks of the cars in one run, with a heading bias of 10 deg."""
    figure = Figure(figsize=(12.5, 4.6), layout="constrained")
    several = figure.subplots(1, 3, sharex=True, sharey=True)
    bias = 10.0
    for (name, places), axes in zip(PLACES.items(), several, strict=True):
        cars = study.uwb[bias].cars[name]
        ahead = cars.truth - cars.truth[0] + (0.0, 0.03)
        for index, place in enumerate(places[1:]):
            way = np.array(place) + ahead
            axes.plot(way[:, 1], way[:, 0], color=PAPERS, lw=1.4, label="leaders" if index == 0 else None)
            axes.plot(place[1], place[0], "o", color=PAPERS, ms=5)
        axes.plot(cars.truth[:, 1], cars.truth[:, 0], color=NORTH, lw=2.0, label="follower")
        axes.plot(cars.first[:, 1], cars.first[:, 0], color=EAST, lw=1.6, label="estimate")
        paper = f" (paper {PAPER[name]:.2f} m)" if name in PAPER else ""
        dress(
            axes,
            f"{name}: A_RMS {cars.a_rms.mean():.2f} m{paper}",
            "east [m]",
            "north [m]" if name == "worst 1" else "",
        )
        axes.set(xlim=(-0.3, HALL[1] + 0.6), ylim=(0.0, HALL[0]), aspect="equal")
    finish(figure, several, f"Figure 14, simulated: cars in one run, heading bias {bias:g} deg")
    return figure


def tables_figure(study: Study) -> Figure:
    """Tables 2 and 3 as dots beside the paper's."""
    figure = Figure(figsize=(13.0, 8.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    conditions = [(1.0, 2.0), (1.0, 4.0), (1.0, 6.0), (10.0, 4.0)]
    x = np.arange(1.0, 11.0)
    for each, (speed, variance) in zip(axes.flat, conditions, strict=True):
        paper = TABLE3[variance] if speed == 1.0 else tuple(TABLE2[f][1] for f in FORMATIONS)
        each.semilogy(x, paper, "D", color=PAPERS, ms=7, label="the paper's")
        for step, (colour, marker) in OURS.items():
            found = [study.results[Key(step, speed, variance, f)]["ekf"] for f in FORMATIONS]
            shift = -0.15 if step == 1.0 else 0.15
            each.errorbar(
                x + shift, [r.a_rms for r in found], [np.nan_to_num(r.half) for r in found], ls="", marker=marker, ms=6,
                color=colour, label=f"ours, steps of {step:g} s",
            )  # fmt: skip
        bounds = [study.bound(Key(1.0, speed, variance, f)) for f in FORMATIONS]
        each.plot(x - 0.15, bounds, "_", color=BOUND, ms=16, mew=1.8, label="bound, steps of 1 s")
        dress(each, f"{speed:g} m/s, {variance:g} m²", "formation", "A_RMS [m]")
        each.set_yticks((1.0, 2.0, 5.0, 10.0, 20.0), labels=("1", "2", "5", "10", "20"))
        each.set_yticks((), minor=True)
        each.set_xticks(x)
    finish(figure, axes.ravel(), f"Tables 2 and 3: extended filter, mean of {study.runs} runs with 95 % intervals")
    return figure


def line_figure(study: Study) -> Figure:
    """Error, and what the filter claims, by the leaders' offset from the line."""
    figure = Figure(figsize=(12.0, 4.8), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for each, sides in zip(axes, SIDES, strict=True):
        traps = [study.offsets[sides, offset] for offset in OFFSETS]
        each.plot(OFFSETS, [t.rms for t in traps], "o-", color=EAST, label="rms error")
        each.plot(OFFSETS, [t.claimed for t in traps], "s--", color=NORTH, label="what the filter claims")
        each.plot(OFFSETS, [t.bound for t in traps], ":", color=BOUND, label="bound about the truth")
        each.set_xscale("symlog", linthresh=1.0)
        each.set_xticks(OFFSETS, [f"{o:g}" for o in OFFSETS])
        each.set_ylim(0.0, 9.0)
        dress(each, f"Leaders of formation 8 to {sides}", "offset from the line [m]", "position error [m]")
    finish(figure, axes, "A line a little aside: the filter settles on the mirror image, and is sure of it")
    return figure
