"""Parts of a user's own that go wrong once a run is under way: each by what its settings' `fault` says."""

import math
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from auvsim.base.reading import Reading
from auvsim.control.torpedo import Autopilot, AutopilotSettings
from auvsim.data.variables import Variable
from auvsim.missions.docking.guidance import Docking, DockingSettings
from auvsim.missions.mission import Event
from auvsim.navigation import docking
from auvsim.navigation.settings import AugmentedSettings
from auvsim.sensors.depth import Depth, DepthSettings

AFTER = 10.0  # time at which they go wrong [s]


def fail(fault: str) -> None:
    """Raises what a fault says, if it says anything to be raised."""
    match fault:
        case "raises":
            raise ZeroDivisionError("of a stranger")
        case "exits":
            sys.exit("of its own will")
        case "recurses":
            fail(fault)


class Estimator:
    """The augmented filter until it goes wrong."""

    def __init__(self, setup) -> None:
        self._fault = setup.settings["fault"]
        self._inner = docking.augmented_ekf(replace(setup, settings=AugmentedSettings()))
        self.states, self.reset = self._inner.states, self._inner.reset

    def update(self, time, readings, messages, commands):
        """An estimate, or what the fault says."""
        found = self._inner.update(time, readings, messages, commands)
        if time < AFTER:
            return found
        fail(self._fault)
        return {
            "none": None,
            "nan": replace(found, initialised=True, position=np.full(3, math.nan)),
            "shape": replace(found, velocity=np.zeros(2)),
            "covariance": replace(found, covariance=np.zeros((2, 2))),
            "list": replace(found, position=[1.0, 2.0, 3.0]),
            "heading": replace(found, initialised=True, heading=None),
        }.get(self._fault, found)


class Controller(Autopilot):
    """The autopilot until it goes wrong."""

    Settings = None

    def __init__(self, setup) -> None:
        self._fault, self._calls = setup.settings["fault"], 0
        super().__init__(replace(setup, settings=AutopilotSettings()))

    def observe(self, readings) -> None:
        """Counts its calls, ten a second."""
        self._calls += 1
        if self._fault == "observes" and self._calls > 10.0 * AFTER:
            raise ValueError("cannot look")
        super().observe(readings)

    def command(self, setpoints):
        """A demand, or what the fault says."""
        found = super().command(setpoints)
        if self._calls < 10.0 * AFTER:
            return found
        fail(self._fault)
        wrong = {"none": None, "nan": (math.nan, 0.0, 0.0), "shape": (0.0, 0.0), "text": ("a", 0.0, 0.0)}
        return wrong.get(self._fault, found)


class Sensor(Depth):
    """A second depth gauge until it goes wrong."""

    Settings = None

    def __init__(self, settings, generator, **of_instance) -> None:
        self._fault = settings["fault"]
        super().__init__(DepthSettings(), generator, **of_instance)

    def measure(self, truth, world):
        """A reading, or what the fault says."""
        found = super().measure(truth, world)
        if truth.time < AFTER:
            return found
        fail(self._fault)
        return {
            "tuple": (1.0,),
            "shape": found._replace(value=np.zeros(4)),
            "stamp": found._replace(stamp=math.nan),
            "name": found._replace(sensor="compass"),
            "float": found._replace(value=3.0),
            "nan": Reading(self.name, truth.time, truth.time, np.array([math.nan])),
            "nothing": None,
        }.get(self._fault, found)


class Mission(Docking):
    """Docking until it goes wrong."""

    Settings = None

    variables = {**Docking.variables, "mood": Variable((), "float64", "1", "of the mission")}  # noqa: RUF012

    def __init__(self, setup) -> None:
        self._fault, self._time = setup.settings["fault"], 0.0
        super().__init__(replace(setup, settings=DockingSettings()))

    @property
    def at_rest(self) -> bool:
        """Never, unless asking is too much."""
        if self._fault == "rests" and self._time >= AFTER:
            raise LookupError("no rest")
        return False

    def update(self, now):
        """Setpoints, or what the fault says."""
        found, self._time = super().update(now), now.time
        if now.time < AFTER:
            return found
        fail(self._fault)
        if self._fault == "phase":
            self.phase = 99
        if self._fault == "event":
            self.events.append(Event(now.time, "mood", None))
        wrong = {
            "none": None,
            "nan": found._replace(depth=math.nan),
            "shape": found[:2],
            "text": found._replace(speed="x"),
        }
        return wrong.get(self._fault, found)

    def row(self):
        """Values of the variables, or what the fault says."""
        mood = {"short": (), "word": ("gloomy",)} if self._time >= AFTER else {}
        return (*super().row(), *mood.get(self._fault, (1.0,)))


def nothing(setup):
    """Makes nothing."""
    return None


def bare(setup):
    """Makes what has nothing of a part."""
    return SimpleNamespace(states={"north": 1})


def statesless(setup):
    """Makes an estimator whose states have no units."""
    return SimpleNamespace(states={"north": 1}, update=None, reset=None)


def raising(*_, **__):
    """Cannot be made."""
    raise OSError("no such device")
