"""The trial log: one table of what is logged, and one NetCDF-4 file a trial.

`python -m auvsim.data.log` prints the table.
"""

import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.data import netcdf
from auvsim.missions.docking.guidance import Phase

FORMAT_VERSION = 2  # 1 knew neither `dvl` nor `gyro`; `read` gives it both, empty
STATUSES = ("complete", "diverged", "interrupted")
PHASES = tuple(phase.name.lower() for phase in Phase)  # flag values 0, 1, ...

Groups = dict[str, dict[str, NDArray[Any]]]


@dataclass(frozen=True, slots=True)
class Variable:
    """One line of the table: what a variable holds."""

    dimensions: tuple[str, ...]  # after time
    dtype: str  # float64, int8, int32, bool or str
    units: str
    long_name: str
    frame: str = ""
    flags: tuple[str, ...] = ()  # meanings of the values 0, 1, ...


SIZES: dict[str, int | None] = {  # None: as many as the vehicle has
    "ned": 3,
    "wxyz": 4,
    "rpy": 3,
    "uvwpqr": 6,
    "fin": None,
    "uvr": 3,
    "north_east": 2,
    "state": 8,
    "state_column": 8,
    "heading_pitch_roll": 3,
    "down": 1,
    "fins_and_shaft": None,
    "packet": 7,
    "over_ground_and_through_water": 6,
    "pqr": 3,
}

_TIME = {"time": Variable((), "float64", "s", "simulated time")}


def _sensor(dimension: str, units: str, long_name: str, frame: str) -> dict[str, Variable]:
    """The variables of one sensor's group."""
    return {
        "time": Variable((), "float64", "s", "stamp: when the reading was true"),
        "received": Variable((), "float64", "s", "when the reading arrived; NaN if it was lost"),
        "value": Variable((dimension,), "float64", units, long_name, frame),
        "sequence": Variable((), "int32", "1", "count of this sensor's readings, lost ones included"),
    }


TABLE: dict[str, dict[str, Variable]] = {
    "truth": _TIME
    | {
        "position": Variable(("ned",), "float64", "m", "north, east, down of the body origin", "NED"),
        "quaternion": Variable(("wxyz",), "float64", "1", "attitude quaternion w, x, y, z", "body to NED"),
        "attitude": Variable(("rpy",), "float64", "rad", "roll, pitch, yaw", "body to NED"),
        "nu": Variable(("uvwpqr",), "float64", "m/s, rad/s", "velocity over ground u, v, w, p, q, r", "body"),
        "current": Variable(("ned",), "float64", "m/s", "water velocity at the body origin", "NED"),
        "fins": Variable(("fin",), "float64", "rad", "fin angles, in the order of the allocation", "fin hinges"),
        "shaft_speed": Variable((), "float64", "rad/s", "propeller shaft speed"),
    },
    "estimate": _TIME
    | {
        "position": Variable(("ned",), "float64", "m", "estimated north, east, down", "NED"),
        "heading": Variable((), "float64", "rad", "estimated heading, clockwise from north", "NED"),
        "velocity": Variable(("uvr",), "float64", "m/s, rad/s", "estimated velocity through the water u, v, r", "body"),
        "current": Variable(("north_east",), "float64", "m/s", "estimated water velocity north, east", "NED"),
        "covariance": Variable(
            ("state", "state_column"),
            "float64",
            "SI",
            "covariance of north, east, heading, u, v, r, current north, current east; 0 where not estimated",
        ),
        "refused": Variable((), "int32", "1", "readings refused so far"),
        "initialised": Variable((), "bool", "1", "whether the estimate rests on a position fix"),
    },
    "guidance": _TIME
    | {
        "phase": Variable((), "int8", "1", "phase of the docking", flags=PHASES),
        "attempt": Variable((), "int8", "1", "number of the docking attempt, from 1"),
        "heading_command": Variable((), "float64", "rad", "commanded heading", "NED"),
        "depth_command": Variable((), "float64", "m", "commanded depth", "NED"),
        "speed_command": Variable((), "float64", "m/s", "commanded speed through the water"),
        "along_track": Variable((), "float64", "m", "estimated distance along the dock axis, < 0 before", "dock"),
        "cross_track": Variable((), "float64", "m", "estimated distance to starboard of the dock axis", "dock"),
    },
    "command": _TIME
    | {
        "rudder": Variable((), "float64", "rad", "commanded rudder, positive turns to starboard", "body"),
        "elevator": Variable((), "float64", "rad", "commanded elevator, positive dives", "body"),
        "shaft_speed": Variable((), "float64", "rad/s", "commanded propeller shaft speed"),
    },
    "compass": _sensor("heading_pitch_roll", "rad", "heading, pitch, roll", "body to NED"),
    "depth": _sensor("down", "m", "depth", "NED"),
    "feedback": _sensor("fins_and_shaft", "rad, rad/s", "fin angles, shaft speed", "fin hinges"),
    "usbl": _sensor(
        "packet",
        "m, rad",
        "transponder x, y, z [m]; dock heading, pitch, roll [rad]; dock depth [m]",
        "dock",
    )
    | {
        "lost": Variable((), "bool", "1", "whether the packet never arrived"),
        "outlier": Variable((), "bool", "1", "whether the fix was drawn as an outlier"),
    },
    "dvl": _sensor(
        "over_ground_and_through_water",
        "m/s",
        "velocity over ground u, v, w, then through the water u, v, w; NaN where that track is lost",
        "body",
    ),
    "gyro": _sensor("pqr", "rad/s", "angular velocity p, q, r", "body"),
    "contact": _TIME
    | {
        "force": Variable((), "float64", "N", "magnitude of the normal contact force"),
        "impulse": Variable((), "float64", "N s", "normal contact impulse so far"),
    },
    "event": _TIME
    | {
        "kind": Variable((), "str", "", "kind of the event"),
        "text": Variable((), "str", "", "what happened"),
    },
}

