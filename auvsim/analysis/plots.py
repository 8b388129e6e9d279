"""Pictures of one vehicle's run, from its log alone: where it went (track) and what it estimated (estimates).

Figures are made without pyplot, so nothing global (backend, style, open figures) is touched.
"""

import os
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvsim.analysis import plan_view
from auvsim.analysis.estimates import (
    AT_REST,
    NEES_INTERVAL,
    EstimateErrors,
    EstimateQuality,
    estimate_errors,
    estimate_quality,
    fixes,
    refusals,
)
from auvsim.analysis.style import (
    ARRIVED,
    BAND,
    BAND_EDGE,
    DOCK,
    OUTLIER,
    SIZE,
    dress,
    event_ticks,
    legend,
    phase_colour,
    phase_line,
    phase_name,
    refused_fixes,
    save,
    shade_phases,
)
from auvsim.analysis.summary import summarise
from auvsim.base.frames import Array
from auvsim.data.log import StructureLog, VehicleLog
from auvsim.data.phases import phase_at
from auvsim.missions.docking.dock_frame import funnel_outline, in_dock_frame, nose_position

ZOOM = 30.0  # length of the last part in the dock's frame [m]
ESTIMATE: dict[str, Any] = {"color": "black", "linestyle": (0, (5, 2)), "linewidth": 1.0, "label": "estimate"}


def track(log: VehicleLog, path: str | os.PathLike[str]) -> None:
    """Writes the picture of a vehicle's track (PNG): plan view, last metres in its dock's frame, depth.

    Raises:
        InputError: if the file cannot be written.
    """
    save(track_figure(log), path)


def estimates(log: VehicleLog, path: str | os.PathLike[str]) -> None:
    """Writes the picture of the estimate's errors (PNG), with what the filter claims of them and its NEES.

    Raises:
        InputError: if the file cannot be written.
    """
    save(estimates_figure(log), path)


def track_figure(log: VehicleLog) -> Figure:
    """The figure that `track` writes."""
    figure = Figure(figsize=SIZE, layout="constrained")
    dock = log.structure
    side = _side(log, dock) if dock else 8.0
    upper = 11.0 * side / ZOOM + 0.9  # so that the zoom, drawn to scale, fills its cell [in]
    grid = figure.add_gridspec(2, 2, width_ratios=(1.3, 1.0), height_ratios=(upper, 8.0 - upper))
    _plan(figure.add_subplot(grid[:, 0]), log)
    if dock:
        _zoom(figure.add_subplot(grid[0, 1]), log, dock, side)
    elif "cross_track" in log["mission"]:
        _cross_track(figure.add_subplot(grid[0, 1]), log)
    _depth(figure.add_subplot(grid[1, 1] if len(figure.axes) > 1 else grid[:, 1]), log, dock)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    legend(figure, dict(zip(labels, handles, strict=True)))
    figure.suptitle(f"T{which_run(log)[1:]}: {outcome(log)}", fontsize=13)
    return figure


def which_run(log: VehicleLog) -> str:
    """Number and seed of the run, and which of several vehicles it is."""
    run = f"trial {log.log.attributes['trial']}, seed {log.log.attributes['seed']}"
    return run if len(log.log.vehicles) == 1 else f"{run}, {log.name}"


def outcome(log: VehicleLog) -> str:
    """What a vehicle's mission came to, in a line."""
    values = summarise(log)
    if "docked" in values:
        docked = values["docked"]
        text = f"docked at {values['time']:.1f} s" if docked else f"not docked ({values['failure_reason']})"
        miss = values["miss_distance"]
        off = "" if miss is None else f", nose {miss:.2f} m off the axis at the mouth"
        return f"{text}, {values['attempts']} attempt{'' if values['attempts'] == 1 else 's'}{off}"
    if "waypoints" in values:
        text = "track finished" if values["finished"] else f"track not finished ({values['status']})"
        rms = values["cross_track_rms"]
        return text if rms is None else f"{text}, {rms:.2f} m rms off its legs"
    return f"{log.mission} ({values['status']})"


def _plan(axes: Axes, log: VehicleLog) -> None:
    position, estimate, place = log["truth"]["position"], log["estimate"], fixes(log)
    docks = plan_view.docks_of(log)
    lost, outlier = (log["usbl"][name] for name in ("lost", "outlier")) if len(place) else np.zeros((2, 0), dtype=bool)
    shown = plan_view.window(
        axes, position[:, 1::-1], place[~lost & ~outlier, ::-1], *(dock.position[None, 1::-1] for dock in docks)
    )
    plan_view.draw_docks(axes, docks)
    phase_line(axes, log, position[:, 1], position[:, 0])
    axes.plot(*estimate["position"][_while_moving(log), 1::-1].T, **ESTIMATE)
    axes.plot(*place[~lost & ~outlier, ::-1].T, ".", color="#555555", ms=5, label="USBL fix")
    axes.plot(*place[~lost & outlier, ::-1].T, "x", color=OUTLIER, ms=6, label="outlier")
    refused_fixes(axes, log, place[:, ::-1])
    axes.plot(*position[:1, 1::-1].T, "o", color="white", mec="black", ms=9, label="start", zorder=6)
    axes.plot(*position[-1:, 1::-1].T, "s", color="black", ms=5, label="end", zorder=6)
    plan_view.draw_current(axes, log["truth"]["current"], shown)


