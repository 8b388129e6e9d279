"""Records a run at little cost; the log of a long run grows on disk."""

import importlib.metadata
import math
import os
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import auvsim
from auvsim.base.errors import InputError, unknown_name
from auvsim.base.reading import Reading
from auvsim.data import netcdf
from auvsim.data.attributes import FORMAT_VERSION, STATUSES, VERSIONS, WALL_TIME
from auvsim.data.checks import check
from auvsim.data.fields import empty, parts
from auvsim.data.log import Log
from auvsim.data.stream import Stream
from auvsim.data.variables import Group
from auvsim.physics.truth import Truth

PACKED = 4096  # rows after which a group is packed into arrays

Attributes = Mapping[str, str | int | float]


class Recorder:
    """Keeps the rows of a run by group, and packs them into arrays every PACKED rows.

    With a path, packed rows go to a partial file beside it. `finish` gives it its name; `discard` removes it, as does
    leaving a `with` block without `finish`.
    """

    def __init__(
        self,
        tables: Mapping[str, Group],
        attributes: Attributes,
        group_attributes: Mapping[str, Attributes],
        path: str | os.PathLike[str] | None = None,
    ) -> None:
        """Starts an empty log.

        Args:
            tables: Every group of the log by its path, as `variables.run_groups` gives them.
            attributes: Of the run: scenario, seed, trial and others; `finish` adds format, status and versions.
            group_attributes: By path of vehicle or structure: vehicles/remus100, structures/dock.
            path: Where the log is to stand; None keeps it in memory.

        Raises:
            InputError: if the file cannot be written.
        """
        self._tables = dict(tables)
        self._attributes = dict(attributes)
        self._group_attributes = {name: dict(values) for name, values in group_attributes.items()}
        nothing = {path: {name: item.values for name, item in empty(group).items()} for path, group in tables.items()}
        check(self._log(nothing, "interrupted"), "log")  # what is wrong with it should not come out after the run
        self._rows: dict[str, list[Sequence[Any]]] = {group: [] for group in tables}
        self._chunks: dict[str, list[dict[str, NDArray[Any]]]] = {group: [] for group in tables}
        self._sensors = {(p[1], p[3]): path for path in tables if len(p := path.split("/")) == 4 and p[2] == "sensors"}
        self._stream = None if path is None else Stream(Path(path), tables)

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, *_: object) -> None:
        self.discard()

    def append(self, group: str, row: Sequence[Any]) -> None:
        """Appends one row, in the order of the group's table. Arrays are kept by reference.

        Raises:
            InputError: if the rows that are packed now do not fit the table, or the file cannot be written.
        """
        rows = self._rows[group]
        rows.append(row)
        if len(rows) >= PACKED:
            self._pack(group)

    def truth(self, vehicle: str, truth: Truth) -> None:
        """Appends a vehicle's truth, copied: one flat tuple, which costs a fifth of one with a list for each array."""
        self.append(
            f"vehicles/{vehicle}/truth",
            (
                truth.time,
                *truth.position.tolist(),
                *truth.quaternion.tolist(),
                *truth.attitude.tolist(),
                *truth.nu.tolist(),
                *truth.current.tolist(),
                *truth.actuators.tolist(),
            ),
        )

    def reading(self, vehicle: str, reading: Reading, *extra: Any) -> None:
        """Appends a reading to its sensor's group, with the values of the sensor's own columns.

        A reading that was lost has NaN for the time it was received.
        """
        # A tuple, which unlike a list the garbage collector does not look through again and again.
        group = self._sensors[vehicle, reading.sensor]
        rows = self._rows[group]
        rows.append(reading[1:5] + extra)
        if len(rows) >= PACKED:
            self._pack(group)

    def event(self, time: float, vehicle: str, kind: str, text: str) -> None:
        """Appends an event of a vehicle, or of the run as a whole with vehicle ""."""
        self.append("event", (time, vehicle, kind, text))

    def finish(self, status: str, *, wall_time: float = math.nan) -> Log:
        """The log of the run that ended with `status`; with a path, also its file.

        Raises:
            InputError: if the status is unknown, a row does not fit its table, an attribute is missing or the file
                cannot be written.
        """
        if status not in STATUSES:
            raise unknown_name("status", status, list(STATUSES))
        for group in self._tables:
            self._pack(group)
        if self._stream is not None:
            return self._finish_stream(self._stream, status, wall_time)
        log = self._log({group: self._joined(group) for group in self._tables}, status, wall_time)
        check(log, "log")
        return log

    def _finish_stream(self, stream: Stream, status: str, wall_time: float) -> Log:
        stream.close({"": self._log({}, status, wall_time).attributes, **self._group_attributes})
        log = Log(*parts(netcdf.load(stream.partial), str(stream.path)))
        check(log, str(stream.path))
        stream.rename()
        self._stream = None
        return log

    def _log(self, groups: dict[str, dict[str, NDArray[Any]]], status: str, wall_time: float = math.nan) -> Log:
        attributes = self._attributes | {
            "format_version": FORMAT_VERSION,
            "status": status,
            WALL_TIME: wall_time,
            **{name: version(package) for name, package in VERSIONS.items()},
        }
        tables = {group: dict(found.table) for group, found in self._tables.items()}
        return Log(groups, tables, attributes, self._group_attributes)

    def discard(self) -> None:
        """Removes what was written of a log that is not finished."""
        if self._stream is not None:
            self._stream.discard()
            self._stream = None

    def _pack(self, group: str) -> None:
        rows = self._rows[group]
        if not rows:
            return
        pack = _packed_truth if group.split("/")[2:] == ["truth"] else _packed
        columns = pack(rows, self._tables[group], group)
        self._rows[group] = []
        if self._stream is not None:
            self._stream.append(group, columns)
        else:
            self._chunks[group].append(columns)

    def _joined(self, group: str) -> dict[str, NDArray[Any]]:
        chunks, found = self._chunks[group], self._tables[group]
        if len(chunks) == 1:
            return chunks[0]
        columns = {}
        for name, variable in found.table.items():
            kept = [chunk.pop(name) for chunk in chunks]  # each goes as soon as it is copied
            nothing = np.zeros(found.shape(0, name), dtype=variable.array_type)
            columns[name] = np.concatenate(kept) if kept else nothing
        return columns


