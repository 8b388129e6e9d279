"""The log of a run: groups of arrays that describe themselves, in one NetCDF-4 file that is whole or absent."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.data import convert, netcdf
from auvsim.data.attributes import VERSIONS, WALL_TIME
from auvsim.data.checks import check
from auvsim.data.fields import content, parts
from auvsim.data.variables import Variable

Columns = dict[str, NDArray[Any]]
Attributes = dict[str, str | int | float]


@dataclass(frozen=True, slots=True)
class Log:
    """A run as arrays, each with time as its first axis, and what describes them."""

    groups: dict[str, Columns]  # by path: vehicles/remus100/truth, vehicles/remus100/sensors/compass, event, ...
    tables: dict[str, dict[str, Variable]]  # by path and name, what the log says of each variable
    attributes: Attributes  # of the run: format_version, status, scenario, seed, trial, wall_time, versions, ...
    group_attributes: dict[str, Attributes]  # by path: vehicles/remus100, structures/dock

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        return self._instances("vehicles")

    @property
    def structures(self) -> tuple[str, ...]:
        """Names of the structures."""
        return self._instances("structures")

    @property
    def models(self) -> dict[tuple[str, str], str]:
        """MJCF texts of its models as they were when the run began, by kind (`vehicle`, `structure`) and name."""
        held = self.groups.get("models", {})
        if not {"kind", "model", "text"} <= held.keys():
            return {}
        return dict(
            zip(zip(held["kind"].tolist(), held["model"].tolist(), strict=True), held["text"].tolist(), strict=True)
        )

    def vehicle(self, name: str | None = None) -> "VehicleLog":
        """The part of one vehicle; None is the only one.

        Raises:
            InputError: if there is no vehicle of that name, or None is given and there are several.
        """
        known = ", ".join(self.vehicles) or "none"
        if name is None and len(self.vehicles) != 1:
            raise InputError(f"the log has {len(self.vehicles)} vehicles ({known}); say which")
        if name is not None and name not in self.vehicles:
            raise InputError(f"the log has no vehicle '{name}'; there are {known}")
        return VehicleLog(self, name or self.vehicles[0])

    def structure(self, name: str) -> "StructureLog":
        """What the log says of one structure.

        Raises:
            InputError: if there is no structure of that name.
        """
        if name not in self.structures:
            raise InputError(f"the log has no structure '{name}'; there are {', '.join(self.structures) or 'none'}")
        return StructureLog(self, name)

    def _instances(self, kind: str) -> tuple[str, ...]:
        paths = (path.split("/") for path in self.group_attributes)
        return tuple(path[1] for path in paths if len(path) == 2 and path[0] == kind)


@dataclass(frozen=True, slots=True)
class StructureLog:
    """What a log says of one structure."""

    log: Log
    name: str

    @property
    def attributes(self) -> Attributes:
        """Its attributes."""
        return self.log.group_attributes[f"structures/{self.name}"]

    def number(self, attribute: str, default: float | None = None) -> float:
        """A numeric attribute, or the default where the log does not give it.

        Raises:
            InputError: if it is not given and there is no default, or it is no number.
        """
        return _number(self.attributes, attribute, f"structures/{self.name}", default)

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) north, east, down of the mouth's centre [m]."""
        return np.array([self.number(name) for name in ("north", "east", "depth")])

    @property
    def heading(self) -> float:
        """Course of a vehicle that enters [rad]."""
        return self.number("heading")


