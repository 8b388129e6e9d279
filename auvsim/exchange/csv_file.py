"""A log as CSV with the columns that `auvsim identify` and `auvsim estimate` read, each sensor with its own times."""

import csv
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.data.log import Log, VehicleLog
from auvsim.identification import log_records
from auvsim.identification.signals import Signal
from auvsim.simulation import scenario
from auvsim.simulation.scenario_settings import VehicleSettings
from auvsim.vehicles import library, model_files

_DVL = {"ground_surge [m/s]": 0, "ground_sway [m/s]": 1, "surge [m/s]": 3, "sway [m/s]": 4}


def write(log: Log, path: Path) -> list[Path]:
    """Writes FILE.csv, of several vehicles FILE.NAME.csv each; numbers as they are, bit for bit. Returns the files.

    Raises:
        InputError: A vehicle has no readings of its actuators.
    """
    with model_files.given(log.models):
        plan = scenario.from_yaml(str(log.attributes["scenario"]), "scenario of the log")
        tables = {name: dict(_columns(log.vehicle(name), plan.vehicles[name])) for name in log.vehicles}
    written = []
    for name, columns in tables.items():
        target = path if len(tables) == 1 else path.with_name(f"{path.stem}.{name}{path.suffix}")
        _write(target, columns)
        written.append(target)
    return written


def _columns(log: VehicleLog, plan: VehicleSettings) -> Iterator[tuple[str, Any]]:
    """Columns (n,) by header; a group's times stand before it."""
    if "feedback" not in log or len(log["feedback"]["time"]) < 2:
        raise InputError(f"'{log.name}' has no readings of its actuators in the log: CSV needs `sensors.feedback`")
    feedback = log["feedback"]
    actuation = library.vehicle(plan.model).actuation
    yield "time [s]", feedback["time"]
    demands = np.array([actuation.effective(row) for row in feedback["value"].tolist()], dtype=float)
    for k, demand in enumerate(actuation.demands):
        # The force that thrusters are to give in surge is no velocity.
        name = demand.name if demand.name in ("rudder", "elevator", "shaft_speed") else f"demand_{demand.name}"
        yield f"{name} [{demand.units}]", demands[:, k]
    if plan.mission.kind == "manoeuvre":
        yield "manoeuvre", _parts(plan, feedback["time"])
    if "command" in log and "rudder" in log["command"]:
        yield "time_rudder_command [s]", log["command"]["time"]
        yield "rudder_command [rad]", log["command"]["rudder"]
    if "compass" in log:
        yield "time_compass [s]", log["compass"]["time"]
        yield from zip(("heading [rad]", "pitch [rad]", "roll [rad]"), log["compass"]["value"].T, strict=True)
    if "gyro" in log:
        yield "time_gyro [s]", log["gyro"]["time"]
        yield "yaw_rate [rad/s]", log["gyro"]["value"][:, 2]
    if "dvl" in log:
        yield "time_dvl [s]", log["dvl"]["time"]
        yield from ((header, log["dvl"]["value"][:, k]) for header, k in _DVL.items())
    if "depth" in log:
        yield "time_depth [s]", log["depth"]["time"]
        yield "depth [m]", log["depth"]["value"][:, 0]
    yield from _places(log, plan)


def _parts(plan: VehicleSettings, times: Any) -> list[str]:
    """The manoeuvre at each time."""
    parts = log_records.parts(plan, "")
    return [next(kind for _, kind, start, stop in reversed(parts) if t >= start) for t in times.tolist()]


def _places(log: VehicleLog, plan: VehicleSettings) -> Iterator[tuple[str, Any]]:
    """Positions of the body's origin, by the dock's USBL or, without it, by fixes from elsewhere."""
    places, stamps = np.empty((0, 2)), np.empty(0)
    if "compass" in log:
        compass = log["compass"]
        heading = Signal(times=compass["time"], values=np.unwrap(compass["value"][:, 0]))
        places, stamps, _ = log_records.places(log, heading, plan.sensors.usbl.transponder)
    if len(stamps) < 2 and "fix" in log:
        places, stamps = log["fix"]["value"], log["fix"]["time"]
    if len(stamps):
        yield "time_position [s]", stamps
        yield from zip(("north [m]", "east [m]"), places.T, strict=True)


def _write(path: Path, columns: dict[str, Sequence[Any]]) -> None:
    """Columns side by side, short ones with empty cells at their end."""
    count = max(len(values) for values in columns.values())
    cells = [[*map(_cell, values), *[""] * (count - len(values))] for values in columns.values()]
    with whole(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*cells, strict=True))


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return value
    return "" if math.isnan(value) else repr(float(value))