def _while_moving(log: VehicleLog) -> NDArray[np.bool_]:
    """Which estimates to draw: those between the first fix and docking, when the motion is that of a free vehicle."""
    estimate = log["estimate"]
    docked = log.phases.index(AT_REST) if AT_REST in log.phases else -2
    return estimate["initialised"] & (phase_at(log, estimate["time"]) != docked)


def _side(log: VehicleLog, dock: StructureLog) -> float:
    """How far to both sides the zoom reaches [m]: as far as the nose came while near."""
    along, cross, _ = in_dock_frame(dock, nose_position(log)).T
    return min(max(1.3 * float(np.abs(cross[np.abs(along + ZOOM / 2.0) < ZOOM / 2.0]).max(initial=0.0)), 4.0), 9.0)


def _zoom(axes: Axes, log: VehicleLog, dock: StructureLog, side: float) -> None:
    """The nose in the dock's frame from above: entering to the right, starboard below."""
    nose, estimate = in_dock_frame(dock, nose_position(log)), log["estimate"]
    heading = estimate["heading"]
    ahead = log.number("nose") * np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=-1)
    estimated = in_dock_frame(dock, estimate["position"] + ahead)[_while_moving(log)]
    for wall in funnel_outline(dock):
        axes.plot(*wall.T, color=DOCK, lw=2.5, zorder=5)
    axes.axhline(0.0, ls=":", color=DOCK, lw=1.1)
    axes.axvline(0.0, ls=":", color="#888888", lw=1.0)
    phase_line(axes, log, nose[:, 0], nose[:, 1], width=1.8)
    axes.plot(estimated[:, 0], estimated[:, 1], marker=".", ms=4, **ESTIMATE)
    axes.set(xlim=(-ZOOM, 4.0), ylim=(side, -side))
    axes.set_aspect("equal", adjustable="box")
    dress(axes, f"The nose from above, last {ZOOM:.0f} m, starboard below", "along track [m]", "cross track [m]")


def _cross_track(axes: Axes, log: VehicleLog) -> None:
    mission = log["mission"]
    axes.plot(mission["time"], mission["cross_track"], color="#1a1a1a", lw=1.1)
    axes.axhline(0.0, color="#888888", lw=0.7)
    dress(axes, "Distance to starboard of the leg, as estimated", "time [s]", "cross track [m]")


def _depth(axes: Axes, log: VehicleLog, dock: StructureLog | None) -> None:
    truth, estimate, mission = log["truth"], log["estimate"], log["mission"]
    seen = _while_moving(log)
    axes.plot(mission["time"], mission["depth_setpoint"], color="#999999", lw=2.5, label="command")
    depths = [truth["position"][:, 2], estimate["position"][seen, 2], mission["depth_setpoint"]]
    if dock:
        axes.axhline(dock.position[2], ls=":", color=DOCK, lw=1.3, label="dock")
        depths = [*depths[:2], dock.position[2:]]
    phase_line(axes, log, truth["time"], truth["position"][:, 2])
    axes.plot(estimate["time"][seen], estimate["position"][seen, 2], **ESTIMATE)
    depth_limits(axes, *depths)
    dress(axes, "Depth (truth in the colours of the phases)", "time [s]", "depth [m]")
    handles = [line for line in axes.get_lines() if line.get_label() in ("command", "dock", "estimate")]
    axes.legend(handles=handles, loc="best", fontsize=9.5)


def depth_limits(axes: Axes, *depths: Array) -> None:
    """Limits round depths, which increase downward."""
    known = np.concatenate(depths)
    known = known[np.isfinite(known)]
    low, high = float(known.min(initial=np.inf)), float(known.max(initial=-np.inf))
    if low <= high:
        margin = 0.1 * (high - low) + 0.05
        axes.set(ylim=(high + margin, low - margin))


