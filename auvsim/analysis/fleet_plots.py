"""The picture of a run of several vehicles, from its log alone: all tracks, phases, depths and errors on one page."""

import os
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from auvsim.analysis import plan_view
from auvsim.analysis.estimates import estimate_errors
from auvsim.analysis.plots import depth_limits, outcome
from auvsim.analysis.style import SIZE, dress, legend, phase_colour, phase_name, save, vehicle_colour
from auvsim.data.log import Log
from auvsim.data.phases import phase_stretches

ESTIMATE: dict[str, Any] = {"ls": (0, (5, 2)), "lw": 1.0}
MOST_TOLD = 6  # vehicles whose results stand in the title
LEAST_NAMED = 0.06  # part of the time that a phase must take for its name to be written into its bar


def fleet(log: Log, path: str | os.PathLike[str]) -> None:
    """Writes the picture of all vehicles (PNG): plan view with the docks, phases, depths, errors of the estimates.

    Raises:
        InputError: if the file cannot be written.
    """
    save(fleet_figure(log), path)


def fleet_figure(log: Log) -> Figure:
    """The figure that `fleet` writes."""
    figure = Figure(figsize=SIZE, layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.15, 1.0))
    _plan(figure.add_subplot(grid[:, 0]), log)
    time = None
    for row, draw in enumerate((_phases, _depths, _errors)):
        time = figure.add_subplot(grid[row, 1], sharex=time)
        draw(time, log)
        time.set_xlim(0.0, _end(log))
    entries: dict[str, Any] = {
        name: Line2D([], [], color=vehicle_colour(i), lw=2.2) for i, name in enumerate(log.vehicles)
    }
    plan = dict(zip(*reversed(figure.axes[0].get_legend_handles_labels()), strict=True))
    entries |= {"estimate": Line2D([], [], color="black", **ESTIMATE)}
    legend(figure, entries | {name: plan[name] for name in ("start", "end", "dock", "dock axis") if name in plan})
    run = f"Trial {log.attributes['trial']}, seed {log.attributes['seed']}"
    results = [f"{name}: {outcome(log.vehicle(name))}" for name in log.vehicles[:MOST_TOLD]]
    figure.suptitle("\n".join([f"{run}, {len(log.vehicles)} vehicles", *results]), fontsize=11.5)
    return figure


def _end(log: Log) -> float:
    return max(float(log.vehicle(name)["truth"]["time"].max(initial=1.0)) for name in log.vehicles)


def _plan(axes: Axes, log: Log) -> None:
    docks = [log.structure(name) for name in log.structures]
    tracks = [log.vehicle(name)["truth"]["position"] for name in log.vehicles]
    shown = plan_view.window(
        axes, *(track[:, 1::-1] for track in tracks), *(dock.position[None, 1::-1] for dock in docks)
    )
    plan_view.draw_docks(axes, docks)
    for index, (name, track) in enumerate(zip(log.vehicles, tracks, strict=True)):
        colour, estimate = vehicle_colour(index), log.vehicle(name)["estimate"]
        axes.plot(*track[:, 1::-1].T, color=colour, lw=2.2)
        axes.plot(*estimate["position"][estimate["initialised"], 1::-1].T, color="black", **ESTIMATE)
        names = (None, None) if index else ("start", "end")
        axes.plot(*track[:1, 1::-1].T, "o", color="white", mec=colour, ms=9, label=names[0], zorder=6)
        axes.plot(*track[-1:, 1::-1].T, "s", color=colour, ms=6, label=names[1], zorder=6)
        for place in track[:1, 1::-1]:
            style: dict[str, Any] = {"color": colour, "fontsize": 10.5, "fontweight": "bold", "zorder": 7}
            axes.annotate(name, tuple(place), (8, 8), textcoords="offset points", **style)
    plan_view.draw_current(axes, np.concatenate([log.vehicle(n)["truth"]["current"] for n in log.vehicles]), shown)


def _phases(axes: Axes, log: Log) -> None:
    """A bar for each vehicle, in the colours of its phases, with their names where there is room."""
    for row, name in enumerate(log.vehicles):
        vehicle = log.vehicle(name)
        mission = vehicle["mission"]
        for phase, start, stop in phase_stretches(mission["phase"].astype(int)):
            begin, length = mission["time"][start], mission["time"][stop] - mission["time"][start]
            axes.barh(row, length, left=begin, height=0.7, color=phase_colour(vehicle.phases, phase), alpha=0.75)
            if length > LEAST_NAMED * _end(log):
                text = phase_name(vehicle.phases, phase)
                axes.text(
                    begin + length / 2.0, row, text, ha="center", va="center", fontsize=9, color="white", clip_on=True
                )
    axes.set_yticks(range(len(log.vehicles)), log.vehicles)
    axes.invert_yaxis()
    dress(axes, "Phases of the missions", "", "")


def _depths(axes: Axes, log: Log) -> None:
    depths = []
    for index, name in enumerate(log.vehicles):
        truth = log.vehicle(name)["truth"]
        axes.plot(truth["time"], truth["position"][:, 2], color=vehicle_colour(index), lw=1.6)
        depths.append(truth["position"][:, 2])
    depth_limits(axes, *depths)
    dress(axes, "Depth", "", "depth [m]")


def _errors(axes: Axes, log: Log) -> None:
    """Horizontal distance of each estimate from the truth."""
    for index, name in enumerate(log.vehicles):
        errors = estimate_errors(log.vehicle(name))
        seen = errors.initialised & np.isfinite(errors.position).all(axis=1)
        axes.plot(errors.time[seen], np.hypot(*errors.position[seen, :2].T), color=vehicle_colour(index), lw=1.1)
    axes.set_ylim(bottom=0.0)
    dress(axes, "Horizontal error of the estimate", "time [s]", "error [m]")
