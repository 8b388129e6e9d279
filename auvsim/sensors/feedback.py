"""Feedback of the actuators: encoders on the fins and on the propeller shaft."""

import math
from typing import Any

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.sensor import Sensor, Surroundings
from auvsim.vehicles.library import Vehicle

_RPM = 2.0 * math.pi / 60.0  # one revolution per minute [rad/s]


class FeedbackSettings(Settings):
    """Encoders; exact by default, since an encoder's error is far below what a fin's play or a model's error is."""

    rate: float = Field(default=10.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    fin_noise_deg: float = Field(default=0.0, ge=0.0, description="white noise on each fin angle, sd [deg]")
    fin_resolution_deg: float = Field(default=0.0, ge=0.0, description="step of the fin encoders, 0 for none [deg]")
    shaft_noise_rpm: float = Field(default=0.0, ge=0.0, description="white noise on shaft speed, sd [rpm]")
    shaft_resolution_rpm: float = Field(default=0.0, ge=0.0, description="step of shaft speed, 0 for none [rpm]")


class Feedback(Sensor):
    """Measures the n fin angles [rad], then shaft speed [rad/s], (n + 1,); takes n + 1 normals a reading.

    Noise is added first and the sum rounded to the nearest step of the encoder.
    """

    kind, Settings = "feedback", FeedbackSettings

    def __init__(
        self, settings: FeedbackSettings, generator: Generator, *, vehicle: Vehicle | None = None, **of_instance: Any
    ) -> None:
        super().__init__(settings, generator, vehicle=vehicle, **of_instance)
        channels = vehicle.actuation.channels if vehicle else ()
        self.value = Variable(
            ("channel",), "float64", "rad, rad/s", "fin angles, then shaft speed", "fin hinges", labels=channels
        )
        self.sizes = {"channel": len(channels)}
        self._fin_noise = math.radians(settings.fin_noise_deg)
        self._fin_step = math.radians(settings.fin_resolution_deg)
        self._shaft_noise = settings.shaft_noise_rpm * _RPM
        self._shaft_step = settings.shaft_resolution_rpm * _RPM

    def measure(self, truth: Truth, world: Surroundings) -> Reading:
        """Reads all encoders."""
        *fins, shaft = truth.actuators.tolist()
        draws = self._noise.normals(len(fins) + 1)
        if self._fin_noise:
            fins = [fin + self._fin_noise * draw for fin, draw in zip(fins, draws, strict=False)]
        if self._fin_step:
            fins = [round(fin / self._fin_step) * self._fin_step for fin in fins]
        shaft += self._shaft_noise * draws[-1]
        if self._shaft_step:
            shaft = round(shaft / self._shaft_step) * self._shaft_step
        fins.append(shaft)
        return self._reading(truth.time, np.array(fins))