def estimates_figure(log: VehicleLog) -> Figure:
    """The figure that `estimates` writes."""
    figure = Figure(figsize=SIZE, layout="constrained")
    errors = estimate_errors(log)
    panels = [
        ("North", "error [m]", errors.position[:, 0], errors.sigma[:, 0]),
        ("East", "error [m]", errors.position[:, 1], errors.sigma[:, 1]),
        ("Heading", "error [deg]", np.degrees(errors.heading), np.degrees(errors.sigma[:, 2])),
        ("Surge through the water", "error [m/s]", errors.velocity[:, 0], errors.sigma[:, 3]),
        ("Current north", "error [m/s]", errors.current[:, 0], errors.sigma[:, 6]),
        ("Current east", "error [m/s]", errors.current[:, 1], errors.sigma[:, 7]),
    ]
    if not (np.nan_to_num(log["estimate"]["current"]).any() or errors.sigma[:, 6:].any()):
        del panels[4:]  # it knows of no current
    panels = [panel for panel in panels if np.isfinite(panel[2][errors.initialised]).any()] or panels[:2]
    rows = (len(panels) + 1) // 2
    grid = figure.add_gridspec(rows + 1, 2)
    free = _while_moving(log)
    for index, (title, unit, error, sigma) in enumerate(panels):
        axes = figure.add_subplot(grid[index // 2, index % 2], sharex=figure.axes[0] if index else None)
        _error(axes, errors, error, sigma, free)
        shade_phases(axes, log)
        event_ticks(axes, log)
        dress(axes, title, "", unit)
        axes.tick_params(labelbottom=index >= len(panels) - 2)
    axes = figure.add_subplot(grid[rows, :], sharex=figure.axes[0])
    _nees(axes, log, errors)
    consistency = _consistency(estimate_quality(errors, log.phases)["all"])
    figure.suptitle(f"Estimate minus truth, {which_run(log)}: {consistency}", fontsize=13)
    _estimates_legend(figure, log)
    return figure


def _consistency(quality: EstimateQuality) -> str:
    if quality.position_rms is None:
        return "never initialised"
    text = f"horizontal rms {quality.position_rms:.2f} m"
    if quality.nees_per_dof is None or quality.coverage_95 is None:
        return text
    return (
        f"{text}, NEES per degree of freedom {quality.nees_per_dof:.2f}, {quality.coverage_95:.0%} in the 95 % ellipse"
    )


def _error(axes: Axes, errors: EstimateErrors, error: Array, sigma: Array, free: NDArray[np.bool_]) -> None:
    seen = errors.initialised & np.isfinite(error)
    time, band = errors.time[seen], 2.0 * sigma[seen]
    jumps = np.abs(np.diff(band))  # where most are large, the band would be all edge
    edge = 0.9 if len(band) < 2 or np.percentile(jumps, 90.0) < 0.05 * np.median(band) else 0.0
    axes.fill_between(time, -band, band, facecolor=BAND, edgecolor=BAND_EDGE, lw=edge)
    axes.plot(time, error[seen], color="#1a1a1a", lw=1.1)
    axes.axhline(0.0, color="#888888", lw=0.7)
    free = seen & free
    if free.any():
        # Neither the first, uninformed band nor the blows of contact and latch may flatten the rest.
        limit = max(*np.percentile(np.abs(error[free]), [99.0]), *np.percentile(2.0 * sigma[free], [90.0]), 1e-6)
        axes.set(ylim=(-1.2 * limit, 1.2 * limit))


def _nees(axes: Axes, log: VehicleLog, errors: EstimateErrors) -> None:
    known = errors.initialised & (errors.nees > 0.0)
    axes.axhspan(*NEES_INTERVAL, facecolor=BAND, edgecolor=BAND_EDGE, lw=0.9)
    axes.axhline(2.0, color="#888888", lw=0.9, ls="--")
    axes.plot(errors.time[known], errors.nees[known], color="#1a1a1a", lw=1.1)
    axes.set(yscale="log", ylim=(0.01, max(30.0, 2.0 * float(errors.nees[known].max(initial=1.0)))))
    shade_phases(axes, log)
    event_ticks(axes, log)
    title = "NEES of the horizontal position: 95 % interval and mean (dashed) of 2 degrees of freedom"
    dress(axes, title, "time [s]", "NEES [-]")


def _estimates_legend(figure: Figure, log: VehicleLog) -> None:
    _, reasons = refusals(log)
    refused = ", ".join(reason.replace("_", " ") for reason in reasons)
    entries: dict[str, Any] = {"error": figure.axes[0].get_lines()[0]}
    entries["±2σ claimed, 95 % interval"] = Patch(facecolor=BAND, edgecolor=BAND_EDGE)
    entries["fix arrived"] = Patch(color=ARRIVED)
    entries[f"refused: {refused}" if refused else "reading refused"] = Patch(color=OUTLIER)
    for phase in sorted(set(log["mission"]["phase"].tolist())):
        entries[phase_name(log.phases, phase)] = Patch(color=phase_colour(log.phases, phase), alpha=0.25)
    legend(figure, entries)
