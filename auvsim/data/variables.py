"""Variables of a log: the tables of its groups, to which sensors, missions, vehicles and estimators add their own.

A group of a log is a table of variables that share the axis `time`. The tables of this file hold for every vehicle;
`vehicle_groups` completes them by what one vehicle's parts say of themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from auvsim.base.errors import InputError

DTYPES = ("float64", "int8", "int32", "bool", "str", "category")


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of a log group, without its leading axis `time`.

    `str` is free text. `category` is text from a small set, too: arrays of a log hold the text itself, its file a code
    for each row and the texts once, since ten thousand texts would outweigh all else in the file.
    """

    dimensions: tuple[str, ...]  # names of the axes after time
    dtype: str  # one of DTYPES
    units: str  # where there are labels, either one for all or one for each, separated by ", "
    long_name: str
    frame: str = ""
    flags: tuple[str, ...] = ()  # meanings of the values 0, 1, ...
    labels: tuple[str, ...] = ()  # names along the last dimension

    @property
    def text(self) -> bool:
        """Whether the values are texts."""
        return self.dtype in ("str", "category")

    @property
    def array_type(self) -> np.dtype[Any]:
        """Type of the arrays that hold the values: texts are Python objects."""
        return np.dtype(object if self.text else self.dtype)


Table = Mapping[str, Variable]

SIZES: Mapping[str, int] = MappingProxyType(  # dimensions of one size everywhere
    {"ned": 3, "wxyz": 4, "rpy": 3, "uvwpqr": 6, "uvr": 3, "north_east": 2}
)


@dataclass(frozen=True, slots=True)
class Group:
    """Table of a group, `time` included, and the sizes of those dimensions that SIZES does not know."""

    table: Table
    sizes: Mapping[str, int] = field(default_factory=dict)

    def shape(self, rows: int, name: str) -> tuple[int, ...]:
        """Shape of a variable's array with a number of rows."""
        return (rows, *(size_of(dimension, self.sizes) for dimension in self.table[name].dimensions))


def size_of(dimension: str, sizes: Mapping[str, int]) -> int:
    """Size of a dimension, by SIZES or by a group's own sizes.

    Raises:
        InputError: if neither knows it.
    """
    size = SIZES.get(dimension, sizes.get(dimension))
    if size is None:
        raise InputError(f"no size is given for the dimension '{dimension}' of a log group")
    return size


TIME: Table = {"time": Variable((), "float64", "s", "simulated time")}

TRUTH: Table = {
    **TIME,
    "position": Variable(("ned",), "float64", "m", "north, east, down of the body origin", "NED"),
    "quaternion": Variable(("wxyz",), "float64", "1", "attitude quaternion w, x, y, z", "body to NED"),
    "attitude": Variable(("rpy",), "float64", "rad", "roll, pitch, yaw", "body to NED"),
    "nu": Variable(("uvwpqr",), "float64", "m/s, rad/s", "velocity over ground u, v, w, p, q, r", "body"),
    "current": Variable(("ned",), "float64", "m/s", "water velocity at the body origin", "NED"),
    "actuators": Variable(("channel",), "float64", "rad, rad/s", "fin angles, then shaft speeds, by channel"),
}

ESTIMATE: Table = {
    **TIME,
    "mean": Variable(("state",), "float64", "SI", "mean of the estimated state"),
    "covariance": Variable(
        ("state", "state_column"), "float64", "SI", "covariance of the estimated state; 0 where not estimated"
    ),
    "position": Variable(("ned",), "float64", "m", "estimated north, east, down", "NED"),
    "heading": Variable((), "float64", "rad", "estimated heading, clockwise from north", "NED"),
    "velocity": Variable(("uvr",), "float64", "m/s, rad/s", "estimated velocity through the water u, v, r", "body"),
    "current": Variable(("north_east",), "float64", "m/s", "estimated water velocity north, east", "NED"),
    "initialised": Variable((), "bool", "1", "whether the estimate rests on a position fix"),
    "refused": Variable((), "int32", "1", "measurements refused so far"),
}

MEASUREMENTS: Table = {
    "time": Variable((), "float64", "s", "when the estimator decided"),
    "sensor": Variable((), "category", "", "sensor or source of the measurement"),
    "stamp": Variable((), "float64", "s", "when the measurement was true"),
    "sequence": Variable((), "int32", "1", "its sequence number; -1 if it has none"),
    "accepted": Variable((), "bool", "1", "whether the estimator used it"),
    "reason": Variable((), "category", "", "why it was refused; empty if it was used"),
    "nis": Variable((), "float64", "1", "normalised innovation squared; NaN if it was not tested"),
}

MISSION: Table = {
    **TIME,
    "phase": Variable((), "int8", "1", "phase of the mission"),
    "heading_setpoint": Variable((), "float64", "rad", "heading asked of the controller", "NED"),
    "depth_setpoint": Variable((), "float64", "m", "depth asked of the controller", "NED"),
    "speed_setpoint": Variable((), "float64", "m/s", "speed through the water asked of the controller"),
}

COMMAND: Table = {**TIME}  # and a variable for each demand of the vehicle's actuation

CONTACT: Table = {
    **TIME,
    "force": Variable((), "float64", "N", "magnitude of the contact force, friction included"),
    "impulse": Variable((), "float64", "N s", "integral of that magnitude over time so far"),
    "other": Variable((), "category", "", "what the vehicle touches; empty if unknown"),
}

READING: Table = {  # columns of every sensor; `value` and the sensor's own join them
    "time": Variable((), "float64", "s", "stamp: when the reading was true"),
    "received": Variable((), "float64", "s", "when the reading arrived; NaN if it was lost"),
    "sequence": Variable((), "int32", "1", "count of this sensor's readings, lost ones included"),
}