@dataclass(frozen=True, slots=True)
class VehicleLog:
    """One vehicle's part of a log."""

    log: Log
    name: str

    def __getitem__(self, group: str) -> Columns:
        """The variables of a group: `truth`, `sensors/compass` or `compass` for short, `event`.

        The events are those of this vehicle and of the run as a whole.

        Raises:
            InputError: if there is no such group.
        """
        if group == "event":
            events = self.log.groups["event"]
            mine = np.isin(events["vehicle"].astype(str), ["", self.name])
            return {name: values[mine] for name, values in events.items()}
        return self.log.groups[self._path(group)]

    def __contains__(self, group: object) -> bool:
        """Whether the vehicle has a group of that name, long or short."""
        return group == "event" or any(path in self.log.groups for path in self._paths(str(group)))

    def table(self, group: str) -> dict[str, Variable]:
        """What the log says of the variables of a group.

        Raises:
            InputError: if there is no such group.
        """
        return self.log.tables["event" if group == "event" else self._path(group)]

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the vehicle's groups."""
        start = f"vehicles/{self.name}/"
        return tuple(path.removeprefix(start) for path in self.log.groups if path.startswith(start))

    @property
    def attributes(self) -> Attributes:
        """The vehicle's attributes."""
        return self.log.group_attributes[f"vehicles/{self.name}"]

    def number(self, attribute: str, default: float | None = None) -> float:
        """A numeric attribute, or the default where the log does not give it.

        Raises:
            InputError: if it is not given and there is no default, or it is no number.
        """
        return _number(self.attributes, attribute, f"vehicles/{self.name}", default)

    @property
    def structure(self) -> StructureLog | None:
        """The structure of the vehicle's mission, if it has one."""
        name = str(self.attributes.get("dock", ""))
        return self.log.structure(name) if name else None

    @property
    def mission(self) -> str:
        """Kind of the mission."""
        return str(self.attributes["mission"])

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the mission's phases, in the order of their values 0, 1, ..."""
        return self.table("mission")["phase"].flags

    def _paths(self, group: str) -> tuple[str, str]:
        return f"vehicles/{self.name}/{group}", f"vehicles/{self.name}/sensors/{group}"

    def _path(self, group: str) -> str:
        for path in self._paths(group):
            if path in self.log.groups:
                return path
        raise InputError(f"vehicle '{self.name}' has no log group '{group}'; there are {', '.join(self.groups)}, event")


def write(log: Log, path: str | os.PathLike[str]) -> None:
    """Writes the log as NetCDF-4, whole or not at all.

    Raises:
        InputError: if the log is not one of format 3, or the file cannot be written.
    """
    check(log, str(path))
    netcdf.save(path, content(log))


def pack(log: Log) -> bytes:
    """The bytes of a log's file, to be written elsewhere."""
    return netcdf.pack(content(log))


def read(path: str | os.PathLike[str]) -> Log:
    """Reads a log; those of formats 1 and 2 are converted.

    Raises:
        InputError: if there is no such file, or it is not a whole log.
    """
    log = Log(*parts(convert.converted(netcdf.load(path), str(path)), str(path)))
    check(log, str(path))
    return log


def differences(a: Log, b: Log) -> list[str]:
    """Names of the attributes and variables that are not the same bit for bit, wall-clock times and versions apart."""
    left, right = ({"": log.attributes} | log.group_attributes for log in (a, b))
    found = []
    for path in sorted(left.keys() | right.keys()):
        mine, other = left.get(path, {}), right.get(path, {})
        names = (mine.keys() | other.keys()) - (set() if path else {WALL_TIME, *VERSIONS})
        found += [f"{path}/{name}".lstrip("/") for name in sorted(names) if mine.get(name) != other.get(name)]
    for path in sorted(a.groups.keys() | b.groups.keys()):
        mine, other = a.groups.get(path, {}), b.groups.get(path, {})
        names = [*mine, *(name for name in other if name not in mine)] or ["(empty)"]
        found += [f"{path}/{name}" for name in names if not _same(mine.get(name), other.get(name))]
        found += [f"{path} (tables)"] if a.tables.get(path) != b.tables.get(path) else []
    return found


def _same(a: NDArray[Any] | None, b: NDArray[Any] | None) -> bool:
    if a is None or b is None or a.shape != b.shape or a.dtype != b.dtype:
        return False
    return a.tolist() == b.tolist() if a.dtype == object else a.tobytes() == b.tobytes()


def _number(attributes: Attributes, name: str, path: str, default: float | None) -> float:
    value = attributes.get(name, default)
    if isinstance(value, int | float):
        return float(value)
    wrong = "not given" if value is None else f"{value!r}, no number"
    raise InputError(f"attribute '{name}' of '{path}' is {wrong}; there are {', '.join(attributes)}")
