"""Pictures of a trial, from its log alone: where it went (track) and what it believed (estimates).

Figures are made without pyplot, so nothing global (backend, style, open figures) is touched.
"""

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvsim.dock_frame import in_dock_frame, nose_position
from auvsim.errors import InputError
from auvsim.files import whole
from auvsim.frames import Array
from auvsim.log import PHASES, TrialLog
from auvsim.metrics import NEES_INTERVAL, EstimateErrors, Summary, estimate_errors, fixes, phase_at, summarise

SIZE = (14.0, 9.0)  # [in]
DPI = 110
ZOOM = 30.0  # length of the last part in the dock's frame [m]
PHASE_COLOURS = ("#7f7f7f", "#1f77b4", "#17a2a2", "#2ca02c", "#9467bd", "#ff7f0e", "#d62728")  # as in PHASES
NO_PHASE = "#444444"
DOCK = "#8c4a1f"
WATER = "#0055aa"
OUTLIER = "#d62728"
BAND, BAND_EDGE = (0.30, 0.45, 0.69, 0.22), "#4c72b0"
ESTIMATE: dict[str, Any] = {"color": "black", "linestyle": (0, (5, 2)), "linewidth": 1.0, "label": "estimate"}


def track(log: TrialLog, path: str | os.PathLike[str]) -> None:
    """Writes the picture of the way taken (PNG): plan view, last metres in the dock's frame, depth.

    Raises:
        InputError: if the file cannot be written.
    """
    _save(track_figure(log), path)


def estimates(log: TrialLog, path: str | os.PathLike[str]) -> None:
    """Writes the picture of the estimate's errors (PNG), with what the filter claims of them and its NEES.

    Raises:
        InputError: if the file cannot be written.
    """
    _save(estimates_figure(log), path)


def _save(figure: Figure, path: str | os.PathLike[str]) -> None:
    try:
        with whole(Path(path)) as partial:
            figure.savefig(partial, dpi=DPI, format="png")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def track_figure(log: TrialLog) -> Figure:
    """The figure that `track` writes."""
    figure = Figure(figsize=SIZE, layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.3, 1.0))
    plan = figure.add_subplot(grid[:, 0])
    _plan(plan, log)
    _zoom(figure.add_subplot(grid[0, 1]), log)
    _depth(figure.add_subplot(grid[1, 1]), log)
    figure.legend(*plan.get_legend_handles_labels(), loc="outside lower center", ncols=14, fontsize=9.5, frameon=False)
    figure.suptitle(_headline(log, summarise(log)), fontsize=13)
    return figure


def _headline(log: TrialLog, summary: Summary) -> str:
    outcome = f"docked at {summary.time:.1f} s" if summary.docked else f"not docked ({summary.failure_reason})"
    attempts = f"{summary.attempts} attempt{'' if summary.attempts == 1 else 's'}"
    miss = "" if summary.miss_distance is None else f", nose {summary.miss_distance:.2f} m off the axis at the mouth"
    return f"Trial {log.attributes['trial']}, seed {log.attributes['seed']}: {outcome}, {attempts}{miss}"


