"""Pictures of a trial, from its log alone: where it went (track) and what was estimated (estimates).

Figures are made without pyplot, so nothing global (backend, style, open figures) is touched.
"""

import math
import os
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvsim.analysis.style import (
    ARRIVED,
    BAND,
    BAND_EDGE,
    DOCK,
    OUTLIER,
    WATER,
    dress,
    event_ticks,
    legend,
    phase_colour,
    phase_line,
    phase_name,
    shade_phases,
)
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.base.frames import Array
from auvsim.data.log import TrialLog
from auvsim.missions.docking.dock_frame import funnel_outline, in_dock_frame, nose_position
from auvsim.missions.docking.guidance import Phase
from auvsim.missions.docking.metrics import (
    NEES_INTERVAL,
    EstimateErrors,
    Summary,
    estimate_errors,
    fixes,
    phase_at,
    summarise,
)

SIZE = (14.0, 9.0)  # [in]
DPI = 110
ZOOM = 30.0  # length of the last part in the dock's frame [m]
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
    side = _side(log)
    upper = 11.0 * side / ZOOM + 0.9  # so that the zoom, drawn to scale, fills its cell [in]
    grid = figure.add_gridspec(2, 2, width_ratios=(1.3, 1.0), height_ratios=(upper, 8.0 - upper))
    _plan(figure.add_subplot(grid[:, 0]), log)
    _zoom(figure.add_subplot(grid[0, 1]), log, side)
    _depth(figure.add_subplot(grid[1, 1]), log)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    legend(figure, dict(zip(labels, handles, strict=True)))
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
    shown = shown[np.isfinite(shown).all(axis=1)]
    low, high = shown.min(axis=0), shown.max(axis=0)
    centre, half = (low + high) / 2.0, max(0.56 * float((high - low).max()), 5.0)
    heading = log.number("dock_heading")
    course = np.array([math.sin(heading), math.cos(heading)])  # east, north
    axes.plot(*np.outer(course, (0.0, -4.0 * half)), ":", color=DOCK, lw=1.1, label="dock axis")
    walls = [wall @ np.array([course, [course[1], -course[0]]]) for wall in funnel_outline(log)]
    for wall in walls:
        axes.plot(*wall.T, color=DOCK, lw=2.0, zorder=5)
    # To scale it can be too small to see: a symbol of the same shape, mouth to the approaching vehicle.
    symbol = np.concatenate([walls[0], walls[1][::-1]])
    axes.plot(0.0, 0.0, marker=symbol, mfc="#f0d9c4", mec=DOCK, ms=26, ls="", label="dock", zorder=2)
    phase_line(axes, log, position[:, 1], position[:, 0])
    axes.plot(*estimate["position"][_usable(log), 1::-1].T, **ESTIMATE)
    axes.plot(*place[~usbl["lost"] & ~usbl["outlier"], ::-1].T, ".", color="#555555", ms=5, label="USBL fix")
    axes.plot(*place[~usbl["lost"] & usbl["outlier"], ::-1].T, "x", color=OUTLIER, ms=6, label="outlier")
    axes.plot(*position[:1, 1::-1].T, "o", color="white", mec="black", ms=9, label="start", zorder=6)
    axes.plot(*position[-1:, 1::-1].T, "s", color="black", ms=5, label="end", zorder=6)
    axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))
    axes.set_aspect("equal", adjustable="box")
    _current(axes, log, (shown - centre) / half)
    dress(axes, "Plan view", "east [m]", "north [m]")


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
    course = math.degrees(math.atan2(east, north)) % 360.0
    text = f"current {speed:.2f} m/s to {course:.0f}°" if speed > 0.0 else "no current"
    inset.set_title(text, fontsize=9.5, color=WATER, pad=3)


def _usable(log: TrialLog) -> NDArray[np.bool_]:
    """Which estimates to draw: those between the first fix and docking, when the motion is that of a free vehicle."""
    estimate = log["estimate"]
    return estimate["initialised"] & (phase_at(log, estimate["time"]) != Phase.DOCKED)


def _side(log: TrialLog) -> float:
    """How far to both sides the zoom reaches [m]: as far as the nose came while near."""
    along, cross, _ = in_dock_frame(log, nose_position(log)).T
    return min(max(1.3 * float(np.abs(cross[np.abs(along + ZOOM / 2.0) < ZOOM / 2.0]).max(initial=0.0)), 4.0), 9.0)


