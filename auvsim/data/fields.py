"""Logs as the fields of a NetCDF file and back: how units, flags and labels stand in the attributes of a variable."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.data.netcdf import Content, Field
from auvsim.data.variables import Group, Variable

if TYPE_CHECKING:
    from auvsim.data.log import Log


def content(log: "Log") -> Content:
    """The content of a log's file."""
    groups = {
        path: {name: field_of(variable, log.groups[path][name]) for name, variable in table.items()}
        for path, table in log.tables.items()
    }
    return Content(groups, {"": log.attributes, **log.group_attributes})


def empty(group: Group) -> dict[str, Field]:
    """The fields of a group without rows."""
    return {
        name: field_of(variable, np.zeros(group.shape(0, name), dtype=variable.array_type))
        for name, variable in group.table.items()
    }


def parts(found: Content, where: str) -> tuple[dict, dict, dict, dict]:
    """Groups, tables, attributes and group attributes of a log, by what its file says.

    Args:
        found: Content of a file of format 3.
        where: Names the file in errors.

    Raises:
        InputError: if a variable has no axis `time`.
    """
    groups: dict[str, dict[str, NDArray[Any]]] = {}
    tables: dict[str, dict[str, Variable]] = {}
    for path, fields in found.groups.items():
        for name, item in fields.items():
            if item.dimensions[:1] != ("time",):
                raise InputError(f"{where}: the first axis of '{path}/{name}' is not 'time', as a log's should be")
        groups[path] = {name: item.values for name, item in fields.items()}
        tables[path] = {name: _variable(item) for name, item in fields.items()}
    attributes = dict(found.attributes.get("", {}))
    return groups, tables, attributes, {path: dict(value) for path, value in found.attributes.items() if path}


def field_of(variable: Variable, values: NDArray[Any]) -> Field:
    """The field of a variable, with what describes it as attributes."""
    texts = {"units": variable.units, "long_name": variable.long_name, "frame": variable.frame}
    attributes: dict[str, Any] = {name: text for name, text in texts.items() if text}
    if variable.labels:
        attributes["labels"] = ",".join(variable.labels)
    if variable.flags:  # as in the CF conventions, section 3.5
        attributes["flag_values"] = np.arange(len(variable.flags), dtype=variable.dtype)
        attributes["flag_meanings"] = " ".join(variable.flags)
    return Field(("time", *variable.dimensions), values, attributes, coded=variable.dtype == "category")


def _variable(item: Field) -> Variable:
    """What the attributes of a field say of it."""

    def text(name: str, attributes: Mapping[str, Any] = item.attributes) -> str:
        return str(attributes.get(name, ""))

    kind = "category" if item.coded else "str" if item.values.dtype == object else item.values.dtype.name
    labels = tuple(text("labels").split(",")) if text("labels") else ()
    flags = tuple(text("flag_meanings").split())
    return Variable(
        item.dimensions[1:], kind, text("units"), text("long_name"), text("frame"), flags=flags, labels=labels
    )
