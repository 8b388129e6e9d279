"""Models of a follower: dead reckoning by speed and heading, and ranges to leaders (Li et al. 2023, eq. 1 to 3).

All take one state (2,), or many at once (k, 2), so that filters and studies of many runs share one definition. States
are north and east [m]; inputs are speed [m/s] and heading clockwise from north [rad]. The paper counts its heading
from east counter-clockwise with x to the east; its equations are these, with x for north and y for east.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimators.core.errors import ParameterError
from estimators.core.types import Array, Measurement, MeasurementModel, ProcessModel

KIND = "ranges"  # of a measurement of the ranges to all leaders at once


class InputNoise(NamedTuple):
    """Standard deviations of the dead reckoning's inputs, white from step to step."""

    speed: float = 0.3  # [m/s], the paper's
    heading: float = math.radians(5.0)  # [rad], the paper's


class DeadReckoning(ProcessModel):
    """x' = x + V dt (cos psi, sin psi), with noise where it enters: along the heading and across it.

    Args:
        noise: Of the inputs.

    Raises:
        ParameterError: A deviation is not positive and finite.
    """

    def __init__(self, noise: InputNoise = InputNoise()) -> None:  # noqa: B008 - immutable
        if not all(math.isfinite(s) and s > 0.0 for s in noise):
            raise ParameterError(f"deviations {tuple(noise)} of speed and heading must be finite and above 0")
        self.noise = noise

    def increment(self, u: ArrayLike, dt: float) -> Array:
        """The way (..., 2) [m] of inputs (..., 2) held for `dt` [s]."""
        u = np.asarray(u, dtype=float)
        return (dt * u[..., 0, None]) * np.stack((np.cos(u[..., 1]), np.sin(u[..., 1])), axis=-1)

    def evaluate(self, x: Array, u: ArrayLike, dt: float) -> Array:
        """States (..., 2) after `dt` [s]."""
        return x + self.increment(u, dt)

    def jacobian(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """The identity."""
        return np.eye(2)

    def covariance(self, x: Array, u: ArrayLike, dt: float) -> Array:
        """Noise (..., 2, 2) of one step: (dt sigma_V)^2 along the heading, (V dt sigma_psi)^2 across it."""
        u = np.asarray(u, dtype=float)
        return turned((dt * self.noise.speed) ** 2, (u[..., 0] * dt * self.noise.heading) ** 2, u[..., 1])

    def move(self, points: Array, u: ArrayLike, dt: float) -> Array:
        """States (k, 2) after `dt`, each from one of `points`."""
        return points + self.increment(u, dt)


class AugmentedDeadReckoning(DeadReckoning):
    """Dead reckoning as an unscented filter with augmented noise sees it: moments of sigma points (kappa = 0).

    The state enters the step by a sum, so sigma points of the state and of the inputs may be taken apart: with a state
    of 2 and 2 inputs there are 8 points besides the centre, 2 standard deviations away. Their mean is shorter than the
    step by about 1 - sigma_psi^2 / 2. That is right for a heading that wanders about what the compass says; where the
    compass errs about a steady heading the step already is too short by as much, and it is then too short twice.
    """

    def increment(self, u: ArrayLike, dt: float) -> Array:
        """Mean of the sigma points' ways (..., 2)."""
        return self._ways(u, dt).mean(axis=-2)

    def covariance(self, x: Array, u: ArrayLike, dt: float) -> Array:
        """Covariance of the sigma points' ways (..., 2, 2)."""
        ways = self._ways(u, dt)
        spread = ways - ways.mean(axis=-2, keepdims=True)
        return np.swapaxes(spread, -1, -2) @ spread / ways.shape[-2]

    def _ways(self, u: ArrayLike, dt: float) -> Array:
        u = np.asarray(u, dtype=float)[..., None, :]
        offsets = np.zeros((8, 2))
        offsets[0:2, 0], offsets[2:4, 1] = (2.0, -2.0), (2.0, -2.0)  # those of the state leave the inputs as they are
        return DeadReckoning.increment(self, u + offsets * np.array(self.noise), dt)


class Ranges(MeasurementModel):
    """Ranges to n leaders at once, whose places the measurement's parameters give: north and east of each in turn.

    `shown_at`, `evaluate_at` and `curvature_at` take the leaders (..., n, 2) as they are, for many states at once.
    """

    def evaluate_at(self, x: Array, leaders: Array) -> Array:
        """Ranges (..., n) [m] from states (..., >= 2)."""
        return np.linalg.norm(x[..., None, :2] - leaders, axis=-1)

    def shown_at(self, x: Array, leaders: Array) -> tuple[Array, Array]:
        """Ranges (..., n) [m], and their derivatives (..., n, d) by the states (..., d)."""
        away = x[..., None, :2] - leaders
        ranges = np.linalg.norm(away, axis=-1)
        H = np.zeros((*ranges.shape, x.shape[-1]))
        H[..., :2] = away / ranges[..., None]
        return ranges, H

    def curvature_at(self, x: Array, leaders: Array) -> Array:
        """Second derivatives (..., n, 2, 2) [1/m] by north and east: b b' / r, b across the line of sight."""
        away = x[..., None, :2] - leaders
        ranges = np.linalg.norm(away, axis=-1, keepdims=True)
        across = np.stack((-away[..., 1], away[..., 0]), axis=-1) / ranges
        return across[..., :, None] * across[..., None, :] / ranges[..., None]

    def evaluate(self, x: Array, measurement: Measurement) -> Array:
        """Ranges (n,) expected."""
        return self.evaluate_at(x, _places(measurement))

    def evaluate_each(self, points: Array, measurement: Measurement) -> Array:
        """Ranges (k, n) expected in each of the states (k, d)."""
        return self.evaluate_at(points, _places(measurement))

    def jacobian(self, x: Array, measurement: Measurement) -> Array:
        """Their derivative (n, d)."""
        return self.shown_at(x, _places(measurement))[1]

    def shown(self, x: Array, measurement: Measurement) -> tuple[Array, Array]:
        """Both."""
        return self.shown_at(x, _places(measurement))

    def hessian(self, x: Array, measurement: Measurement) -> Array:
        """Second derivatives (n, d, d)."""
        result = np.zeros((measurement.value.size, x.size, x.size))
        result[:, :2, :2] = self.curvature_at(x, _places(measurement))
        return result


def ranges_measured(stamp: float, values: ArrayLike, leaders: ArrayLike, deviations: ArrayLike) -> Measurement:
    """A measurement of the ranges (n,) [m] to leaders (n, 2) [m] with deviations (n,) [m].

    Raises:
        ParameterError: Sizes do not fit.
    """
    values, leaders = np.asarray(values, dtype=float), np.asarray(leaders, dtype=float)
    if leaders.shape != (values.size, 2):
        raise ParameterError(f"{values.size} ranges need places ({values.size}, 2), not {leaders.shape}")
    R = np.diag(np.broadcast_to(np.asarray(deviations, dtype=float), (values.size,)) ** 2)
    places = tuple(float(v) for v in leaders.ravel())
    return Measurement(kind=KIND, value=values, covariance=R, stamp=stamp, received=stamp, parameters=places)


def turned(along: ArrayLike, across: ArrayLike, course: Array) -> Array:
    """Covariances (..., 2, 2) of variances along and across a course (...,) from north, clockwise [rad]."""
    c, s = np.cos(course), np.sin(course)
    along, across = np.asarray(along, dtype=float), np.asarray(across, dtype=float)
    cross = (along - across) * c * s
    rows = np.stack((along * c**2 + across * s**2, cross, cross, along * s**2 + across * c**2), axis=-1)
    return rows.reshape((*np.shape(course), 2, 2))


def _places(measurement: Measurement) -> Array:
    return np.array(measurement.parameters).reshape(-1, 2)