REQUIRED_ATTRIBUTES = {
    "format_version": "version of this layout",
    "status": "complete, diverged or interrupted",
    "scenario": "the full scenario as YAML",
    "seed": "seed of the random streams",
    "trial": "number of the trial under that seed",
    "dock_depth": "depth of the mouth's centre [m], below the origin of NED",
    "dock_heading": "course of a vehicle that enters the dock [rad]",
    "vehicle_nose": "how far the nose is forward of the body origin [m]",
}
OPTIONAL_ATTRIBUTES: dict[str, tuple[float, str]] = {  # default, meaning; for drawings
    "transceiver_forward": (0.0, "place of the USBL transceiver in the dock's frame [m]"),
    "transceiver_starboard": (0.0, "place of the USBL transceiver in the dock's frame [m]"),
    "transceiver_down": (0.0, "place of the USBL transceiver in the dock's frame [m]"),
    "mouth_radius": (0.75, "radius of the dock's mouth [m]"),
    "throat_radius": (0.15, "radius of the throat behind the funnel [m]"),
    "cone_length": (1.03923, "length of the funnel from mouth to throat [m]"),
    "throat_length": (0.6, "length of the throat [m]"),
}
# What may differ between two runs of the same trial.
WALL_TIME = "wall_time"  # duration of the run [s]
VERSIONS = {f"{package}_version": package for package in ("auvsim", "mujoco", "numpy", "numba")}


@dataclass(frozen=True, slots=True)
class TrialLog:
    """One trial as arrays, each with time as its first axis, and the attributes that describe it."""

    groups: Groups
    attributes: dict[str, str | int | float]

    def __getitem__(self, group: str) -> dict[str, NDArray[Any]]:
        """The variables of a group."""
        return self.groups[group]

    def number(self, attribute: str) -> float:
        """A numeric attribute; an optional one that was not given has its default."""
        default = OPTIONAL_ATTRIBUTES.get(attribute, (math.nan, ""))[0]
        return float(self.attributes.get(attribute, default))


def check(log: TrialLog, where: str) -> None:
    """Raises InputError, naming `where`, unless the log has every attribute, group, variable and shape of the table."""
    for name, meaning in REQUIRED_ATTRIBUTES.items():
        if name not in log.attributes:
            raise InputError(f"{where}: no attribute '{name}' ({meaning})")
    if log.attributes["format_version"] != FORMAT_VERSION:
        raise InputError(f"{where}: log format {log.attributes['format_version']}; this auvsim reads 1 and 2")
    for group, variables in TABLE.items():
        if group not in log.groups:
            raise InputError(f"{where}: no group '{group}'; a trial log has {', '.join(TABLE)}")
        for name, variable in variables.items():
            if name not in log[group]:
                raise InputError(f"{where}: no variable '{group}/{name}'")
            shape = log[group][name].shape
            wanted = (len(log[group]["time"]), *(SIZES[dimension] for dimension in variable.dimensions))
            if len(shape) != len(wanted) or any(w is not None and s != w for s, w in zip(shape, wanted, strict=True)):
                text = ", ".join("any" if size is None else str(size) for size in wanted)
                raise InputError(f"{where}: '{group}/{name}' has shape {shape}, not ({text})")


