"""A random current, the same everywhere."""

import math

import numpy as np
from numpy.random import Generator

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.interpolation import cubic_hermite
from auvsim.water.field import ZERO_GRADIENT, Water
from auvsim.water.settings import GustSettings

# (1 + x) exp(-x) = 1/e: the correlation time of the process in units of 1 / beta (Gelb 1974, table 2.2-1).
GUST_CORRELATION = 2.146193220620583
# Knot spacing in units of 1 / beta. The variance that the cubic between knots lacks, 4 x^3 / 192, is then 2e-5.
_GUST_STEP = 0.1

MOST = 1e5  # correlation times in a gust: its knots then take 0.3 GB


class Gust:
    """One realisation of the second-order Gauss-Markov process, drawn for a whole trial.

    x'' + 2 beta x' + beta^2 x = 2 sigma beta^(3/2) w, with autocorrelation sigma^2 (1 + beta |t|) exp(-beta |t|)
    (Gelb 1974, table 2.2-1). Velocity and derivative follow the exact discrete process on the knots; between them the
    cubic through both is, to the order of the spacing, the conditional mean. A longer duration starts the same way.
    """

    steady_uniform = False

    def __init__(self, settings: GustSettings, generator: Generator, duration: float) -> None:
        beta = GUST_CORRELATION / settings.correlation_time
        self._step = _GUST_STEP / beta
        if duration / settings.correlation_time > MOST:
            raise InputError(
                f"current: a gust of correlation_time {settings.correlation_time:g} s is too long to be drawn for "
                f"{duration:g} s; give at least {duration / MOST:.3g} s, or a shorter duration"
            )
        count = math.floor(duration / self._step) + 3  # covers a step more than the duration: rounding of the time
        self._end = (count - 1) * self._step
        draws = generator.standard_normal((count, 2, 2))  # knot, axis, state
        decay = math.exp(-_GUST_STEP)
        transition = decay * np.array([[1.0 + _GUST_STEP, _GUST_STEP], [-_GUST_STEP, 1.0 - _GUST_STEP]])
        spread = np.linalg.cholesky(np.eye(2) - transition @ transition.T)
        states = np.empty((count, 2, 2))  # x / sigma and x' / (sigma beta): its stationary covariance is the identity
        states[0] = draws[0]
        for index in range(1, count):
            states[index] = states[index - 1] @ transition.T + draws[index] @ spread.T
        scaled = states * (settings.intensity * np.array([1.0, beta]))
        self._knots: list[list[float]] = scaled.reshape(count, 4).tolist()

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s], the same everywhere.

        Raises:
            InputError: If the time is outside the duration for which the gust was drawn.
        """
        if not 0.0 <= time < self._end:
            raise InputError(f"time {time} s: the gust was drawn for 0 to {self._end:g} s, build it for longer")
        index = min(int(time / self._step), len(self._knots) - 2)
        fraction = time / self._step - index
        (n0, dn0, e0, de0), (n1, dn1, e1, de1) = self._knots[index], self._knots[index + 1]
        north, north_slope = cubic_hermite(n0, n1, dn0, dn1, self._step, fraction)
        east, east_slope = cubic_hermite(e0, e1, de0, de1, self._step, fraction)
        derivative = np.array((north_slope, east_slope, 0.0))
        return Water(velocity=np.array((north, east, 0.0)), derivative=derivative, gradient=ZERO_GRADIENT)