def _packed_truth(rows: Sequence[Sequence[float]], group: Group, path: str) -> dict[str, NDArray[Any]]:
    """Arrays of flat rows."""
    shapes = [group.shape(len(rows), name) for name in group.table]
    ends = np.cumsum([math.prod(shape[1:]) for shape in shapes])
    try:
        flat = np.array(rows, dtype=float).reshape(len(rows), ends[-1])
    except ValueError as error:
        raise InputError(f"log: a row of '{path}' should have {ends[-1]} numbers: {error}") from None
    columns = zip(group.table, np.split(flat, ends[:-1], axis=1), shapes, strict=True)
    return {name: np.ascontiguousarray(part).reshape(shape) for name, part, shape in columns}


def _packed(rows: Sequence[Sequence[Any]], group: Group, path: str) -> dict[str, NDArray[Any]]:
    """Arrays of rows with a value for each variable."""
    for wrong in {*map(len, rows)} - {len(group.table)}:
        names = ", ".join(group.table)
        raise InputError(f"log: a row of '{path}' has {wrong} values, not {len(group.table)}: {names}")
    columns = {}
    for (name, variable), values in zip(group.table.items(), zip(*rows, strict=True), strict=True):
        shape = group.shape(len(rows), name)
        try:
            make = _concatenated if len(shape) > 1 else np.array
            columns[name] = make(values, dtype=variable.array_type).reshape(shape)
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"log: '{path}/{name}' should have shape {shape}: {error}") from None
    return columns


def _concatenated(arrays: Sequence[NDArray[Any]], dtype: Any) -> NDArray[Any]:
    """Arrays of one size in a row: a fifth of the time of an array of arrays."""
    if len({*map(len, arrays)}) > 1:
        raise ValueError("the rows have different sizes")
    return np.concatenate(arrays, dtype=dtype)


@cache  # reading a package's metadata takes milliseconds
def version(package: str) -> str:
    """Version of this or another installed package."""
    return auvsim.__version__ if package == "auvsim" else importlib.metadata.version(package)
