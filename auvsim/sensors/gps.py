"""GPS: position at the surface, after a time to the first fix; it knows no heading."""

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
from auvsim.water.surface import surface


class GpsSettings(Settings):
    """A GPS receiver of code accuracy, whose antenna must be out of the water."""

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=1.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    noise: float = Field(default=1.0, gt=0.0, le=1000.0, description="white noise of each axis, sd [m]")
    wander: float = Field(
        default=1.0,
        ge=0.0,
        le=1000.0,
        description="error of each axis that changes slowly (orbits, ionosphere), sd [m]",
    )
    wander_time: float = Field(default=100.0, gt=0.0, description="correlation time of that error [s]")
    first_fix: float = Field(
        default=30.0, ge=0.0, description="time out of the water from switching on to the first fix [s]"
    )
    next_fix: float = Field(default=2.0, ge=0.0, description="the same each later time that it surfaces [s]")
    antenna: tuple[float, float, float] = Field(
        default=(-0.3, 0.0, -0.5), description="place of its antenna in the vehicle's body frame [m]"
    )


class Gps(Sensor):
    """Measures north, east (2,) [m] of the body's origin; takes 4 normals a reading, whether there is a fix or not."""

    kind, Settings = "gps", GpsSettings
    value = Variable(("north_east",), "float64", "m", "north, east", "NED")
    sizes: ClassVar = {"north_east": 2}

    def __init__(self, settings: GpsSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        self._kept = math.exp(-1.0 / (settings.rate * settings.wander_time))
        self._new = math.sqrt(1.0 - self._kept**2) * settings.wander
        self._antenna = np.array(settings.antenna)
        self.wander = settings.wander * np.array(self._noise.normals(2))  # (2,) now [m]
        self._dry_since: float | None = None
        self._found = False  # whether there has been a fix
        self._waits = 0.0  # for one since then [s]

    def measure(self, truth: Truth, world: Surroundings) -> Reading | None:
        """The position now, or None under water and before there is a fix."""
        draws = np.array(self._noise.normals(4))
        self.wander = self._kept * self.wander + self._new * draws[:2]
        antenna = truth.position + rotation(*truth.attitude.tolist()) @ self._antenna
        if antenna[2] >= -surface(world.current, truth.time, antenna).elevation:
            self._dry_since = None
            return None
        if self._dry_since is None:
            self._dry_since = truth.time
            self._waits = self.settings.next_fix if self._found else self.settings.first_fix
        if truth.time - self._dry_since < self._waits:
            return None
        self._found = True
        return self._reading(truth.time, truth.position[:2] + self.wander + self.settings.noise * draws[2:])
