"""A log as a MATLAB file: its groups as nested structures, with units beside the numbers."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from auvsim.base.files import whole
from auvsim.data.log import Log

_LONGEST = 63  # of a name in MATLAB


def write(log: Log, path: Path) -> list[Path]:
    """Writes FILE.mat with `vehicles`, `structures`, `event`, `attributes` and so on, and `units` of the same shape.

    Names are the log's, what MATLAB does not take in them as `_`; texts are cells; times are rows.
    """
    whole_log: dict[str, Any] = {"attributes": {_name(k): v for k, v in log.attributes.items()}}
    units: dict[str, Any] = {}
    for group, columns in log.groups.items():
        for name, values in columns.items():
            _put(whole_log, [*group.split("/"), name], values)
            variable = log.tables.get(group, {}).get(name)
            if variable is not None and variable.units:
                _put(units, [*group.split("/"), name], variable.units)
    for group, attributes in log.group_attributes.items():
        for name, value in attributes.items():
            _put(whole_log, [*group.split("/"), "attributes", name], value)
    with whole(path) as partial:
        savemat(partial, whole_log | {"units": units}, long_field_names=True, do_compression=True, oned_as="column")
    return [path]


def _put(tree: dict[str, Any], keys: list[str], value: Any) -> None:
    for key in keys[:-1]:
        tree = tree.setdefault(_name(key), {})
    tree[_name(keys[-1])] = np.asarray(value) if not isinstance(value, str | int | float) else value


def _name(text: str) -> str:
    name = re.sub(r"\W", "_", text)
    return (name if name[:1].isalpha() else f"x{name}")[:_LONGEST]