def _plan(axes: Axes, log: TrialLog) -> None:
    position, estimate, usbl, place = log["truth"]["position"], log["estimate"], log["usbl"], fixes(log)
    shown = np.concatenate([position[:, 1::-1], place[~usbl["lost"] & ~usbl["outlier"], ::-1], np.zeros((1, 2))])
    low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
    centre, half = (low + high) / 2.0, max(0.56 * float((high - low).max()), 5.0)
    heading = log.number("dock_heading")
    course = np.array([math.sin(heading), math.cos(heading)])  # east, north
    axes.plot(*np.outer(course, (0.0, -4.0 * half)), ":", color=DOCK, lw=1.1, label="dock axis")
    walls = [wall @ np.array([course, [course[1], -course[0]]]) for wall in _walls(log)]
    for wall in walls:
        axes.plot(*wall.T, color=DOCK, lw=2.0, zorder=5)
    # To scale it can be too small to see: a symbol of the same shape, mouth to the approaching vehicle.
    symbol = np.concatenate([walls[0], walls[1][::-1]])
    axes.plot(0.0, 0.0, marker=symbol, mfc="#f0d9c4", mec=DOCK, ms=26, ls="", label="dock", zorder=2)
    _coloured(axes, log, position[:, 1], position[:, 0])
    axes.plot(*estimate["position"][estimate["initialised"], 1::-1].T, **ESTIMATE)
    axes.plot(*place[~usbl["lost"] & ~usbl["outlier"], ::-1].T, ".", color="#555555", ms=5, label="USBL fix")
    axes.plot(*place[~usbl["lost"] & usbl["outlier"], ::-1].T, "x", color=OUTLIER, ms=6, label="outlier")
    axes.plot(*position[:1, 1::-1].T, "o", color="white", mec="black", ms=9, label="start", zorder=6)
    axes.plot(*position[-1:, 1::-1].T, "s", color="black", ms=5, label="end", zorder=6)
    axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))
    axes.set_aspect("equal", adjustable="box")
    _current(axes, log, (shown - centre) / half)
    _dress(axes, "Plan view", "east [m]", "north [m]")


def _current(axes: Axes, log: TrialLog, shown: Array) -> None:
    """The mean current as an arrow in the corner that the shown points, in -1..1, leave most free."""
    corners = [(x, y) for y in (-0.8, 0.8) for x in (-0.7, 0.7)]
    x, y = min(corners, key=lambda corner: int(np.sum(np.abs(shown - np.array(corner)).max(axis=1) < 0.35)))
    inset = axes.inset_axes((0.5 + 0.5 * x - 0.1, 0.5 + 0.5 * y - 0.07, 0.2, 0.14))
    inset.set_axis_off()
    inset.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0), aspect="equal")
    flow = log["truth"]["current"][:, :2]
    north, east = flow.mean(axis=0) if len(flow) else np.zeros(2)
    speed = math.hypot(north, east)
    if speed > 0.0:
        tip = 0.8 * np.array([east, north]) / speed
        arrow = {"arrowstyle": "-|>", "color": WATER, "lw": 2.2, "mutation_scale": 16}
        inset.annotate("", xy=tuple(tip), xytext=tuple(-tip), arrowprops=arrow)
    course = f" to {math.degrees(math.atan2(east, north)) % 360.0:.0f}°" if speed > 0.0 else ""
    inset.set_title(f"current {speed:.2f} m/s{course}", fontsize=9.5, color=WATER, pad=3)


def _zoom(axes: Axes, log: TrialLog) -> None:
    """The nose in the dock's frame from above: entering to the right, starboard below."""
    nose, estimate = in_dock_frame(log, nose_position(log)), log["estimate"]
    heading = estimate["heading"]
    ahead = log.number("vehicle_nose") * np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=-1)
    believed = in_dock_frame(log, estimate["position"] + ahead)[estimate["initialised"]]
    for wall in _walls(log):
        axes.plot(*wall.T, color=DOCK, lw=2.5, zorder=5)
    axes.axhline(0.0, ls=":", color=DOCK, lw=1.1)
    axes.axvline(0.0, ls=":", color="#888888", lw=1.0)
    _coloured(axes, log, nose[:, 0], nose[:, 1], width=1.8)
    axes.plot(believed[:, 0], believed[:, 1], marker=".", ms=4, **ESTIMATE)
    axes.set(xlim=(-ZOOM, 4.0), ylim=(9.0, -9.0))
    axes.set_aspect("equal", adjustable="box")
    _dress(axes, f"Nose in the dock's frame, last {ZOOM:.0f} m", "along track [m]", "cross track, to starboard [m]")


def _walls(log: TrialLog) -> tuple[Array, Array]:
    """Port and starboard outline (3, 2) of the funnel and throat: along and cross track [m]."""
    mouth, throat, cone = log.number("mouth_radius"), log.number("throat_radius"), log.number("cone_length")
    starboard = np.array([[0.0, mouth], [cone, throat], [cone + log.number("throat_length"), throat]])
    return starboard * np.array([1.0, -1.0]), starboard


