"""Slant range to an acoustic beacon by two-way travel time."""

import math
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.frames import rotation
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.sensor import Sensor, Surroundings

Vector = tuple[float, float, float]


class RangeSettings(Settings):
    """A range to a beacon at a known place.

    A wrong sound speed scales every range, so that its error is in proportion; the turn-around time of the beacon adds
    a constant. The defaults are those of a long-baseline transponder: a few decimetres.
    """

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=0.2, gt=0.0, description="readings per second, divides the control rate [Hz]")
    beacon: Vector = Field(default=(0.0, 0.0, 0.0), description="place of the beacon: north, east, depth [m]")
    transponder: Vector = Field(default=(0.0, 0.0, 0.0), description="place in the vehicle's body frame [m]")
    noise: float = Field(default=0.2, ge=0.0, description="white noise, sd [m]")
    scale_error: float = Field(default=0.001, ge=0.0, description="scale error of a trial (sound speed), sd [-]")
    bias: float = Field(default=0.1, ge=0.0, description="bias of a trial (turn-around time), sd [m]")
    maximum: float = Field(default=1000.0, gt=0.0, description="range beyond which nothing is heard [m]")
    dropout_probability: float = Field(default=0.02, ge=0.0, le=1.0, description="share of readings lost [-]")


class Range(Sensor):
    """Measures the distance (1,) [m] from a transponder on the vehicle to a beacon.

    A reading takes 1 normal and 1 uniform, whether it is lost or not. It is true and arrives at one time: the travel of
    sound, under a second, is not modelled.
    """

    kind, Settings = "range", RangeSettings
    value = Variable(("range",), "float64", "m", "slant range to the beacon")
    sizes: ClassVar = {"range": 1}

    def __init__(self, settings: RangeSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        scale, bias = self._noise.normals(2)
        self.scale = 1.0 + settings.scale_error * scale  # of this trial [-]
        self.bias = settings.bias * bias  # of this trial [m]
        self._beacon, self._transponder = np.array(settings.beacon), np.array(settings.transponder)

    def measure(self, truth: Truth, world: Surroundings) -> Reading | None:
        """The range now, or None where nothing is heard."""
        settings = self.settings
        (draw,), (chance,) = self._noise.normals(1), self._noise.uniforms(1)
        away = truth.position + rotation(*truth.attitude.tolist()) @ self._transponder - self._beacon
        distance = math.sqrt(float(away @ away))
        if distance > settings.maximum or chance < settings.dropout_probability:
            return None
        return self._reading(truth.time, np.array((self.scale * distance + self.bias + settings.noise * draw,)))
