"""Roll, pitch and heading by a complementary filter: a gyro's rates, drawn slowly to what the compass shows."""

import math

import numpy as np

from auvsim.base.frames import Array, wrap


class Attitude:
    """Euler angles that follow a gyro and forget its bias; by the compass alone where there is no gyro.

    Args:
        time_constant: in which they are drawn to the compass [s].
    """

    def __init__(self, time_constant: float = 1.0) -> None:
        self._constant = time_constant
        self.angles: Array | None = None  # (3,) roll, pitch, heading [rad]; None before the first compass reading
        self.rates = np.zeros(3)  # (3,) body rates p, q, r [rad/s]
        self._stamp = 0.0  # up to which the angles have been turned [s]
        self._shown = -math.inf  # stamp of the last compass reading [s]
        self._gyro = False

    def turned(self, stamp: float, rates: Array) -> None:
        """Takes body rates (3,) of a gyro at a stamp [s], which hold since the last."""
        self._gyro, self.rates = True, rates
        self._turn(stamp)

    def shown(self, stamp: float, angles: Array) -> None:
        """Takes roll, pitch, heading (3,) of a compass at a stamp [s]."""
        if self.angles is None:
            self.angles, self._stamp, self._shown = angles, stamp, stamp
            return
        dt = stamp - self._shown
        if dt <= 0.0:
            return
        self._turn(stamp)
        off = np.array([wrap(value) for value in (angles - self.angles).tolist()])
        gain = min(1.0, dt / self._constant)
        self.angles = self.angles + gain * off
        if not self._gyro:  # critically damped
            self.rates = self.rates + 0.25 * gain * gain / dt * off
        self._shown = stamp

    def _turn(self, stamp: float) -> None:
        """Turns the angles by the rates up to a stamp; Euler's kinematics (Fossen 2021, eq. 2.41)."""
        dt = stamp - self._stamp
        if self.angles is None or dt <= 0.0:
            return
        roll, pitch, _ = self.angles.tolist()
        p, q, r = self.rates.tolist()
        across = q * math.sin(roll) + r * math.cos(roll)
        turned = np.array(
            (p + across * math.tan(pitch), q * math.cos(roll) - r * math.sin(roll), across / math.cos(pitch))
        )
        self.angles = self.angles + turned * dt
        self._stamp = stamp
