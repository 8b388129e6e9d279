"""A strapdown rate gyro of three axes."""

import math
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.sensor import Sensor, Surroundings


class GyroSettings(Settings):
    """A rate gyro with white noise and a bias that walks; off in docking trials, on in manoeuvres.

    The defaults are a MEMS unit of the class in small AUVs, for which data sheets (Analog Devices ADIS16488A, Xsens
    MTi) give 0.005 to 0.007 deg/s/sqrt(Hz) and 5 to 10 deg/h. Its bias is what is left after it was zeroed at rest,
    with the earth's rate (at most 15 deg/h) in it; its random walk adds 5 deg/h in a quarter of an hour.
    """

    enabled: bool = Field(default=False, description="whether the vehicle has it")
    rate: float = Field(default=10.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    noise_density_deg: float = Field(
        default=0.005, ge=0.0, description="angular random walk: white noise as density [deg/sqrt(s)]"
    )
    bias_deg: float = Field(default=0.005, ge=0.0, description="bias at the start of a trial, sd [deg/s]")
    bias_walk_deg: float = Field(default=5e-5, ge=0.0, description="random walk of the bias as density [deg/s^1.5]")


class Gyro(Sensor):
    """Measures p, q, r (3,) [rad/s] about the body's axes; takes 6 normals a reading.

    A reading is the rate now, with the white noise of a mean over the interval: the density times the root of the rate.
    """

    kind, Settings = "gyro", GyroSettings
    value = Variable(("pqr",), "float64", "rad/s", "angular velocity p, q, r", "body")
    sizes: ClassVar = {"pqr": 3}

    def __init__(self, settings: GyroSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        self._white = math.radians(settings.noise_density_deg) * math.sqrt(settings.rate)
        self._walk = math.radians(settings.bias_walk_deg) / math.sqrt(settings.rate)
        self.bias = math.radians(settings.bias_deg) * np.array(self._noise.normals(3))  # (3,) now [rad/s]

    def measure(self, truth: Truth, world: Surroundings) -> Reading:
        """Reads the gyro."""
        draws = np.array(self._noise.normals(6))
        self.bias = self.bias + self._walk * draws[:3]
        value = truth.nu[3:] + self.bias + self._white * draws[3:]
        return self._reading(truth.time, value)