def _depth(axes: Axes, log: TrialLog) -> None:
    truth, estimate, guidance = log["truth"], log["estimate"], log["guidance"]
    seen = estimate["initialised"]
    axes.plot(guidance["time"], guidance["depth_command"], color="#999999", lw=2.5, label="command")
    axes.axhline(log.number("dock_depth"), ls=":", color=DOCK, lw=1.3, label="dock")
    _coloured(axes, log, truth["time"], truth["position"][:, 2], labelled=False)
    axes.plot(estimate["time"][seen], estimate["position"][seen, 2], **ESTIMATE)
    depths = np.concatenate([truth["position"][:, 2], [log.number("dock_depth")]])
    low, high = float(np.nanmin(depths)), float(np.nanmax(depths))
    margin = 0.1 * (high - low) + 0.2
    axes.set(ylim=(high + margin, low - margin))
    axes.margins(x=0.01)
    _dress(axes, "Depth (truth in the colours of the phases)", "time [s]", "depth [m]")
    axes.legend(loc="best", fontsize=9.5)


def estimates_figure(log: TrialLog) -> Figure:
    """The figure that `estimates` writes."""
    figure = Figure(figsize=SIZE, layout="constrained")
    grid = figure.add_gridspec(4, 2)
    errors = estimate_errors(log)
    panels = (
        ("North", "error [m]", errors.position[:, 0], errors.sigma[:, 0]),
        ("East", "error [m]", errors.position[:, 1], errors.sigma[:, 1]),
        ("Heading", "error [deg]", np.degrees(errors.heading), np.degrees(errors.sigma[:, 2])),
        ("Surge through the water", "error [m/s]", errors.velocity[:, 0], errors.sigma[:, 3]),
        ("Current north", "error [m/s]", errors.current[:, 0], errors.sigma[:, 6]),
        ("Current east", "error [m/s]", errors.current[:, 1], errors.sigma[:, 7]),
    )
    first: Axes | None = None
    for index, (title, unit, error, sigma) in enumerate(panels):
        axes = figure.add_subplot(grid[index // 2, index % 2], sharex=first)
        first = first or axes
        _error(axes, errors, error, sigma)
        _shade(axes, log)
        _ticks(axes, log)
        _dress(axes, title, "", unit)
        axes.tick_params(labelbottom=index >= len(panels) - 2)
    axes = figure.add_subplot(grid[3, :], sharex=first)
    _nees(axes, log, errors)
    figure.suptitle(_consistency(log, summarise(log)), fontsize=13)
    _estimates_legend(figure, log)
    return figure


def _consistency(log: TrialLog, summary: Summary) -> str:
    quality = summary.estimate["all"]
    heading = f"Estimate minus truth, trial {log.attributes['trial']}, seed {log.attributes['seed']}"
    if quality.position_rms is None:
        return f"{heading}: never initialised"
    text = f"{heading}: horizontal rms {quality.position_rms:.2f} m"
    if quality.nees_per_dof is None or quality.coverage_95 is None:
        return text
    return (
        f"{text}, NEES per degree of freedom {quality.nees_per_dof:.2f}, {quality.coverage_95:.0%} in the 95 % ellipse"
    )


def _error(axes: Axes, errors: EstimateErrors, error: Array, sigma: Array) -> None:
    seen = errors.initialised & np.isfinite(error)
    time, band = errors.time[seen], 2.0 * sigma[seen]
    axes.fill_between(time, -band, band, facecolor=BAND, edgecolor=BAND_EDGE, lw=0.9)
    axes.plot(time, error[seen], color="#1a1a1a", lw=1.1)
    axes.axhline(0.0, color="#888888", lw=0.7)
    if seen.any():
        # A first, uninformed band must not flatten the rest.
        limit = max(float(np.percentile(np.abs(error[seen]), 99.0)), float(np.percentile(band, 95.0)), 1e-6)
        axes.set(ylim=(-1.25 * limit, 1.25 * limit))


def _nees(axes: Axes, log: TrialLog, errors: EstimateErrors) -> None:
    known = errors.initialised & (errors.nees > 0.0)
    axes.axhspan(*NEES_INTERVAL, facecolor=BAND, edgecolor=BAND_EDGE, lw=0.9)
    axes.axhline(2.0, color="#888888", lw=0.9, ls="--")
    axes.plot(errors.time[known], errors.nees[known], color="#1a1a1a", lw=1.1)
    axes.set(yscale="log", ylim=(0.01, max(30.0, 2.0 * float(errors.nees[known].max(initial=1.0)))))
    _shade(axes, log)
    _ticks(axes, log)
    title = "NEES of the horizontal position: 95 % interval and mean (dashed) of 2 degrees of freedom"
    _dress(axes, title, "time [s]", "NEES [-]")


def _ticks(axes: Axes, log: TrialLog) -> None:
    """Ticks along the lower edge: fixes when they arrived, and when the estimator refused readings."""
    usbl, estimate = log["usbl"], log["estimate"]
    arrived = usbl["received"][~usbl["lost"]]
    refused = estimate["time"][1:][np.diff(estimate["refused"]) > 0]
    for times, colour, width in ((arrived, "#2c7a2c", 1.0), (refused, OUTLIER, 2.2)):
        axes.vlines(times, 0.0, 0.07, color=colour, lw=width, transform=axes.get_xaxis_transform(), zorder=4)


def _shade(axes: Axes, log: TrialLog) -> None:
    """Colours the background by phase, over the time that the guidance logged."""
    time = log["guidance"]["time"]
    for phase, start, stop in _stretches(log["guidance"]["phase"].astype(int)):
        axes.axvspan(time[start], time[stop], color=_colour(phase), alpha=0.12, lw=0.0, zorder=0)
    if len(time):
        axes.set(xlim=(time[0], time[-1]))


def _estimates_legend(figure: Figure, log: TrialLog) -> None:
    handles: list[Any] = figure.axes[0].get_lines()[:1]
    labels = ["error"]
    handles.append(Patch(facecolor=BAND, edgecolor=BAND_EDGE))
    labels.append("±2σ claimed, 95 % interval")
    for colour, label in (("#2c7a2c", "fix arrived"), (OUTLIER, "reading refused")):
        handles.append(Patch(color=colour))
        labels.append(label)
    for phase in sorted(set(log["guidance"]["phase"].tolist())):
        handles.append(Patch(color=_colour(phase), alpha=0.25))
        labels.append(PHASES[phase].replace("_", " "))
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=9.5, frameon=False)


def _coloured(axes: Axes, log: TrialLog, x: Array, y: Array, *, labelled: bool = True, width: float = 2.2) -> None:
    """A line of the truth in the colours of the phases."""
    named: set[int] = set()
    for phase, start, stop in _stretches(phase_at(log, log["truth"]["time"])):
        label = (PHASES[phase].replace("_", " ") if phase >= 0 else "truth") if phase not in named else None
        part = slice(start, stop + 1)  # up to the next stretch, so that no gap shows
        axes.plot(x[part], y[part], color=_colour(phase), lw=width, label=label if labelled else None)
        named.add(phase)


def _stretches(phases: NDArray[Any]) -> Iterator[tuple[int, int, int]]:
    """Phase, first index and index of the next stretch's first (the last index at the end) of each run of phases."""
    if not len(phases):
        return
    starts = np.concatenate([[0], np.flatnonzero(np.diff(phases)) + 1, [len(phases) - 1]])
    for start, stop in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        if stop > start:
            yield int(phases[start]), start, stop


def _colour(phase: int) -> str:
    return PHASE_COLOURS[phase] if phase >= 0 else NO_PHASE


def _dress(axes: Axes, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=11.5)
    axes.set_xlabel(x, fontsize=10.5)
    axes.set_ylabel(y, fontsize=10.5)
    axes.tick_params(labelsize=9.5)
    axes.grid(color="#cccccc", lw=0.6)
    axes.set_axisbelow(True)
