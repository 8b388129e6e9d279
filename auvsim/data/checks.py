"""Checks of a log's structure; each fault is one line that says where it is and what would be right."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.data.attributes import (
    FORMAT_VERSION,
    RUN_ATTRIBUTES,
    STATUSES,
    STRUCTURE_ATTRIBUTES,
    VEHICLE_ATTRIBUTES,
    AttributeSpec,
)
from auvsim.data.variables import DTYPES, READING, ROOT_TABLES, SIZES, VEHICLE_TABLES, Table, Variable

if TYPE_CHECKING:
    from auvsim.data.log import Log

LARGEST_TRUTH = 1e10  # of any number of the truth: at less than 1000 m/s for less than 10^6 s [SI]


def check(log: "Log", where: str) -> None:
    """Refuses a log that is not one of format 3.

    Raises:
        InputError: that names `where`, the group and variable or attribute, what is wrong and what would be right.
    """
    _check_attributes(log.attributes, RUN_ATTRIBUTES, where, "")
    if log.attributes["format_version"] != FORMAT_VERSION:
        raise InputError(f"{where}: log format {log.attributes['format_version']}; this auvsim reads 1 to 3")
    if log.attributes["status"] not in STATUSES:
        raise InputError(f"{where}: status '{log.attributes['status']}'; there are {', '.join(STATUSES)}")
    if not log.vehicles:
        raise InputError(f"{where}: no vehicle; each has a group 'vehicles/<name>' with its attributes")
    for name in log.structures:
        path = f"structures/{name}"
        _check_attributes(log.group_attributes[path], STRUCTURE_ATTRIBUTES, where, path)
    for name in log.vehicles:
        _check_vehicle(log, name, where)
    for path, table in ROOT_TABLES.items():
        _check_holds(log, path, table, where)
    for path in log.groups:
        if path.startswith("vehicles/") and path.split("/")[1] not in log.vehicles:
            raise InputError(f"{where}: the group '{path}' is of no vehicle; there are {', '.join(log.vehicles)}")
        _check_group(log.groups[path], log.tables.get(path, {}), where, path)
        if path.endswith("/truth"):
            _check_truth(log.groups[path], where, path)
    for name in {*log.groups["event"]["vehicle"].tolist()} - {"", *log.vehicles}:
        known = ", ".join(log.vehicles)
        raise InputError(f"{where}: 'event/vehicle' has '{name}'; there are {known}, and '' for the run as a whole")


def _check_vehicle(log: "Log", name: str, where: str) -> None:
    path = f"vehicles/{name}"
    _check_attributes(log.group_attributes[path], VEHICLE_ATTRIBUTES, where, path)
    dock = log.group_attributes[path].get("dock", "")
    if dock and dock not in log.structures:
        known = ", ".join(log.structures) or "none"
        raise InputError(f"{where}: attribute 'dock' of '{path}' is '{dock}'; there are the structures {known}")
    for suffix, table in VEHICLE_TABLES.items():
        _check_holds(log, f"{path}/{suffix}", table, where)
    for sensor in log.groups:
        if sensor.startswith(f"{path}/sensors/"):
            _check_holds(log, sensor, READING, where)
            _check_holds(log, sensor, {"value": None}, where)
    if not log.tables[f"{path}/mission"]["phase"].flags:
        raise InputError(f"{where}: '{path}/mission/phase' has no flags that name the phases")


def _check_attributes(found: Mapping[str, Any], wanted: Mapping[str, AttributeSpec], where: str, path: str) -> None:
    of = f" of '{path}'" if path else ""
    for name, spec in wanted.items():
        if name not in found:
            if spec.required:
                raise InputError(f"{where}: no attribute '{name}'{of} ({spec.meaning})")
        elif not spec.accepts(found[name]):
            kind = {str: "a text", int: "an integer"}.get(spec.types, "a finite number")
            raise InputError(f"{where}: attribute '{name}'{of} is {found[name]!r}, not {kind} ({spec.meaning})")
    for name, value in found.items():
        if not isinstance(value, str | int | float):
            raise InputError(f"{where}: attribute '{name}'{of} is a {type(value).__name__}, not a text or number")


def _check_holds(log: "Log", path: str, table: Mapping[str, Variable | None], where: str) -> None:
    """Refuses a log without the group, or without a variable of the table in its type and dimensions."""
    if path not in log.groups or path not in log.tables:
        raise InputError(f"{where}: no group '{path}'; there are {', '.join(log.groups) or 'none'}")
    for name, wanted in table.items():
        if name not in log.groups[path] or name not in log.tables[path]:
            raise InputError(f"{where}: no variable '{path}/{name}'; there are {', '.join(log.groups[path])}")
        found = log.tables[path][name]
        if wanted and (found.dtype, found.dimensions) != (wanted.dtype, wanted.dimensions):
            right = _form(wanted.dtype, wanted.dimensions)
            raise InputError(f"{where}: '{path}/{name}' is {_form(found.dtype, found.dimensions)}, not {right}")


def _form(dtype: str, dimensions: tuple[str, ...]) -> str:
    return f"{dtype} ({', '.join(('time', *dimensions))})"


def _check_group(columns: Mapping[str, NDArray[Any]], table: Table, where: str, path: str) -> None:
    """Refuses a group whose arrays do not fit its table, or one another."""
    for name in columns.keys() ^ table.keys():
        raise InputError(f"{where}: '{path}/{name}' is {'not described' if name in columns else 'missing'}")
    if "time" not in columns:
        raise InputError(f"{where}: no variable '{path}/time'; every group has one")
    sizes: dict[str, int] = {**SIZES, "time": len(columns["time"])}
    for name, variable in table.items():
        _check_array(columns[name], variable, sizes, where, f"{path}/{name}")
    if not np.isfinite(columns["time"]).all():
        row = int(np.argmin(np.isfinite(columns["time"])))
        raise InputError(f"{where}: '{path}/time' is {columns['time'][row]} in row {row}; times are finite")


def _check_truth(columns: Mapping[str, NDArray[Any]], where: str, path: str) -> None:
    """Refuses a truth of sizes that no run has; one that diverged may end in values that are not finite."""
    for name, values in columns.items():
        most = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
        if most > LARGEST_TRUTH:
            raise InputError(f"{where}: '{path}/{name}' has {most:g} in size; a run has {LARGEST_TRUTH:g} at most")


def _check_array(values: NDArray[Any], variable: Variable, sizes: dict[str, int], where: str, name: str) -> None:
    """Refuses an array that does not fit its variable, or the `sizes` that others of its group have."""
    if variable.dtype not in DTYPES:
        raise InputError(f"{where}: '{name}' has type {variable.dtype}; a log has {', '.join(DTYPES)}")
    if values.dtype != variable.array_type:
        raise InputError(f"{where}: '{name}' has type {values.dtype}, not {variable.array_type}")
    dimensions = ("time", *variable.dimensions)
    if values.ndim == len(dimensions):
        for dimension, size in zip(dimensions, values.shape, strict=True):
            sizes.setdefault(dimension, size)
    wanted = tuple(sizes.get(dimension, dimension) for dimension in dimensions)
    if values.shape != wanted:
        text = ", ".join(map(str, wanted))
        raise InputError(f"{where}: '{name}' has shape {values.shape}, not ({text}) for ({', '.join(dimensions)})")
    if variable.labels and len(variable.labels) != values.shape[-1]:
        count, size = len(variable.labels), values.shape[-1]
        raise InputError(f"{where}: '{name}' has {count} labels ({', '.join(variable.labels)}) for {size} columns")
    if variable.flags and values.size and not 0 <= values.min() <= values.max() < len(variable.flags):
        wrong = next(value for value in values.ravel().tolist() if not 0 <= value < len(variable.flags))
        text = ", ".join(f"{value} {flag}" for value, flag in enumerate(variable.flags))
        raise InputError(f"{where}: '{name}' has the value {wrong}; there are {text}")
    if variable.text and not all(isinstance(value, str) for value in values.ravel().tolist()):
        raise InputError(f"{where}: '{name}' has values that are no texts")
