"""What the study of paper 5 leaves: tables as CSV, and pictures."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvsim.analysis import bound_maps
from auvsim.analysis.style import dress
from auvsim.reproduce.paper5.acceptance import verdicts
from auvsim.reproduce.paper5.checks import growth_exponent
from auvsim.reproduce.paper5.methods import TITLES, frame_model
from auvsim.reproduce.paper5.scenes import GRID
from auvsim.reproduce.paper5.study import ROWS, Study
from auvsim.reproduce.products import finish, verdict_rows, write_files
from estimators.map_path.bound_map import image_information, match_bound
from estimators.map_path.feature_map import feature_map
from estimators.map_path.likelihood import Matcher

# The marks of figure 2: truth a solid line, dead reckoning dash-dot, Bayes filtering dashed; triangles are where the
# frames of every tenth second were taken.
COLOURS = {
    "dead_reckoning": "#7f7f7f", "dp": "#1f77b4", "window": "#2c7a2c", "particles": "#9467bd", "graph": "#ff7f0e",
    "landmarks": "#8c564b", "gps_60": "#17a2a2", "gps_120": "#7f6a00",
}  # fmt: skip
SWEEPS = {
    "SNR [dB]": {-6.0: "snr_-6", 0.0: "arc", 6.0: "snr_6", 12.0: "snr_12"},
    "density [1/m$^2$]": {0.02: "density_0.02", 0.05: "density_0.05", 0.1: "arc", 0.2: "density_0.2"},
}


def write(study: Study, folder: Path) -> list[Path]:
    """Writes study.csv, acceptance.csv, growth.csv and the figures of the rows that were run.

    Raises:
        InputError: If one of them cannot be written.
    """
    tables = {"study.csv": study_rows(study), "acceptance.csv": verdict_rows(verdicts(study))}
    figures = {}
    if "drift" in study.results:
        tables["growth.csv"], figures["growth.png"] = growth_rows(study), growth_figure(study)
    if "straight" in study.tracks and "arc" in study.tracks:
        figures |= {"figure2.png": figure2(study), "map.png": map_figure(study)}
    if all(name in study.results for names in SWEEPS.values() for name in names.values()):
        figures["sweeps.png"] = sweeps_figure(study)
    return write_files(folder, tables, figures)


def study_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of study.csv: one for each row and method."""
    yield (
        "row", "title", "method", "runs", "rms_m", "end_m", "heading_rms_deg", "nees_per_dof", "ratio", "ratio_low",
        "ratio_high", "times_real_time", "frames_refused",
    )  # fmt: skip
    for name, results in study.results.items():
        for method, r in results.items():
            refused = " ".join(f"{reason}:{count}" for reason, count in sorted(r.refused.items()))
            reach = 1.96 * r.ratio_deviation
            yield (
                name, ROWS[name].title, method, study.runs[name], r.rms, r.end, math.degrees(r.heading), r.nees,
                r.ratio, r.ratio - reach, r.ratio + reach, r.speed, refused,
            )  # fmt: skip


def growth_rows(study: Study) -> Iterable[Sequence[Any]]:
    """Heading and lines of growth.csv: how each error grows with time, as t^p, and what it is in the end."""
    yield "system", "exponent", "end_m"
    for name, errors in _growths(study).items():
        yield name, growth_exponent(errors), float(errors[-1])


def _growths(study: Study) -> dict[str, np.ndarray]:
    results = study.results["drift"]
    curves = {"inertial, 0.1 mg": study.inertial, "Doppler log, 0.02 m/s, known heading": study.speed_log}
    return curves | {TITLES[m]: results[m].growth for m in results if not m.startswith("gps")}


