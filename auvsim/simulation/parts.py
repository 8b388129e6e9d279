"""Parts of a user's own in a run: whatever goes wrong in their code ends the run with their name and traceback."""

import math
import traceback
from typing import Any

import numpy as np

from auvsim.base import plugins
from auvsim.base.errors import DivergenceError
from auvsim.base.reading import Reading
from auvsim.control.controller import Station
from auvsim.data.variables import Variable, size_of
from auvsim.missions.mission import Event, Mission
from auvsim.navigation.estimate import Estimate
from auvsim.sensors.sensor import Sensor


class PartError(DivergenceError):
    """A part of the user's own failed during a run.

    Args:
        text: one line: which part, and what is wrong.
        trace: its traceback.
    """

    def __init__(self, text: str, trace: str) -> None:
        super().__init__(text)
        self.trace = trace


class Part:
    """A part of an agent, to be blamed for what it raises.

    What a shipped part raises passes as it is; of a user's own it becomes a PartError, which ends the run as diverged.

    Args:
        what: it is: "estimator".
        kind: of it.
        vehicle: whose it is.
    """

    def __init__(self, what: str, kind: str, vehicle: str) -> None:
        self.name = f"{what} '{kind}' of '{vehicle}'"
        self.own = plugins.is_own(kind)  # whether what it gives is to be checked

    def blamed(self, error: BaseException) -> BaseException:
        """What to raise in place of an error that came out of this part."""
        if not self.own or not isinstance(error, Exception | SystemExit):
            return error
        text = plugins.same_each_time(" ".join(str(error).split()))[:300]
        lines = plugins.same_each_time("".join(traceback.format_exception(error)).strip())
        return PartError(f"{self.name} failed: {type(error).__name__}: {text}", lines)


def reading(found: Any, sensor: Sensor) -> None:
    """The contract of what a sensor measures; its values may be NaN.

    Raises:
        TypeError: it is no Reading.
        ValueError: a number is wrong, or a shape.
    """
    if not isinstance(found, Reading):
        raise TypeError(f"measure gave a {type(found).__name__}, not a Reading or None")
    if found.sensor != sensor.name:
        raise ValueError(f"measure gave a reading of '{found.sensor}', not of '{sensor.name}'")
    shape = tuple(size_of(dimension, sensor.sizes) for dimension in sensor.value.dimensions)
    _array("value", found.value, shape, finite=False)
    _numbers(stamp=found.stamp, sequence=found.sequence)


def estimate(found: Any, states: int) -> None:
    """The contract of what an estimator gives: finite from the moment it is initialised.

    Raises:
        TypeError: it is no Estimate.
        ValueError: a number is wrong, or a shape.
    """
    if not isinstance(found, Estimate):
        raise TypeError(f"update gave a {type(found).__name__}, not an Estimate")
    finite = bool(found.initialised)
    shapes = {"position": (3,), "velocity": (3,), "current": (2,), "covariance": (states, states)}
    for name, shape in shapes.items():
        _array(name, getattr(found, name), shape, finite=finite)
    if found.mean is not None or states != 8:
        _array("mean", found.mean, (states,), finite=finite)
    _numbers(time=found.time, **({"heading": found.heading} if finite else {}))


def mission(made: Mission, wanted: Any) -> None:
    """The contract of what a mission gives: setpoints, a phase, the values of its variables, events.

    Raises:
        TypeError: something is of another type.
        ValueError: a number is wrong, or missing.
    """
    if not isinstance(wanted, tuple) or len(wanted) != 4:
        raise TypeError(f"update gave a {type(wanted).__name__}, not Setpoints")
    heading, depth, speed, last = wanted
    if isinstance(wanted, Station):
        steered = {"heading": heading, "north": last[0], "east": last[1]}
    else:
        steered = {"heading": heading} if last is None else {"rudder": last}
    _numbers(depth=depth, speed=speed, **steered)
    if not 0 <= made.phase < len(made.phases):
        raise ValueError(f"phase is {made.phase!r}, not one of the {len(made.phases)}: {', '.join(made.phases)}")
    row, variables = made.row(), made.variables
    if len(row) != len(variables):
        raise ValueError(f"row gave {len(row)} values, not {len(variables)}: {', '.join(variables)}")
    for (name, variable), value in zip(variables.items(), row, strict=True):
        _value(name, variable, value)
    for event in made.events:
        if not isinstance(event, Event) or not (isinstance(event.kind, str) and isinstance(event.text, str)):
            raise TypeError(f"events has {event!r}, not an Event of time, kind and text")
        _numbers(time=event.time)


def demand(found: Any, names: tuple[str, ...]) -> None:
    """The contract of what a controller demands: a finite number for each quantity.

    Raises:
        TypeError: it is no tuple.
        ValueError: a number is wrong, or missing.
    """
    if not isinstance(found, tuple) or len(found) != len(names):
        raise TypeError(f"command gave {found!r}, not a tuple of {', '.join(names)}")
    _numbers(**dict(zip(names, found, strict=True)))


def smoothed(heading: Any, depth: Any) -> None:
    """The contract of what a controller knows itself: finite numbers, or None before it does.

    Raises:
        ValueError: it is neither.
    """
    _numbers(**{name: value for name, value in (("heading", heading), ("depth", depth)) if value is not None})


def _numbers(**values: Any) -> None:
    for name, value in values.items():
        try:
            finite = math.isfinite(value)
        except (TypeError, OverflowError):
            finite = False
        if not finite:
            raise ValueError(f"{name} is {value!r}, not a finite number")


def _array(name: str, value: Any, shape: tuple[int, ...], *, finite: bool) -> None:
    if not isinstance(value, np.ndarray) or value.shape != shape or value.dtype.kind not in "fiub":
        found = f"of shape {value.shape}" if isinstance(value, np.ndarray) else type(value).__name__
        raise ValueError(f"{name} is {found}, not an array of numbers of shape {shape}")
    if finite and not np.isfinite(value).all():
        raise ValueError(f"{name} is {value.tolist()}, not finite")


def _value(name: str, variable: Variable, value: Any) -> None:
    if variable.text:
        if not isinstance(value, str):
            raise TypeError(f"{name} is {value!r}, not a text")
    elif variable.dimensions == ():
        np.array(value, dtype=variable.array_type).reshape(())
