"""Keeps what happens in a running trial, cheaply, until it becomes a TrialLog."""

import importlib.metadata
import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import auvsim
from auvsim.base.errors import InputError, unknown_name
from auvsim.base.reading import Reading
from auvsim.data.log import FORMAT_VERSION, SIZES, STATUSES, TABLE, VERSIONS, WALL_TIME, TrialLog, Variable, check
from auvsim.physics.truth import Truth


class LogWriter:
    """Keeps the rows of a running trial; arrays are made once, at the end."""

    def __init__(self, *, attributes: Mapping[str, str | int | float], fins: int) -> None:
        """Starts an empty log of a vehicle with `fins` fins; the attributes are REQUIRED_ATTRIBUTES and any others."""
        self._attributes = dict(attributes)
        fixed = {name: size for name, size in SIZES.items() if size is not None}
        self._sizes = {**fixed, "fin": fins, "fins_and_shaft": fins + 1}
        self._rows: dict[str, list[Sequence[Any]]] = {group: [] for group in TABLE if group != "truth"}
        self._truths: list[tuple[float, ...]] = []

    def append(self, group: str, row: Sequence[Any]) -> None:
        """Appends one row, in the order of the table, to any group but truth. Arrays are kept by reference."""
        self._rows[group].append(row)

    def truth(self, truth: Truth) -> None:
        """Appends a truth, copied: one flat tuple, which costs a fifth of one with a list for each array."""
        self._truths.append(
            (
                truth.time,
                *truth.position.tolist(),
                *truth.quaternion.tolist(),
                *truth.attitude.tolist(),
                *truth.nu.tolist(),
                *truth.current.tolist(),
                *truth.fins.tolist(),
                truth.shaft_speed,
            )
        )

    def reading(self, reading: Reading, *, lost: bool = False, outlier: bool = False) -> None:
        """Appends a reading to its sensor's group; a lost one is logged as never received."""
        if lost:
            reading = reading._replace(received=math.nan)
        row = reading[1:]  # a tuple, which unlike a list the garbage collector does not look through again and again
        self._rows[reading.sensor].append((*row, lost, outlier) if reading.sensor == "usbl" else row)

    def event(self, time: float, kind: str, text: str) -> None:
        """Appends an event."""
        self._rows["event"].append((time, kind, text))

    def finish(self, status: str, *, wall_time: float = math.nan) -> TrialLog:
        """The log of the trial that ended with `status`.

        Raises:
            InputError: if the status is unknown, a row does not fit the table or an attribute is missing.
        """
        if status not in STATUSES:
            raise unknown_name("status", status, list(STATUSES))
        groups = {"truth": self._truth_columns()} | {group: self._columns(group) for group in self._rows}
        attributes = self._attributes | {
            "format_version": FORMAT_VERSION,
            "status": status,
            WALL_TIME: wall_time,
            **{name: version(package) for name, package in VERSIONS.items()},
        }
        log = TrialLog(groups, attributes)
        check(log, "log")
        return log

    def _truth_columns(self) -> dict[str, NDArray[Any]]:
        variables = TABLE["truth"]
        shapes = [self._shape(len(self._truths), variable) for variable in variables.values()]
        ends = np.cumsum([math.prod(shape[1:]) for shape in shapes])
        try:
            flat = np.array(self._truths, dtype=float).reshape(len(self._truths), ends[-1])
        except ValueError as error:
            raise InputError(f"log: a truth should have {ends[-1]} numbers: {error}") from None
        parts = zip(variables, np.split(flat, ends[:-1], axis=1), shapes, strict=True)
        return {name: np.ascontiguousarray(part).reshape(shape) for name, part, shape in parts}

    def _columns(self, group: str) -> dict[str, NDArray[Any]]:
        rows, variables = self._rows[group], TABLE[group]
        for wrong in {*map(len, rows)} - {len(variables)}:
            names = ", ".join(variables)
            raise InputError(f"log: a row of '{group}' has {wrong} values, not {len(variables)}: {names}")
        columns = {}
        kept = zip(*rows, strict=True) if rows else [()] * len(variables)
        for (name, variable), values in zip(variables.items(), kept, strict=True):
            shape = self._shape(len(rows), variable)
            try:
                dtype = object if variable.dtype == "str" else variable.dtype
                columns[name] = (_joined if len(shape) > 1 else np.array)(values, dtype=dtype).reshape(shape)
            except (TypeError, ValueError) as error:
                raise InputError(f"log: '{group}/{name}' should have shape {shape}: {error}") from None
        return columns

    def _shape(self, rows: int, variable: Variable) -> tuple[int, ...]:
        return (rows, *(self._sizes[dimension] for dimension in variable.dimensions))


def _joined(arrays: Sequence[NDArray[Any]], dtype: Any) -> NDArray[Any]:
    """Arrays of one size in a row: a fifth of the time of an array of arrays."""
    if len({*map(len, arrays)}) > 1:
        raise ValueError("the rows have different sizes")
    return np.concatenate(arrays, dtype=dtype) if arrays else np.array((), dtype=dtype)


@cache  # reading a package's metadata takes milliseconds
def version(package: str) -> str:
    """Of this or another installed package."""
    return auvsim.__version__ if package == "auvsim" else importlib.metadata.version(package)