def _zoom(axes: Axes, log: TrialLog, side: float) -> None:
    """The nose in the dock's frame from above: entering to the right, starboard below."""
    nose, estimate = in_dock_frame(log, nose_position(log)), log["estimate"]
    heading = estimate["heading"]
    ahead = log.number("vehicle_nose") * np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=-1)
    estimated = in_dock_frame(log, estimate["position"] + ahead)[_usable(log)]
    for wall in funnel_outline(log):
        axes.plot(*wall.T, color=DOCK, lw=2.5, zorder=5)
    axes.axhline(0.0, ls=":", color=DOCK, lw=1.1)
    axes.axvline(0.0, ls=":", color="#888888", lw=1.0)
    phase_line(axes, log, nose[:, 0], nose[:, 1], width=1.8)
    axes.plot(estimated[:, 0], estimated[:, 1], marker=".", ms=4, **ESTIMATE)
    axes.set(xlim=(-ZOOM, 4.0), ylim=(side, -side))
    axes.set_aspect("equal", adjustable="box")
    dress(axes, f"The nose from above, last {ZOOM:.0f} m, starboard below", "along track [m]", "cross track [m]")


def _depth(axes: Axes, log: TrialLog) -> None:
    truth, estimate, guidance = log["truth"], log["estimate"], log["guidance"]
    seen = _usable(log)
    axes.plot(guidance["time"], guidance["depth_command"], color="#999999", lw=2.5, label="command")
    axes.axhline(log.number("dock_depth"), ls=":", color=DOCK, lw=1.3, label="dock")
    phase_line(axes, log, truth["time"], truth["position"][:, 2])
    axes.plot(estimate["time"][seen], estimate["position"][seen, 2], **ESTIMATE)
    depths = np.concatenate([truth["position"][:, 2], estimate["position"][seen, 2], [log.number("dock_depth")]])
    depths = depths[np.isfinite(depths)]
    low, high = float(depths.min()), float(depths.max())
    margin = 0.1 * (high - low) + 0.05
    axes.set(ylim=(high + margin, low - margin))
    dress(axes, "Depth (truth in the colours of the phases)", "time [s]", "depth [m]")
    handles = [line for line in axes.get_lines() if line.get_label() in ("command", "dock", "estimate")]
    axes.legend(handles=handles, loc="best", fontsize=9.5)


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
    for index, (title, unit, error, sigma) in enumerate(panels):
        axes = figure.add_subplot(grid[index // 2, index % 2], sharex=figure.axes[0] if index else None)
        _error(axes, errors, error, sigma)
        shade_phases(axes, log)
        event_ticks(axes, log)
        dress(axes, title, "", unit)
        axes.tick_params(labelbottom=index >= len(panels) - 2)
    axes = figure.add_subplot(grid[3, :], sharex=figure.axes[0])
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
    free = seen & (errors.phase != Phase.DOCKED)
    if free.any():
        # Neither the first, uninformed band nor the blows of contact and latch may flatten the rest.
        limit = max(*np.percentile(np.abs(error[free]), [99.0]), *np.percentile(2.0 * sigma[free], [90.0]), 1e-6)
        axes.set(ylim=(-1.2 * limit, 1.2 * limit))


def _nees(axes: Axes, log: TrialLog, errors: EstimateErrors) -> None:
    known = errors.initialised & (errors.nees > 0.0)
    axes.axhspan(*NEES_INTERVAL, facecolor=BAND, edgecolor=BAND_EDGE, lw=0.9)
    axes.axhline(2.0, color="#888888", lw=0.9, ls="--")
    axes.plot(errors.time[known], errors.nees[known], color="#1a1a1a", lw=1.1)
    axes.set(yscale="log", ylim=(0.01, max(30.0, 2.0 * float(errors.nees[known].max(initial=1.0)))))
    shade_phases(axes, log)
    event_ticks(axes, log)
    title = "NEES of the horizontal position: 95 % interval and mean (dashed) of 2 degrees of freedom"
    dress(axes, title, "time [s]", "NEES [-]")


def _estimates_legend(figure: Figure, log: TrialLog) -> None:
    entries: dict[str, Any] = {"error": figure.axes[0].get_lines()[0]}
    entries["±2σ claimed, 95 % interval"] = Patch(facecolor=BAND, edgecolor=BAND_EDGE)
    entries |= {"fix arrived": Patch(color=ARRIVED), "reading refused": Patch(color=OUTLIER)}
    for phase in sorted(set(log["guidance"]["phase"].tolist())):
        entries[phase_name(phase)] = Patch(color=phase_colour(phase), alpha=0.25)
    legend(figure, entries)