def write(log: TrialLog, path: str | os.PathLike[str]) -> None:
    """Writes the log as NetCDF-4, whole or not at all.

    Raises:
        InputError: if the log does not fit the table, or the file cannot be written.
    """
    check(log, str(path))
    netcdf.save(path, _fields(log), log.attributes)


def pack(log: TrialLog) -> bytes:
    """What the file of a log holds, to be written elsewhere."""
    return netcdf.pack(_fields(log), log.attributes)


def read(path: str | os.PathLike[str]) -> TrialLog:
    """Reads a log.

    Raises:
        InputError: if there is no such file, or it is not a whole log of this format.
    """
    groups, attributes = netcdf.load(path)
    if attributes.get("format_version") == 1:
        attributes["format_version"] = FORMAT_VERSION
        groups |= {group: _empty(group) for group in ("dvl", "gyro")}
    log = TrialLog(groups, attributes)
    check(log, str(path))
    return log


def differences(a: TrialLog, b: TrialLog) -> list[str]:
    """Names of the variables and attributes that are not the same bit for bit, wall-clock times and versions apart."""
    names = (a.attributes.keys() | b.attributes.keys()) - {WALL_TIME, *VERSIONS}
    found = [name for name in sorted(names) if a.attributes.get(name) != b.attributes.get(name)]
    for group, variables in TABLE.items():
        found += [f"{group}/{name}" for name in variables if not _same(a[group][name], b[group][name])]
    return found


def table_markdown() -> str:
    """The table as Markdown, for the documentation."""
    lines = ["Attributes of the file:", "", "| attribute | meaning |", "| --- | --- |"]
    lines += [f"| {name} | {meaning} |" for name, meaning in REQUIRED_ATTRIBUTES.items()]
    lines += [f"| {name} | {text}; {value:.4g} if absent |" for name, (value, text) in OPTIONAL_ATTRIBUTES.items()]
    lines += [f"| {WALL_TIME} | duration of the run [s] |", f"| {', '.join(VERSIONS)} | versions of the packages |"]
    for group, variables in TABLE.items():
        lines += ["", f"Group `{group}`:", "", "| variable | dimensions | type | units | frame | meaning |"]
        lines.append("| --- | --- | --- | --- | --- | --- |")
        for name, variable in variables.items():
            sizes = [f"{d} ({SIZES[d] or 'of the vehicle'})" for d in variable.dimensions]
            meaning = variable.long_name
            if variable.flags:
                meaning += ": " + ", ".join(f"{value} {flag}" for value, flag in enumerate(variable.flags))
            cells = (name, ", ".join(["time", *sizes]), variable.dtype, variable.units, variable.frame, meaning)
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _fields(log: TrialLog) -> dict[str, dict[str, netcdf.Field]]:
    """The variables of a log as NetCDF has them."""
    return {
        group: {
            name: netcdf.Field(("time", *variable.dimensions), log[group][name], _description(variable))
            for name, variable in variables.items()
        }
        for group, variables in TABLE.items()
    }


def _description(variable: Variable) -> dict[str, str | NDArray[Any]]:
    """The NetCDF attributes of a variable (flags as in the CF conventions, section 3.5)."""
    texts = {"units": variable.units, "long_name": variable.long_name, "frame": variable.frame}
    texts = {name: text for name, text in texts.items() if text}
    if not variable.flags:
        return {**texts}
    return {
        **texts,
        "flag_values": np.arange(len(variable.flags), dtype=variable.dtype),
        "flag_meanings": " ".join(variable.flags),
    }


def _empty(group: str) -> dict[str, NDArray[Any]]:
    """The variables of a group in which nothing was logged."""
    return {
        name: np.zeros((0, *(SIZES[dimension] or 0 for dimension in variable.dimensions)), dtype=variable.dtype)
        for name, variable in TABLE[group].items()
    }


def _same(a: NDArray[Any], b: NDArray[Any]) -> bool:
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    return a.tolist() == b.tolist() if a.dtype == object else a.tobytes() == b.tobytes()


if __name__ == "__main__":
    print(table_markdown())
