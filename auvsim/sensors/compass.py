"""A tilt-compensated compass: heading, pitch and roll of the vehicle."""

import math
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.sensor import Sensor, Surroundings


class CompassSettings(Settings):
    """A compass whose heading error has a constant part and a white part."""

    rate: float = Field(default=10.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    heading_noise_deg: float = Field(default=1.0, ge=0.0, description="white noise on heading, sd [deg]")
    heading_bias_deg: float = Field(default=0.5, ge=0.0, description="heading bias of a trial, sd [deg]")
    tilt_noise_deg: float = Field(default=0.5, ge=0.0, description="white noise on pitch and on roll, sd [deg]")


class Compass(Sensor):
    """Measures heading, pitch and roll (3,) [rad]; takes 3 normals a reading."""

    kind, Settings = "compass", CompassSettings
    value = Variable(("heading_pitch_roll",), "float64", "rad", "heading, pitch, roll", "body to NED")
    sizes: ClassVar = {"heading_pitch_roll": 3}

    def __init__(self, settings: CompassSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        self._heading_noise = math.radians(settings.heading_noise_deg)
        self._tilt_noise = math.radians(settings.tilt_noise_deg)
        self.heading_bias = math.radians(settings.heading_bias_deg) * self._noise.normals(1)[0]  # of this trial [rad]

    def measure(self, truth: Truth, world: Surroundings) -> Reading:
        """Reads the compass; the heading is in (-pi, pi]."""
        roll, pitch, yaw = truth.attitude.tolist()
        heading_draw, pitch_draw, roll_draw = self._noise.normals(3)
        heading = wrap(yaw + self.heading_bias + self._heading_noise * heading_draw)
        value = np.array((heading, pitch + self._tilt_noise * pitch_draw, roll + self._tilt_noise * roll_draw))
        return self._reading(truth.time, value)
