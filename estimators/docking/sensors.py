"""What the compass and the dock's USBL show of the state of a docking filter."""

import math

import numpy as np

from estimators.core.loops import wrap
from estimators.core.types import Array, Measurement, MeasurementModel

COMPASS, USBL = "compass", "usbl"  # kinds of measurement


class HeadingModel(MeasurementModel):
    """A compass: y = psi, plus the state `bias` if given; a MeasurementModel of `n` states, psi the third."""

    is_linear = is_angle = True

    def __init__(self, n: int = 8, bias: int | None = None) -> None:
        self._bias = bias
        self._H = np.eye(1, n, 2)
        if bias is not None:
            self._H[0, bias] = 1.0

    def evaluate(self, x: Array, measurement: Measurement | None = None) -> Array:
        return x[2:3] if self._bias is None else x[2:3] + x[self._bias]

    def jacobian(self, x: Array, measurement: Measurement | None = None) -> Array:
        return self._H

    def residual(self, value: Array, expected: Array) -> Array:
        return np.array((wrap(float(value[0]) - float(expected[0])),))


class PositionModel(MeasurementModel):
    """The horizontal position (north, east) of a point (x, y) [m] of the hull, forward and starboard of its origin.

    As the dock reports it: turned about the dock by the error of its compass, the state `dock_heading`, and taken later
    than its stamp says by the state `clock`, to first order; None where that is no state. States have `n` elements.
    """

    def __init__(
        self,
        point: tuple[float, float] = (0.0, 0.0),
        n: int = 8,
        *,
        dock_heading: int | None = None,
        clock: int | None = None,
    ) -> None:
        self._x, self._y = point
        self._H = np.eye(2, n)
        self._dock_heading, self._clock = dock_heading, clock
        self.is_linear = dock_heading is None and clock is None and point == (0.0, 0.0)

    def evaluate(self, x: Array, measurement: Measurement | None = None) -> Array:
        return self.shown(x)[0]

    def jacobian(self, x: Array, measurement: Measurement | None = None) -> Array:
        return self.shown(x)[1]

    def shown(self, x: Array, measurement: Measurement | None = None) -> tuple[Array, Array]:
        c, s = math.cos(x[2]), math.sin(x[2])
        H = self._H.copy()
        north, east = c * self._x - s * self._y, s * self._x + c * self._y
        H[0, 2], H[1, 2] = -east, north
        if self._clock is not None:
            delay = x[self._clock]
            ahead, abeam = c * x[3] - s * x[4], s * x[3] + c * x[4]  # velocity through the water, north and east
            north += delay * (ahead + x[6])
            east += delay * (abeam + x[7])
            H[0, 2] -= delay * abeam
            H[1, 2] += delay * ahead
            H[:, 3:5] = delay * np.array(((c, -s), (s, c)))
            H[0, 6] = H[1, 7] = delay
            H[:, self._clock] = ahead + x[6], abeam + x[7]
        value = np.array((x[0] + north, x[1] + east))
        if self._dock_heading is not None:
            # The dock's heading is measured too large, and with it the bearing of all that the dock measures.
            c, s = math.cos(x[self._dock_heading]), math.sin(x[self._dock_heading])
            R = np.array(((c, -s), (s, c)))
            value, H = R @ value, R @ H
            H[:, self._dock_heading] = -value[1], value[0]
        return value, H
