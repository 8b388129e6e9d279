"""Whether a mission of the user's own declares what its contract asks for: phases, variables, columns, metrics."""

import json
import math
from collections.abc import Mapping
from typing import Any

from auvsim.base.errors import InputError
from auvsim.data.variables import DTYPES, MISSION, SIZES, Variable
from auvsim.missions.mission import Metric, Place

MOST_PHASES = 127  # that the log's type of a phase can count
RESERVED = ("status", "mission", "estimate", "vehicles", "real_time_factor")  # in a summary, of every mission


def check(kind: str, made: Any) -> None:
    """Refuses a mission that was made, if what it declares cannot be used.

    Args:
        kind: of the mission.
        made: the mission.

    Raises:
        InputError: one line with the attribute, what it is and what it should be.
    """
    phases = made.phases
    if not isinstance(phases, tuple | list) or not all(isinstance(name, str) and name for name in phases):
        raise _wrong(kind, "phases", phases, "a tuple of names, such as ('under_way', 'done')")
    if not 0 < len(phases) <= MOST_PHASES or len({*phases}) < len(phases):
        raise _wrong(kind, "phases", phases, f"1 to {MOST_PHASES} names, each once")
    if not isinstance(made.phase, int) or not 0 <= made.phase < len(phases):
        raise _wrong(kind, "phase", made.phase, f"a number from 0 to {len(phases) - 1}, of a phase")
    _check_variables(kind, made.variables)
    columns(kind, made)
    aftermath = getattr(made, "aftermath", 0.0)
    if isinstance(aftermath, bool) or not isinstance(aftermath, int | float) or not 0.0 <= aftermath < math.inf:
        raise _wrong(kind, "aftermath", aftermath, "a time of 0 s or more")
    if not isinstance(getattr(made, "dock", None), Place | None):
        raise _wrong(kind, "dock", made.dock, "one of the set-up's structures, or None")
    if not isinstance(made.events, list):
        raise _wrong(kind, "events", made.events, "a list")
    if not callable(getattr(made, "metrics", None)):
        raise _wrong(kind, "metrics", getattr(made, "metrics", None), "a method metrics(log) -> dict")


def columns(kind: str, mission: Any) -> dict[str, Metric]:
    """The metrics that a mission, or its class, declares.

    Raises:
        InputError: they are no mapping of names to type, units and meaning.
    """
    declared = getattr(mission, "columns", {})
    right = "a mapping of names to Metric(dtype, units, meaning)"
    if not isinstance(declared, Mapping):
        raise _wrong(kind, "columns", declared, right)
    for name, column in declared.items():
        texts = isinstance(column, tuple) and len(column) == len(Metric._fields) and all(map(_is_text, column))
        if not _is_text(name) or not texts:
            raise _wrong(kind, f"columns[{name!r}]", column, right)
    return {name: Metric(*column) for name, column in declared.items()}


def metrics(found: Any) -> dict[str, Any]:
    """What a mission's `metrics` gave, as plain values.

    Raises:
        TypeError: it is no mapping of names to plain values.
        ValueError: a name is one of those that every summary has.
    """
    if not isinstance(found, Mapping) or not all(map(_is_text, found)):
        raise TypeError(f"metrics gave a {type(found).__name__}, not a mapping of names to values")
    for name in RESERVED:
        if name in found:
            raise ValueError(f"metrics gave '{name}', which every summary has; call it otherwise")
    return {name: json.loads(json.dumps(value, default=_plain)) for name, value in found.items()}


def _check_variables(kind: str, variables: Any) -> None:
    if not isinstance(variables, Mapping):
        raise _wrong(kind, "variables", variables, "a mapping of names to Variable")
    for name, variable in variables.items():
        what = f"variables[{name!r}]"
        if not _is_text(name) or not name.isidentifier() or not isinstance(variable, Variable):
            raise _wrong(kind, what, variable, "a Variable under a name of letters, digits and '_'")
        if name in MISSION:
            raise InputError(f"mission '{kind}': {what} is a variable of every mission; call it otherwise")
        if variable.dtype not in DTYPES:
            raise _wrong(kind, f"{what}.dtype", variable.dtype, f"one of {', '.join(DTYPES)}")
        if not isinstance(variable.dimensions, tuple) or not {*variable.dimensions} <= SIZES.keys():
            raise _wrong(kind, f"{what}.dimensions", variable.dimensions, f"a tuple of some of {', '.join(SIZES)}")
        if not (isinstance(variable.units, str) and isinstance(variable.long_name, str)):
            raise _wrong(kind, what, variable, "a Variable whose units and long_name are texts")


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _plain(value: Any) -> Any:
    """A number or array of NumPy as Python's own."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"metrics gave a {type(value).__name__}, not a plain value")


def _wrong(kind: str, what: str, value: Any, right: str) -> InputError:
    shown = repr(value)
    return InputError(f"mission '{kind}': {what} is {shown if len(shown) <= 60 else shown[:57] + '...'}, not {right}")
