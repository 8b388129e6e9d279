"""A depth gauge: pressure converted to the depth of the body origin."""

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.randomness import Noise
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.physics.truth import Truth


class DepthSettings(Settings):
    """A depth gauge whose error has a constant part (tide, air pressure, zero) and a white part."""

    rate: float = Field(default=10.0, gt=0.0, description="readings a second, divides the control rate [Hz]")
    noise: float = Field(default=0.05, ge=0.0, description="white noise, sd [m]")
    bias: float = Field(default=0.1, ge=0.0, description="bias of a trial, sd [m]")


class Depth:
    """Measures depth (1,) [m]; takes 1 normal a reading."""

    name = "depth"

    def __init__(self, settings: DepthSettings, generator: Generator) -> None:
        self._draws = Noise(generator)
        self._noise = settings.noise
        self.bias = settings.bias * self._draws.normals(1)[0]  # of this trial [m]
        self._sequence = 0

    def measure(self, truth: Truth) -> Reading:
        """Reads the gauge."""
        depth = float(truth.position[2]) + self.bias + self._noise * self._draws.normals(1)[0]
        sequence = self._sequence
        self._sequence = sequence + 1
        return Reading("depth", truth.time, truth.time, np.array((depth,)), sequence)
