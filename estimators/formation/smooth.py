"""Smooth kinematics: position and velocity, where speed and heading are measurements of a velocity that changes slowly.

Dead reckoning takes each reading of speed and heading as the motion itself, so that their noise becomes a random walk.
A vehicle of some hundred kilograms does not move like that: here the readings are averaged over the time in which its
velocity changes.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from estimators.core.errors import ParameterError
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel, ProcessModel
from estimators.formation.models import InputNoise, turned

VELOCITY = "velocity"  # kind of a measurement of the velocity
STEADY = 1e-5  # power spectral density of the acceleration of a vehicle under way [m^2/s^3]


class SmoothKinematics(ProcessModel):
    """North, east [m] and their velocities [m/s]; white acceleration.

    Args:
        noise: Of the readings of speed and heading.
        acceleration: Its power spectral density on each axis [m^2/s^3].

    Raises:
        ParameterError: A number is not positive and finite.
    """

    def __init__(self, noise: InputNoise = InputNoise(), acceleration: float = STEADY) -> None:  # noqa: B008
        if not all(math.isfinite(v) and v > 0.0 for v in (*noise, acceleration)):
            raise ParameterError(f"noise {tuple(noise)} and acceleration {acceleration} must be finite and above 0")
        self.noise, self.acceleration = noise, acceleration

    def transition(self, dt: float) -> tuple[Array, Array]:
        """Derivative (4, 4) and noise (4, 4) of a step."""
        F = np.eye(4) + dt * np.eye(4, k=2)
        blocks = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        return F, np.asarray(self.acceleration * np.kron(blocks, np.eye(2)), dtype=np.float64)

    def velocity(self, u: ArrayLike) -> Array:
        """Velocity (..., 2) [m/s] that readings (..., 2) of speed and heading mean, without bias.

        Cosine and sine of a noisy heading are too short by exp(-s^2 / 2); source: Lerro and Bar-Shalom (1993).
        """
        u = np.asarray(u, dtype=float)
        length = math.exp(self.noise.heading**2 / 2.0) * u[..., 0]
        return length[..., None] * np.stack((np.cos(u[..., 1]), np.sin(u[..., 1])), axis=-1)

    def velocity_covariance(self, velocity: ArrayLike) -> Array:
        """Covariance (..., 2, 2) of `velocity` where the true one is (..., 2), exact for Gaussian readings.

        To be taken at what is known of the velocity, not at the readings: they are sharpest across the heading that
        they give themselves, and a mean with weights of their own is too slow.
        """
        v = np.asarray(velocity, dtype=float)
        s2, square = self.noise.heading**2, (v**2).sum(axis=-1)
        course = np.arctan2(v[..., 1], v[..., 0])
        total = math.exp(s2) * (square + self.noise.speed**2)
        along = total * (1.0 + math.exp(-2.0 * s2)) / 2.0 - square
        return turned(along, total * (1.0 - math.exp(-2.0 * s2)) / 2.0, course)

    def start(self, place: ArrayLike, deviation: float, speed: float, heading: float) -> Gaussian:
        """The belief at a place known to a deviation [m] on each axis, with the velocity of a first reading."""
        velocity = self.velocity((speed, heading))
        P = np.zeros((4, 4))
        P[:2, :2], P[2:, 2:] = deviation**2 * np.eye(2), self.velocity_covariance(velocity)
        return Gaussian(mean=np.concatenate((np.asarray(place, dtype=float), velocity)), covariance=P)

    def evaluate(self, x: Array, u: ArrayLike, dt: float) -> Array:
        """States (..., 4) after `dt` [s]; there is no input."""
        return x @ self.transition(dt)[0].T

    def jacobian(self, x: Array, u: ArrayLike, dt: float) -> Array:
        """Its derivative (4, 4)."""
        return self.transition(dt)[0]

    def covariance(self, x: Array, u: ArrayLike, dt: float) -> Array:
        """Noise (4, 4) of a step."""
        return self.transition(dt)[1]

    def measured(self, stamp: float, speed: float, heading: float) -> Measurement:
        """The measurement of the velocity that readings of speed [m/s] and heading [rad] amount to."""
        value = self.velocity((speed, heading))
        R = self.velocity_covariance(value)
        return Measurement(kind=VELOCITY, value=value, covariance=R, stamp=stamp, received=stamp)


class Velocity(MeasurementModel):
    """The velocity, last two of the four states, with the covariance at the belief's own."""

    def __init__(self, kinematics: SmoothKinematics) -> None:
        self._kinematics = kinematics

    def evaluate(self, x: Array, measurement: Measurement) -> Array:
        """Velocity (2,) [m/s]."""
        return x[2:]

    def jacobian(self, x: Array, measurement: Measurement) -> Array:
        """Its derivative (2, 4)."""
        return np.eye(2, 4, 2)

    def hessian(self, x: Array, measurement: Measurement) -> Array:
        """Zero (2, 4, 4)."""
        return np.zeros((2, 4, 4))

    def covariance(self, x: Array, measurement: Measurement) -> Array:
        """Covariance (2, 2) at the velocity of the state."""
        return self._kinematics.velocity_covariance(x[2:])
