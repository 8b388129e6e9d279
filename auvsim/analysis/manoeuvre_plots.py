"""The picture of a manoeuvre, from its log alone: track, heading, rudder, yaw rate and surge, true and measured."""

import os
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from auvsim.analysis.style import DOCK, SIZE, WATER, dress, legend, save
from auvsim.base.errors import InputError
from auvsim.data.log import VehicleLog
from auvsim.missions.docking.dock_frame import to_body
from auvsim.missions.manoeuvres import metrics as manoeuvre_metrics
from auvsim.missions.manoeuvres.settings import SpiralSettings

TRUTH: dict[str, Any] = {"color": "#1a1a1a", "lw": 1.2, "label": "true"}
MEASURED: dict[str, Any] = {"color": "#4c72b0", "ls": "", "marker": ".", "ms": 2.0, "alpha": 0.5, "label": "measured"}
COMMAND: dict[str, Any] = {"color": "#c44e52", "lw": 1.2, "label": "commanded"}
HEADLINES = {  # figures that stand in the title
    "zigzag": ("first_overshoot_deg", "second_overshoot_deg", "period"),
    "circle": ("advance", "tactical_diameter", "steady_diameter"),
    "spiral": ("slope", "loop_deg"),
}


def manoeuvre(log: VehicleLog, path: str | os.PathLike[str]) -> None:
    """Writes the picture of a manoeuvre (PNG).

    Raises:
        InputError: the vehicle did something else, the log holds nothing, or the file cannot be written.
    """
    save(manoeuvre_figure(log), path)


def manoeuvre_figure(log: VehicleLog) -> Figure:
    """The figure that `manoeuvre` writes."""
    parts = manoeuvre_metrics.parts(log)
    if not len(log["truth"]["time"]):
        raise InputError("nothing was logged of this manoeuvre: there is nothing to draw")
    figure = Figure(figsize=SIZE, layout="constrained")
    grid = figure.add_gridspec(4, 2, width_ratios=(1.0, 1.25))
    spirals = [part for part in parts if isinstance(part.settings, SpiralSettings)]
    _track(figure.add_subplot(grid[:2, 0] if spirals else grid[:, 0]), log)
    if spirals:
        _spirals(figure.add_subplot(grid[2:, 0]), log)
    panels = (("Heading", "[deg]", _heading), ("Rudder", "[deg]", _rudder))
    panels += (("Yaw rate", "[deg/s]", _yaw_rate), ("Surge through the water", "[m/s]", _surge))
    axes: Axes | None = None
    for row, (title, unit, draw) in enumerate(panels):
        axes = figure.add_subplot(grid[row, 1], sharex=axes)
        draw(axes, log)
        for start, settings in parts:
            axes.axvline(start + settings.approach, color="#888888", lw=0.9, ls=":")
        dress(axes, title, "time [s]" if row == len(panels) - 1 else "", unit)
        axes.tick_params(labelbottom=row == len(panels) - 1)
        axes.set(xlim=(0.0, float(log["truth"]["time"].max(initial=1.0))))
    entries = {"commanded": Line2D([], [], **COMMAND), "true": Line2D([], [], **TRUTH)}
    legend(figure, {**entries, "measured": Line2D([], [], **{**MEASURED, "ms": 7.0})})
    figure.suptitle(_headline(log), fontsize=13)
    return figure


def _headline(log: VehicleLog) -> str:
    told = []
    for found in manoeuvre_metrics.figures(log):
        numbers = {key: found.numbers.get(key) for key in HEADLINES.get(found.kind, ())}
        text = ", ".join(
            f"{manoeuvre_metrics.LABELS[key].replace(' [', f' {value:.3g} [')}".replace("[", "").replace("]", "")
            for key, value in numbers.items()
            if value is not None
        )
        told.append(f"{found.kind}: {text}" if text else found.kind)
    run = log.log.attributes
    return f"Seed {run['seed']}, trial {run['trial']}: {'; '.join(told) or 'approach only'}"


