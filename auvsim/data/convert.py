"""Logs of formats 1 and 2 as format 3: one vehicle and one dock, whose mouth was below the origin of NED.

Format 1 knew neither DVL nor gyro. Both had the phases of docking and of manoeuvres in one list of flags, and the
estimate of eight states without their mean.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.data.attributes import FORMAT_VERSION
from auvsim.data.fields import empty, field_of
from auvsim.data.netcdf import Content, Field
from auvsim.data.variables import (
    CONTACT,
    ESTIMATE,
    EVENT,
    MEASUREMENTS,
    MESSAGES,
    MISSION,
    READING,
    TRUTH,
    Group,
    Table,
)

SENSORS = ("compass", "depth", "feedback", "usbl", "dvl", "gyro")
STATES = {
    "north": "m", "east": "m", "heading": "rad", "surge": "m/s", "sway": "m/s", "yaw_rate": "rad/s",
    "current_north": "m/s", "current_east": "m/s",
}  # fmt: skip
DOCKING_PHASES = ("search", "homing", "approach", "final", "docked", "go_around", "aborted")
MANOEUVRE = 7  # the phase that followed those of docking
SETPOINTS = {f"{name}_command": f"{name}_setpoint" for name in ("heading", "depth", "speed")}
TRANSCEIVER = ("transceiver_forward", "transceiver_starboard", "transceiver_down")
# What logs did not say of a dock in the first versions (throat_length in none), and how it was drawn then.
DOCK = {"mouth_radius": 0.75, "throat_radius": 0.15, "cone_length": 1.03923, "throat_length": 0.6}
RUN = ("status", "scenario", "seed", "trial")
OTHERS = ("dock_depth", "dock_heading", "vehicle_nose")

Columns = Mapping[str, NDArray[Any]]


def converted(found: Content, where: str) -> Content:
    """The content of a log as format 3 has it; one of format 3 as it is.

    Args:
        found: What the file holds.
        where: Names the file in errors.

    Raises:
        InputError: for another format, and for an old log that lacks something or whose shapes do not fit.
    """
    version = found.attributes.get("", {}).get("format_version")
    if version is None:
        raise InputError(f"{where}: no attribute 'format_version'; it is no log of auvsim")
    if not isinstance(version, int) or not 1 <= version <= FORMAT_VERSION:
        raise InputError(f"{where}: log format {version}; this auvsim reads 1 to {FORMAT_VERSION}")
    return found if version == FORMAT_VERSION else _Old(found, where).content()


class _Old:
    """A log of format 1 or 2 during its conversion."""

    def __init__(self, found: Content, where: str) -> None:
        self.found, self.where = found, where
        self.attributes = found.attributes[""]
        for name in (*RUN, *OTHERS):
            if name not in self.attributes:
                raise InputError(f"{where}: no attribute '{name}', which a log of formats 1 and 2 has")
        scenario = yaml_text.read(str(self.attributes["scenario"]), f"{where}: scenario").value
        self.scenario = scenario if isinstance(scenario, Mapping) else {}
        self.vehicle = Path(str(self._setting("vehicle", "model") or "vehicle")).stem
        self.dock = Path(str(self._setting("dock", "model") or "dock")).stem

    def content(self) -> Content:
        """All of it in format 3."""
        manoeuvre = bool(self.scenario.get("manoeuvre")) or MANOEUVRE in self._fields("guidance")["phase"].values
        own = {
            "truth": self._truth(),
            "estimate": self._estimate(),
            "measurements": empty(Group(MEASUREMENTS)),
            "mission": self._mission(manoeuvre),
            "command": dict(self._fields("command")),
            "contact": self._described(CONTACT, self._values("contact") | {"other": self._repeated("contact", "")}),
            **{f"sensors/{name}": self._sensor(name) for name in SENSORS if name in self.found.groups},
        }
        event = self._described(EVENT, self._values("event") | {"vehicle": self._repeated("event", self.vehicle)})
        groups = {f"vehicles/{self.vehicle}/{name}": fields for name, fields in own.items()}
        groups |= {"event": event, "network/messages": empty(Group(MESSAGES))}
        return Content(groups, self._attributes(manoeuvre))

    def _attributes(self, manoeuvre: bool) -> dict[str, dict[str, Any]]:
        old = self.attributes
        moved = {*OTHERS, *TRANSCEIVER, *DOCK}
        run = {name: value for name, value in old.items() if name not in moved}
        vehicle = {
            "model": self.vehicle,
            "nose": old["vehicle_nose"],
            "estimator": str(self._setting("estimator", "factory") or ""),
            "controller": "torpedo",
            "mission": "manoeuvre" if manoeuvre else "docking",
            "dock": self.dock,
        }
        place = {"model": self.dock, "north": 0.0, "east": 0.0}
        place |= {"depth": old["dock_depth"], "heading": old["dock_heading"]}
        shape = {name: old.get(name, default) for name, default in DOCK.items()}
        transceiver = {name: old[name] for name in TRANSCEIVER if name in old}
        return {
            "": run | {"format_version": FORMAT_VERSION},
            f"vehicles/{self.vehicle}": vehicle,
            f"structures/{self.dock}": place | shape | transceiver,
        }

    def _setting(self, *path: str) -> Any:
        """A value of the scenario by its path, None if it is not there."""
        value: Any = self.scenario
        for name in path:
            value = value.get(name) if isinstance(value, Mapping) else None
        return value

    def _truth(self) -> dict[str, Field]:
        values = self._values("truth", fins=2, shaft_speed=1)
        fins, shaft = values.pop("fins"), values.pop("shaft_speed")
        count = fins.shape[1]
        actuators = replace(
            TRUTH["actuators"],
            labels=(*(f"fin_{number}" for number in range(1, count + 1)), "shaft"),
            units=", ".join([*["rad"] * count, "rad/s"]),
        )
        return self._described(
            {**TRUTH, "actuators": actuators}, values | {"actuators": np.column_stack([fins, shaft])}
        )

    def _estimate(self) -> dict[str, Field]:
        values = self._values("estimate", position=2, heading=1, velocity=2, current=2)
        parts = (values["position"][:, :2], values["heading"], values["velocity"], values["current"])
        names = tuple(STATES)
        mean = replace(ESTIMATE["mean"], labels=names, units=", ".join(STATES.values()))
        covariance = replace(ESTIMATE["covariance"], labels=names)
        table = {**ESTIMATE, "mean": mean, "covariance": covariance}
        return self._described(table, values | {"mean": np.column_stack(parts)})

    def _mission(self, manoeuvre: bool) -> dict[str, Field]:
        fields = {SETPOINTS.get(name, name): item for name, item in self._fields("guidance").items()}
        phases = ("manoeuvre",) if manoeuvre else DOCKING_PHASES
        if manoeuvre:
            fields["phase"] = replace(fields["phase"], values=fields["phase"].values - np.int8(MANOEUVRE))
        table = {**MISSION, "phase": replace(MISSION["phase"], flags=phases)}
        own = {} if manoeuvre else {name: item for name, item in fields.items() if name not in table}
        return self._described(table, {name: item.values for name, item in fields.items()}) | own

    def _sensor(self, name: str) -> dict[str, Field]:
        fields = self._fields(name)
        return {key: field_of(READING[key], item.values) if key in READING else item for key, item in fields.items()}

    def _fields(self, group: str) -> Mapping[str, Field]:
        """The fields of an old group, each with as many rows as `time`."""
        fields = self.found.groups.get(group)
        if fields is None or "time" not in fields:
            raise InputError(f"{self.where}: no group '{group}' with a variable 'time'")
        if group == "guidance" and "phase" not in fields:
            raise InputError(f"{self.where}: no variable 'guidance/phase'")
        rows = fields["time"].values.shape
        for name, item in fields.items():
            if item.values.shape[:1] != rows:
                shape = item.values.shape
                raise InputError(f"{self.where}: '{group}/{name}' has shape {shape}, not {rows[0]} rows as 'time'")
        return fields

    def _values(self, group: str, **axes: int) -> dict[str, NDArray[Any]]:
        """The arrays of an old group; `axes` says of some that they are there, and how many axes they have."""
        values = {name: item.values for name, item in self._fields(group).items()}
        for name, count in axes.items():
            if name not in values:
                raise InputError(f"{self.where}: no variable '{group}/{name}'")
            if values[name].ndim != count:
                raise InputError(f"{self.where}: '{group}/{name}' has {values[name].ndim} axes, not {count}")
        return values

    def _described(self, table: Table, values: Columns) -> dict[str, Field]:
        """Fields of a table's variables; those that are missing are found by the checks of the whole."""
        return {name: field_of(variable, values[name]) for name, variable in table.items() if name in values}

    def _repeated(self, group: str, text: str) -> NDArray[Any]:
        return np.full(len(self._fields(group)["time"].values), text, dtype=object)
