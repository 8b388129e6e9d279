"""An altimeter: an echo sounder under the hull that measures the range to the sea floor along its axis."""

import math
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.base.frames import Array, rotation
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.floor_rays import slant_range
from auvsim.sensors.sensor import Sensor, Surroundings

RING = 6  # rays on each of two rings in the beam, beside the one in its axis


class AltimeterSettings(Settings):
    """An echo sounder that looks down: the first echo within its beam."""

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=5.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    beam_deg: float = Field(default=6.0, ge=0.0, le=60.0, description="full width of its beam; 0: a ray [deg]")
    noise: float = Field(default=0.02, ge=0.0, le=10.0, description="white noise, sd [m]")
    scale_error: float = Field(
        default=0.003, ge=0.0, le=0.1, description="scale error of a trial (sound speed), sd [-]"
    )
    minimum_range: float = Field(default=0.3, ge=0.0, description="range below which it measures nothing [m]")
    maximum_range: float = Field(default=50.0, gt=0.0, description="range beyond which there is no echo [m]")
    dropout_probability: float = Field(default=0.01, ge=0.0, le=1.0, description="share of readings lost [-]")

    @model_validator(mode="after")
    def _ranges_rise(self) -> "AltimeterSettings":
        if self.maximum_range <= self.minimum_range:
            raise ValueError(f"maximum_range must be more than minimum_range, {self.minimum_range:g} m")
        return self


class Altimeter(Sensor):
    """Measures the range (1,) [m] from the body's origin to the floor; takes 1 normal and 1 uniform a reading.

    It is fixed to the hull: on a pitched or rolled vehicle its axis is not the vertical.
    """

    kind, Settings = "altimeter", AltimeterSettings
    value = Variable(("range",), "float64", "m", "range to the sea floor, along the hull's downward axis", "body")
    sizes: ClassVar = {"range": 1}

    def __init__(self, settings: AltimeterSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        self.scale = 1.0 + settings.scale_error * self._noise.normals(1)[0]  # of this trial [-]
        self._rays = _cone(0.5 * math.radians(settings.beam_deg))

    def measure(self, truth: Truth, world: Surroundings) -> Reading | None:
        """The range now, or None where there is no echo."""
        settings = self.settings
        (draw,), (chance,) = self._noise.normals(1), self._noise.uniforms(1)
        directions = self._rays @ rotation(*truth.attitude.tolist()).T
        distance = min(slant_range(world.terrain, truth.position, ray) for ray in directions)
        heard = settings.minimum_range <= distance <= settings.maximum_range
        if not heard or chance < settings.dropout_probability:
            return None
        return self._reading(truth.time, np.array((self.scale * distance + settings.noise * draw,)))


def _cone(half: float) -> Array:
    """Unit vectors (n, 3) in the body's axes: the downward one, and two rings about it out to an angle [rad]."""
    rays = [(0.0, 0.0, 1.0)]
    for angle in (0.5 * half, half) if half > 0.0 else ():
        for k in range(RING):
            around = 2.0 * math.pi * k / RING
            aside = math.sin(angle)
            rays.append((aside * math.cos(around), aside * math.sin(around), math.cos(angle)))
    return np.array(rays)
