"""Feedback of the actuators: encoders on the fins and on the propeller shaft."""

import math

import numpy as np
from numpy.random import Generator
from pydantic import Field

from auvsim.base.randomness import Noise
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.physics.truth import Truth

_RPM = 2.0 * math.pi / 60.0  # one revolution per minute [rad/s]


class FeedbackSettings(Settings):
    """Encoders; exact by default, since an encoder's error is far below what a fin's play or a model's error is."""

    rate: float = Field(default=10.0, gt=0.0, description="readings a second, divides the control rate [Hz]")
    fin_noise_deg: float = Field(default=0.0, ge=0.0, description="white noise on each fin angle, sd [deg]")
    fin_resolution_deg: float = Field(default=0.0, ge=0.0, description="step of the fin encoders, 0 for none [deg]")
    shaft_noise_rpm: float = Field(default=0.0, ge=0.0, description="white noise on shaft speed, sd [rpm]")
    shaft_resolution_rpm: float = Field(default=0.0, ge=0.0, description="step of shaft speed, 0 for none [rpm]")


class Feedback:
    """Measures the n fin angles [rad], then shaft speed [rad/s], (n + 1,); takes n + 1 normals a reading.

    Noise is added first and the sum rounded to the nearest step of the encoder.
    """

    name = "feedback"

    def __init__(self, settings: FeedbackSettings, generator: Generator) -> None:
        self._noise = Noise(generator)
        self._fin_noise = math.radians(settings.fin_noise_deg)
        self._fin_step = math.radians(settings.fin_resolution_deg)
        self._shaft_noise = settings.shaft_noise_rpm * _RPM
        self._shaft_step = settings.shaft_resolution_rpm * _RPM
        self._sequence = 0

    def measure(self, truth: Truth) -> Reading:
        """Reads all encoders."""
        fins = truth.fins.tolist()
        draws = self._noise.normals(len(fins) + 1)
        if self._fin_noise:
            fins = [fin + self._fin_noise * draw for fin, draw in zip(fins, draws, strict=False)]
        if self._fin_step:
            fins = [round(fin / self._fin_step) * self._fin_step for fin in fins]
        shaft = float(truth.shaft_speed) + self._shaft_noise * draws[-1]
        if self._shaft_step:
            shaft = round(shaft / self._shaft_step) * self._shaft_step
        fins.append(shaft)
        sequence = self._sequence
        self._sequence = sequence + 1
        return Reading("feedback", truth.time, truth.time, np.array(fins), sequence)
