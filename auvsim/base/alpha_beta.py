"""The alpha-beta filter: a sampled quantity and its rate, smoothed with constant gains (Bar-Shalom 2001, sec. 6.5)."""

import math

from auvsim.base.frames import wrap


class AlphaBeta:
    """Estimates the value and rate of a quantity from repeated measurements.

    Args:
        alpha: gain of the value [-].
        beta: gain of the rate [-].
        angle: whether the quantity is an angle [rad], whose innovations wrap.
    """

    def __init__(self, alpha: float, beta: float, *, angle: bool = False) -> None:
        self._alpha, self._beta, self._angle = alpha, beta, angle
        self.value: float | None = None  # None before the first measurement
        self.rate = 0.0  # [1/s]
        self.stamp = 0.0  # of the last measurement [s]

    @classmethod
    def of_index(cls, tracking_index: float, *, angle: bool = False) -> "AlphaBeta":
        """The steady-state filter of a tracking index: acceleration noise x period^2 / measurement noise [-]."""
        damping = (4 + tracking_index - math.sqrt(8 * tracking_index + tracking_index**2)) / 4
        alpha = 1 - damping**2
        return cls(alpha, 2 * (2 - alpha) - 4 * math.sqrt(1 - alpha), angle=angle)

    def update(self, stamp: float, measured: float) -> None:
        """Takes a measurement at its stamp [s]; one that is not later than the last is ignored."""
        if self.value is None:
            self.value, self.stamp = measured, stamp
            return
        dt = stamp - self.stamp
        if dt <= 0.0:
            return
        innovation = measured - self.value - self.rate * dt
        if self._angle:
            innovation = wrap(innovation)
        self.value += self.rate * dt + self._alpha * innovation
        self.rate += self._beta * innovation / dt
        self.stamp = stamp

    def at(self, time: float) -> float | None:
        """The value at a time [s], extrapolated at the last rate; None before the first measurement."""
        return None if self.value is None else self.value + self.rate * (time - self.stamp)