EVENT: Table = {
    **TIME,
    "vehicle": Variable((), "category", "", "vehicle that it concerns; empty for the run as a whole"),
    "kind": Variable((), "category", "", "kind of the event"),
    "text": Variable((), "str", "", "what happened"),
}

MESSAGES: Table = {
    "time": Variable((), "float64", "s", "when the message was sent"),
    "received": Variable((), "float64", "s", "when the message arrived; NaN if it was lost"),
    "source": Variable((), "category", "", "sender"),
    "destination": Variable((), "category", "", "receiver"),
    "kind": Variable((), "category", "", "kind of the message"),
    "bits": Variable((), "int32", "bit", "size of the message"),
    "fate": Variable((), "category", "", "delivered, or why not"),
}

PAYLOAD = 32  # numbers of a message's payload that a log holds

RECEIVED: Table = {  # of a vehicle with a modem
    "time": Variable((), "float64", "s", "when the modem handed the message over"),
    "source": Variable((), "category", "", "sender"),
    "destination": Variable((), "category", "", "whom it was for; empty: all"),
    "kind": Variable((), "category", "", "kind of the message"),
    "sequence": Variable((), "int32", "1", "its sequence number, by the sender"),
    "answers": Variable((), "int32", "1", "sequence number of the request that it answers; -1 if none"),
    "stamp": Variable((), "float64", "s", "when it was sent, by the sender's clock"),
    "arrived": Variable((), "float64", "s", "when its first wave front arrived, by the receiver's clock"),
    "range": Variable((), "float64", "m", "range by travel time; NaN if none was measured"),
    "bearing": Variable((), "float64", "rad", "bearing from the bow; NaN if none was measured", "body"),
    "bits": Variable((), "int32", "bit", "size of the message"),
    "numbers": Variable((), "int32", "1", "numbers in its payload"),
    "payload": Variable(("number",), "float64", "SI", "these numbers, then NaN"),
}

MODELS: Table = {  # a row for each model of the run; logs may lack the group
    **TIME,
    "kind": Variable((), "category", "", "vehicle or structure"),
    "model": Variable((), "str", "", "its name or path, as the scenario has it"),
    "sha256": Variable((), "str", "", "of the text"),
    "text": Variable((), "str", "", "its MJCF file when the run began"),
}

VEHICLE_TABLES: Mapping[str, Table] = {  # groups that every vehicle has, by their names below it
    "truth": TRUTH,
    "estimate": ESTIMATE,
    "measurements": MEASUREMENTS,
    "mission": MISSION,
    "command": COMMAND,
    "contact": CONTACT,
}
ROOT_TABLES: Mapping[str, Table] = {"event": EVENT, "network/messages": MESSAGES}
OPTIONAL_TABLES: Mapping[str, Table] = {"models": MODELS}


def sensor_table(variables: Table) -> Table:
    """Table of a sensor's group: time, received, value, sequence, then the sensor's own columns.

    Args:
        variables: `value` and the sensor's own columns, which `Recorder.reading` takes in this order.
    """
    own = {name: variable for name, variable in variables.items() if name != "value"}
    return {
        "time": READING["time"],
        "received": READING["received"],
        "value": variables["value"],
        "sequence": READING["sequence"],
        **own,
    }


def vehicle_groups(
    *,
    sensors: Mapping[str, tuple[Table, Mapping[str, int]]],
    mission: tuple[Sequence[str], Table],
    demands: Table,
    channels: Mapping[str, str],
    states: Mapping[str, str],
    modem: bool = False,
) -> dict[str, Group]:
    """Groups of one vehicle by their paths below it: `truth`, `sensors/compass`, ...

    Args:
        sensors: By instance name, the variables of a sensor (`value` and its own) and the sizes of their dimensions.
        mission: Phases in the order of their values 0, 1, ..., and the mission's own variables.
        demands: Variables of what the controller asks of the actuation.
        channels: Units of the actuators by channel, in their order.
        states: Units of the estimated states by name, in their order.
        modem: Whether the vehicle has one.
    """
    phases, variables = mission
    phase = replace(MISSION["phase"], flags=tuple(phases))
    actuators = replace(TRUTH["actuators"], labels=tuple(channels), units=", ".join(channels.values()))
    mean = replace(ESTIMATE["mean"], labels=tuple(states), units=", ".join(states.values()))
    covariance = replace(ESTIMATE["covariance"], labels=tuple(states))
    size = {"state": len(states), "state_column": len(states)}
    return {
        "truth": Group({**TRUTH, "actuators": actuators}, {"channel": len(channels)}),
        "estimate": Group({**ESTIMATE, "mean": mean, "covariance": covariance}, size),
        "measurements": Group(MEASUREMENTS),
        "mission": Group({**MISSION, "phase": phase, **variables}),
        "command": Group({**COMMAND, **demands}),
        "contact": Group(CONTACT),
        **({"received": Group(RECEIVED, {"number": PAYLOAD})} if modem else {}),
        **{f"sensors/{name}": Group(sensor_table(table), sizes) for name, (table, sizes) in sensors.items()},
    }


def run_groups(vehicles: Mapping[str, Mapping[str, Group]]) -> dict[str, Group]:
    """Groups of a whole run by path, of each vehicle's groups (by its name) and of the run itself."""
    own = {f"vehicles/{name}/{path}": group for name, groups in vehicles.items() for path, group in groups.items()}
    return own | {path: Group(table) for path, table in {**ROOT_TABLES, **OPTIONAL_TABLES}.items()}