def _track(axes: Axes, log: VehicleLog) -> None:
    """The track from its start, over ground and, where there is a current, through the water."""
    truth = log["truth"]
    place = truth["position"][:, :2] - truth["position"][:1, :2]
    axes.plot(*place[:, ::-1].T, **{**TRUTH, "label": "over ground", "lw": 1.6})
    if np.abs(truth["current"][:, :2]).max(initial=0.0) > 0.0:
        carried = np.cumsum(truth["current"][1:, :2] * np.diff(truth["time"])[:, None], axis=0)
        through = place[1:] - carried
        axes.plot(*through[:, ::-1].T, color=WATER, lw=1.2, ls="--", label="through the water")
    for start, settings in manoeuvre_metrics.parts(log):
        at = int(np.searchsorted(truth["time"], start + settings.approach))
        if at < len(place):
            label = "end of approach" if start == 0.0 else None
            axes.plot(*place[at, ::-1], "o", color="white", mec=DOCK, ms=8, label=label, zorder=5)
    axes.set_aspect("equal", adjustable="datalim")
    dress(axes, "Track", "east of the start [m]", "north of the start [m]")
    axes.legend(loc="best", fontsize=9.5)


def _spirals(axes: Axes, log: VehicleLog) -> None:
    for start, settings in manoeuvre_metrics.parts(log):
        if not isinstance(settings, SpiralSettings):
            continue
        begin = start + settings.approach
        moved = manoeuvre_metrics.motion(log, begin, start + settings.duration)
        curve = np.degrees(manoeuvre_metrics.spiral_curve(settings, moved))
        middle = len(settings.rudders_deg) // 2
        axes.plot(*curve[: middle + 1].T, "o-", color="#c44e52", ms=5, label="to port")
        axes.plot(*curve[middle:].T, "x--", color="#4c72b0", ms=6, label="back to starboard")
    dress(axes, "Spiral: steady yaw rate", "rudder [deg]", "yaw rate [deg/s]")
    axes.legend(loc="best", fontsize=9.5)


def _heading(axes: Axes, log: VehicleLog) -> None:
    truth, compass, mission = log["truth"], log["compass"], log["mission"]
    heading = np.unwrap(truth["attitude"][:, 2])
    measured = np.unwrap(np.concatenate([heading[:1], compass["value"][:, 0]]))[1:]  # in the turn of the truth
    axes.plot(compass["time"], np.degrees(measured), **MEASURED)
    axes.plot(truth["time"], np.degrees(heading), **TRUTH)
    course = np.degrees(mission["heading_setpoint"])
    near = np.interp(mission["time"], truth["time"], np.degrees(heading))
    axes.plot(mission["time"], course + 360.0 * np.round((near - course) / 360.0), **COMMAND)


def _rudder(axes: Axes, log: VehicleLog) -> None:
    command = log["command"]
    axes.step(command["time"], np.degrees(command["rudder"]), where="post", **COMMAND)


def _yaw_rate(axes: Axes, log: VehicleLog) -> None:
    truth, gyro = log["truth"], log["gyro"]
    axes.plot(gyro["time"], np.degrees(gyro["value"][:, 2]), **MEASURED)
    axes.plot(truth["time"], np.degrees(truth["nu"][:, 5]), **TRUTH)


def _surge(axes: Axes, log: VehicleLog) -> None:
    truth, dvl, mission = log["truth"], log["dvl"], log["mission"]
    through = truth["nu"][:, :3] - to_body(truth["quaternion"], truth["current"])
    axes.plot(dvl["time"], dvl["value"][:, 3], **MEASURED)
    axes.plot(truth["time"], through[:, 0], **TRUTH)
    axes.step(mission["time"], mission["speed_setpoint"], where="post", **COMMAND)
    spread = np.concatenate([through[:, 0], mission["speed_setpoint"]])
    axes.set(ylim=(spread.min() - 0.15, spread.max() + 0.15))  # room for the noise
