"""The picture of a formation, from a run's log alone: stations as the point sees them, errors, bounds, who is heard."""

import os
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse as EllipsePatch

from auvsim.analysis.style import SIZE, dress, save, vehicle_colour
from auvsim.base import yaml_text
from auvsim.base.frames import Array
from auvsim.data.log import Log, VehicleLog
from auvsim.missions.formation.metrics import station_errors
from estimators.core.information import error_ellipse

ENLARGED = 10.0  # error ellipses in the plan of the formation
PROBABLE = 0.95  # that a position lies in its ellipse


def in_formation(log: Log) -> list[str]:
    """Names of the vehicles whose mission is a formation."""
    return [name for name in log.vehicles if log.vehicle(name).mission == "formation"]


def formation(log: Log, path: str | os.PathLike[str]) -> None:
    """Writes the picture (PNG).

    Raises:
        InputError: if the file cannot be written.
    """
    save(formation_figure(log), path)


def formation_figure(log: Log) -> Figure:
    """The figure that `formation` writes."""
    names = in_formation(log)
    figure = Figure(figsize=SIZE, layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.15))
    _plan(figure.add_subplot(grid[:, 0]), log, names)
    first = figure.add_subplot(grid[0, 1])
    for row, draw in enumerate((_stations, _positions, _heard)):
        axes = first if row == 0 else figure.add_subplot(grid[row, 1], sharex=first)
        draw(axes, log, names)
    first.set_xlim(0.0, max(float(log.vehicle(name)["truth"]["time"].max(initial=1.0)) for name in names))
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        entries |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    style: dict[str, Any] = {"fontsize": 9.5, "frameon": False, "columnspacing": 1.4}
    columns = (len(entries) + 1) // 2
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns, **style)
    figure.suptitle(f"Formation: trial {log.attributes['trial']}, seed {log.attributes['seed']}", fontsize=12)
    return figure


def settings(vehicle: VehicleLog) -> dict[str, Any]:
    """Settings of a vehicle's formation mission."""
    return yaml_text.read(str(vehicle.attributes["mission_settings"]), "log").value


def in_frame(values: dict[str, Any], time: Array, places: Array) -> Array:
    """Places (k, 2), north and east, as the moving point sees them: to starboard and ahead (k, 2) [m]."""
    course = np.radians(values["course_deg"])
    ahead = np.array([np.cos(course), np.sin(course)])
    away = places - np.array([values["north"], values["east"]]) - values["speed"] * time[:, None] * ahead
    return np.column_stack((away @ np.array([-ahead[1], ahead[0]]), away @ ahead))


def _plan(axes: Axes, log: Log, names: list[str]) -> None:
    ends: dict[str, Array] = {}
    for index, name in enumerate(names):
        vehicle, colour = log.vehicle(name), vehicle_colour(index)
        values, mission, truth, estimate = settings(vehicle), vehicle["mission"], vehicle["truth"], vehicle["estimate"]
        way = in_frame(values, truth["time"], truth["position"][:, :2])
        axes.plot(*way.T, color=colour, lw=1.6, label=name)
        axes.plot(mission["starboard"], mission["ahead"], "s", color=colour, mfc="none", ms=10, mew=1.6)
        ends[name] = way[-1]
        good = np.flatnonzero(estimate["initialised"])
        if not good.size:
            continue
        place = in_frame(values, estimate["time"][good[-1:]], estimate["position"][good[-1:], :2])[0]
        e = error_ellipse(estimate["covariance"][good[-1]], PROBABLE)
        angle = 90.0 - np.degrees(e.bearing) + values["course_deg"]
        size = 2.0 * ENLARGED * e.major, 2.0 * ENLARGED * e.minor
        axes.add_patch(EllipsePatch((place[0], place[1]), *size, angle=angle, fill=False, ec=colour, lw=1.5, ls="--"))
        axes.plot(*way[-1], "o", color=colour, ms=6)
    for name in names:
        for leader in settings(log.vehicle(name))["leaders"]:
            if leader in ends:
                axes.plot(*np.array([ends[name], ends[leader]]).T, ":", color="#666666", lw=1.0, label="range")
    axes.plot([], [], "s", color="#444444", mfc="none", ms=9, label="station")
    axes.plot([], [], "--", color="#444444", label=f"{PROBABLE:.0%} ellipse at the end, {ENLARGED:g} times")
    axes.set_aspect("equal", adjustable="datalim")
    dress(axes, "The formation as the moving point sees it", "to starboard [m]", "ahead [m]")


def _stations(axes: Axes, log: Log, names: list[str]) -> None:
    for index, name in enumerate(names):
        time, errors = station_errors(log.vehicle(name))
        axes.plot(time, np.hypot(errors[:, 0], errors[:, 1]), color=vehicle_colour(index), lw=1.3)
    _metres(axes)
    dress(axes, "True distance from the station", "", "distance [m]")


def _positions(axes: Axes, log: Log, names: list[str]) -> None:
    for index, name in enumerate(names):
        vehicle = log.vehicle(name)
        truth, estimate, mission = vehicle["truth"], vehicle["estimate"], vehicle["mission"]
        good = estimate["initialised"]
        time = estimate["time"][good]
        there = np.column_stack([np.interp(time, truth["time"], truth["position"][:, k]) for k in range(2)])
        error = np.hypot(*(estimate["position"][good, :2] - there).T)
        axes.plot(time, error, color=vehicle_colour(index), lw=1.2)
        if settings(vehicle)["leaders"]:
            claimed = np.sqrt(np.trace(estimate["covariance"][good, :2, :2], axis1=1, axis2=2))
            axes.plot(time, claimed, "--", color=vehicle_colour(index), lw=1.2, label="rms that its filter claims")
            bound = np.where(np.isfinite(mission["bound"]), mission["bound"], np.nan)
            axes.plot(mission["time"], bound, ":", color="black", lw=1.8, label="bound it assumes")
    _metres(axes)
    dress(axes, "Error of the estimated position", "", "error [m]")


def _heard(axes: Axes, log: Log, names: list[str]) -> None:
    most = 1
    for index, name in enumerate(names):
        leaders = settings(log.vehicle(name))["leaders"]
        if leaders:
            mission = log.vehicle(name)["mission"]
            axes.step(mission["time"], mission["heard"], where="post", color=vehicle_colour(index), lw=1.6)
            most = max(most, len(leaders))
    axes.set_ylim(-0.2, most + 0.3)
    axes.set_yticks(range(most + 1))
    dress(axes, "Leaders that are not silent", "time [s]", "leaders")


def _metres(axes: Axes) -> None:
    """An axis of distances from centimetres to hundreds of metres, linear up to 1 m."""
    axes.set_yscale("symlog", linthresh=1.0)
    top = max(axes.get_ylim()[1], 2.0)
    axes.set_ylim(0.0, top)
    ticks = [tick for tick in (0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0) if tick <= top]
    axes.set_yticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axes.set_yticks((), minor=True)
