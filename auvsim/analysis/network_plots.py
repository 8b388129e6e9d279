"""The picture of a run in which vehicles talk: who hears whom and when, and what that does to their estimates."""

import os
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from auvsim.acoustics.channel import DELIVERED
from auvsim.acoustics.modems import UNDER_WAY
from auvsim.analysis.estimates import estimate_errors
from auvsim.analysis.heard import heard_vehicles, relative_to
from auvsim.analysis.style import BAND, BAND_EDGE, SIZE, dress, legend, save, vehicle_colour
from auvsim.data.log import Log
from auvsim.data.variables import ROOT_TABLES

SIGMAS = 2.0  # of the bounds
MOST = 4  # vehicles whose errors are drawn
LOST = ("#d62728", "#ff7f0e", "#8c564b", "#9467bd", "#444444", "#e377c2")  # colours of reasons, in their order
FIXED = ("#444444", "#b8860b", "#5f9ea0")  # colours of what docks and beacons send, in their order
NEUTRAL = "#888888"  # of a legend's entry that stands for several colours
SHOWN = 98.0  # percentile of what an axis of errors shows


def talks(log: Log) -> bool:
    """Whether any vehicle has a modem."""
    return any("received" in log.vehicle(name) for name in log.vehicles)


def packets(log: Log) -> dict[str, np.ndarray]:
    """Rows of the packets of modems, which are not those of a dock's USBL."""
    rows = log.groups["network/messages"]
    assert rows.keys() == ROOT_TABLES["network/messages"].keys()
    kept = rows["kind"] != "usbl"
    return {name: values[kept] for name, values in rows.items()}


def network(log: Log, path: str | os.PathLike[str]) -> None:
    """Writes the picture (PNG): errors of each vehicle with bounds, and packets on a time line.

    Raises:
        InputError: if the file cannot be written.
    """
    save(network_figure(log), path)


def network_figure(log: Log) -> Figure:
    """The figure that `network` writes."""
    names = [name for name in log.vehicles if "received" in log.vehicle(name)]
    lines = [*names, *sorted({*packets(log)["source"].tolist()} - {*names})]  # those of docks and beacons last
    drawn = names[:MOST]
    figure = Figure(figsize=(SIZE[0], 2.3 * len(drawn) + 1.6 + 0.45 * len(lines)), layout="constrained")
    grid = figure.add_gridspec(len(drawn) + 1, 2, height_ratios=[2.3] * len(drawn) + [1.2 + 0.45 * len(lines)])
    end = max(float(log.vehicle(name)["truth"]["time"].max(initial=1.0)) for name in names)
    relative: dict[str, Any] = {}
    for row, name in enumerate(drawn):
        relative |= _errors([figure.add_subplot(grid[row, k]) for k in range(2)], log, name, end)
    line = figure.add_subplot(grid[len(drawn), :])
    entries = relative | _time_line(line, log, lines)
    line.set_xlim(0.0, end)
    legend(figure, entries)
    rows = packets(log)
    heard, decided = int((rows["fate"] == DELIVERED).sum()), int((rows["fate"] != UNDER_WAY).sum())
    run = f"Trial {log.attributes['trial']}, seed {log.attributes['seed']}"
    figure.suptitle(f"{run}: {heard} of {decided} packets received", fontsize=11.5)
    return figure


def _errors(both: list[Axes], log: Log, name: str, end: float) -> dict[str, Any]:
    """Errors north and east of a vehicle's estimate, their bounds by its covariance, and errors relative to others.

    Returns:
        Entries of the legend.
    """
    entries: dict[str, Any] = {}
    others = [(other, relative_to(log.vehicle(name), other)) for other in heard_vehicles(log.vehicle(name))]
    errors = estimate_errors(log.vehicle(name))
    seen = errors.initialised & np.isfinite(errors.position).all(axis=1)
    for k, (axes, axis) in enumerate(zip(both, ("north", "east"), strict=True)):
        time, error, bound = errors.time[seen], errors.position[seen, k], SIGMAS * errors.sigma[seen, k]
        axes.fill_between(time, -bound, bound, color=BAND, lw=0.0)
        axes.plot(time, bound, color=BAND_EDGE, lw=0.8)
        axes.plot(time, -bound, color=BAND_EDGE, lw=0.8)
        axes.plot(time, error, color=vehicle_colour(list(log.vehicles).index(name)), lw=1.3)
        for other, found in others:
            colour = vehicle_colour(list(log.vehicles).index(other))
            (line,) = axes.plot(found.time, found.error[:, k], color=colour, lw=1.0, ls=(0, (4, 2)))
            entries[f"relative to {other}"] = line
        both_sides = np.abs(np.concatenate([error, bound])) if len(time) else np.ones(1)
        most = 1.25 * max(float(np.percentile(both_sides, SHOWN)), 1e-3)
        axes.set(xlim=(0.0, end), ylim=(-most, most))
        kind = log.vehicle(name).attributes["estimator"]
        dress(axes, f"{name} ({kind}): error {axis}, bounds of {SIGMAS:g} sd", "", "error [m]")
    return entries


def _colour(log: Log, name: str) -> str:
    """Of a vehicle, or of what is none."""
    if name in log.vehicles:
        return vehicle_colour(log.vehicles.index(name))
    others = sorted({*packets(log)["source"].tolist()} - {*log.vehicles})
    return FIXED[others.index(name) % len(FIXED)] if name in others else NEUTRAL


def _time_line(axes: Axes, log: Log, names: list[str]) -> dict[str, Any]:
    """A line for each modem: above it what it sends, on it what it hears of whom, below what it loses, by reason."""
    rows, entries = packets(log), {}
    reasons = sorted({*rows["fate"].tolist()} - {DELIVERED, UNDER_WAY})
    for number, name in enumerate(names):
        axes.axhline(number, color="#bbbbbb", lw=0.8, zorder=1)
        sent = np.unique(rows["time"][rows["source"] == name])
        style: dict[str, Any] = {"color": _colour(log, name), "lw": 1.2}
        axes.vlines(sent, number - 0.42, number - 0.12, **style)
        entries.setdefault("sent", Line2D([], [], color=NEUTRAL, lw=1.2, marker="|", ls="", ms=9))
        mine = rows["destination"] == name
        good = mine & (rows["fate"] == DELIVERED)
        for source in names:
            of_it = rows["received"][good & (rows["source"] == source)]
            axes.plot(of_it, np.full(len(of_it), number), "o", color=_colour(log, source), ms=4, ls="")
        entries["heard, in the sender's colour"] = Line2D([], [], marker="o", color=NEUTRAL, ms=4, ls="")
        for index, reason in enumerate(reasons):
            bad = mine & (rows["fate"] == reason)
            colour = LOST[index % len(LOST)]
            (crosses,) = axes.plot(rows["time"][bad], np.full(bad.sum(), number + 0.24), "x", color=colour, ms=6, ls="")
            count = int((rows["fate"] == reason).sum())
            entries[f"lost: {reason} ({count})"] = crosses
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.6)
    dress(axes, "Packets: above each line sent, on it heard, below it lost", "time [s]", "")
    return entries
