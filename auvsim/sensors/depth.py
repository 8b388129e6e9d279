"""A depth gauge: pressure converted to the depth of the body origin."""

from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.sensor import Sensor, Surroundings


class DepthSettings(Settings):
    """A depth gauge whose error has a constant part (tide, air pressure, zero) and a white part."""

    rate: float = Field(default=10.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    noise: float = Field(default=0.05, ge=0.0, description="white noise, sd [m]")
    bias: float = Field(default=0.1, ge=0.0, description="bias of a trial, sd [m]")


class Depth(Sensor):
    """Measures depth (1,) [m]; takes 1 normal a reading."""

    kind, Settings = "depth", DepthSettings
    value = Variable(("down",), "float64", "m", "depth", "NED")
    sizes: ClassVar = {"down": 1}

    def __init__(self, settings: DepthSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        self.bias = settings.bias * self._noise.normals(1)[0]  # of this trial [m]

    def measure(self, truth: Truth, world: Surroundings) -> Reading:
        """Reads the gauge."""
        depth = float(truth.position[2]) + self.bias + self.settings.noise * self._noise.normals(1)[0]
        return self._reading(truth.time, np.array((depth,)))
