"""Positions from elsewhere: GPS at the surface, or a long-baseline or ship's USBL system below it."""

from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.sensor import Sensor, Surroundings


class FixSettings(Settings):
    """Positions from elsewhere: north and east from the datum."""

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=0.1, gt=0.0, description="readings per second, divides the control rate [Hz]")
    noise: float = Field(default=0.5, gt=0.0, description="white noise of each axis, sd [m]")
    bias: float = Field(default=0.0, ge=0.0, description="bias of a trial, each axis, sd [m]")
    deepest: float | None = Field(
        default=None, ge=0.0, description="depth below which there is none: 0.5 for GPS; none: it works anywhere [m]"
    )
    dropout_probability: float = Field(default=0.0, ge=0.0, le=1.0, description="share of readings lost [-]")


class Fix(Sensor):
    """Measures north, east (2,) [m]; takes 2 normals and 1 uniform a reading, lost or not."""

    kind, Settings = "fix", FixSettings
    value = Variable(("north_east",), "float64", "m", "north, east", "NED")
    sizes: ClassVar = {}

    def __init__(self, settings: FixSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        self.bias = settings.bias * np.array(self._noise.normals(2))  # (2,) of this trial [m]

    def measure(self, truth: Truth, world: Surroundings) -> Reading | None:
        """The position now, or None where there is none."""
        settings = self.settings
        noise, (chance,) = np.array(self._noise.normals(2)), self._noise.uniforms(1)
        if settings.deepest is not None and truth.position[2] > settings.deepest:
            return None
        if chance < settings.dropout_probability:
            return None
        return self._reading(truth.time, truth.position[:2] + self.bias + settings.noise * noise)