def figure2(study: Study) -> Figure:
    """The first straight run and the first arc: truth, dead reckoning, dynamic programming and the window."""
    figure = Figure(figsize=(13.0, 6.5), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, name in zip(panels, ("straight", "arc"), strict=True):
        run, tracks = study.tracks[name]
        lines = {
            "truth": (run.poses, {"ls": "-", "color": "black", "lw": 1.6}),
            "dead reckoning": (tracks["dead_reckoning"].poses, {"ls": "-.", "color": "#d62728", "lw": 1.6}),
            "DP": (tracks["dp"].poses, {"ls": "--", "color": COLOURS["dp"], "lw": 1.6}),
            "frame to window": (tracks["window"].poses, {"ls": "--", "color": COLOURS["window"], "lw": 1.2}),
        }
        for label, (poses, style) in lines.items():
            axes.plot(poses[:, 1], poses[:, 0], label=label, **style)
        axes.plot(*run.poses[::10, 1::-1].T, "k^", ms=7, mfc="none", label="truth every 10 s")
        axes.set_aspect("equal", adjustable="datalim")
        dress(axes, ROWS[name].title, "east [m]", "north [m]")
    finish(figure, panels, f"Paper 5, figure 2: paths over 60 s, seed {study.seed}, first run")
    return figure


def growth_figure(study: Study) -> Figure:
    """Rms errors against time on logarithmic axes: a constant acceleration's grows with t^2, a speed's with t."""
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    axes = figure.subplots()
    for name, errors in _growths(study).items():
        known = name.startswith(("inertial", "Doppler"))
        style = {"ls": ":" if known else "-", "lw": 1.6, "color": None if known else COLOURS[_method(name)]}
        axes.loglog(range(1, len(errors)), errors[1:], label=f"{name}: $t^{{{growth_exponent(errors):.1f}}}$", **style)
    axes.set(xlim=(1, len(study.inertial) - 1), ylim=(1e-2, None))
    title = f"How errors grow: runs of 240 s ({study.runs['drift']}), exponents from 30 s on"
    dress(axes, title, "time [s]", "rms position error [m]")
    axes.legend(loc="upper left", fontsize=9.0)
    return figure


def _method(title: str) -> str:
    return next(method for method, each in TITLES.items() if each == title)


def sweeps_figure(study: Study) -> Figure:
    """Rms error of dynamic programming and of the window relative to dead reckoning, over SNR and density."""
    figure = Figure(figsize=(11.0, 5.5), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (label, rows) in zip(panels, SWEEPS.items(), strict=True):
        for method in ("dp", "window"):
            results = [study.results[name][method] for name in rows.values()]
            ratios = np.array([r.ratio for r in results])
            reach = np.minimum(np.nan_to_num([1.96 * r.ratio_deviation for r in results]), 0.9 * ratios)
            axes.errorbar(
                list(rows), ratios, yerr=reach, fmt="o-", ms=5, capsize=3, color=COLOURS[method], label=TITLES[method]
            )
        axes.axhline(1.0, color="#7f7f7f", ls="-.", lw=1.2, label="dead reckoning")
        axes.set(yscale="log", xticks=list(rows))
        dress(axes, "", label, "rms error / dead reckoning" if axes is panels[0] else "")
    finish(figure, panels, f"Arcs of 60 s, {study.runs['arc']} runs at 0 dB and 0.1/m$^2$: 95 % intervals")
    return figure


def map_figure(study: Study) -> Figure:
    """The feature map along the window's path of the first arc, and where matching holds on it."""
    run, tracks = study.tracks["arc"]
    model = frame_model(run.conditions)
    matcher = Matcher(GRID, model)
    by_stamp = {round(frame.stamp): frame for frame in run.frames}
    images = [matcher.prepare(by_stamp[k].intensity).values / matcher.noise_filtered for k in range(len(run.poses))]
    shown = feature_map(images, tracks["window"].poses, GRID)
    figure = Figure(figsize=(14.0, 6.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    colours = left.imshow(shown.image, origin="lower", extent=shown.extent, cmap="magma", vmin=-0.5, vmax=2.0)
    figure.colorbar(colours, ax=left, label="mean echo [standard deviations of one frame's noise]")
    poses = tracks["window"].poses
    left.plot(poses[:, 1], poses[:, 0], color="white", lw=1.4, label="path, frame to window")
    left.plot(run.poses[::10, 1], run.poses[::10, 0], "^", color="#7fdbff", ms=6, label="truth every 10 s")
    left.legend(loc="upper left", fontsize=9.0, facecolor="#555555", labelcolor="white")
    dress(left, "Feature map of the first arc, 0 dB", "east [m]", "north [m]")
    raw = feature_map([by_stamp[k].intensity for k in range(len(run.poses))], poses, GRID)
    # What is left of the noise in a mean of n frames would pass for features.
    clean = np.where(raw.counts >= 4, np.nan_to_num(raw.image), 0.0)
    bound = match_bound(image_information(clean, raw.cell, 0.5), raw.cell, GRID, model.noise)
    bound = np.where(raw.counts >= 4, bound, np.inf)
    north = raw.origin[0] + raw.cell * np.arange(bound.shape[0])
    east = raw.origin[1] + raw.cell * np.arange(bound.shape[1])
    chart = bound_maps.BoundMap(north=north[::2], east=east[::2], bound=bound[::2, ::2])
    title, quantity = "Where matching holds, by that map", "least deviation of one match, worst axis [m]"
    bound_maps.draw(right, chart, title=title, quantity=quantity)
    return figure
