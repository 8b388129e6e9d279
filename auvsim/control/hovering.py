"""Position and attitude of a hovering vehicle: PID by its place and heading, level, as a force and a moment."""

import math
from dataclasses import dataclass

import numpy as np

from auvsim.base.frames import Array, rotation, wrap
from auvsim.vehicles.actuation import Wrench


@dataclass(frozen=True, kw_only=True, slots=True)
class HoveringGains:
    """Gains, each for surge, sway, heave or roll, pitch, yaw; of a vehicle of 20 to 30 kg with its added mass."""

    position: tuple[float, float, float] = (60.0, 60.0, 80.0)  # force per error [N/m]
    velocity: tuple[float, float, float] = (50.0, 50.0, 60.0)  # force per velocity over ground [N s/m]
    integral: tuple[float, float, float] = (12.0, 12.0, 15.0)  # force per integrated error [N/(m s)]
    attitude: tuple[float, float, float] = (3.0, 3.0, 6.0)  # moment per angle [N m/rad]
    rate: tuple[float, float, float] = (1.2, 1.2, 3.0)  # moment per rate [N m s/rad]
    largest: float = 60.0  # of each component of the integral's force [N]


class Hovering:
    """Holds a place and a heading, level, in any steady current: the integral finds what the current takes.

    Args:
        gains: of it.
        period: between two commands [s].
    """

    def __init__(self, gains: HoveringGains, period: float) -> None:
        self._g, self._period = gains, period
        self._steady = np.zeros(3)  # force of the integral, NED [N]

    def command(self, error: Array, attitude: Array, nu: Array, heading: float) -> Wrench:
        """The demand now.

        Args:
            error: (3,) place that is wanted less the place, NED [m].
            attitude: (3,) roll, pitch, yaw [rad].
            nu: (6,) body velocity over ground [m/s, rad/s].
            heading: that is wanted [rad].
        """
        g = self._g
        to_body = rotation(*attitude.tolist()).T
        # The integral stands in NED, as the current does, so that it holds while the vehicle turns.
        if math.hypot(*error.tolist()) < 1.0:
            self._steady = np.clip(self._steady + np.array(g.integral) * error * self._period, -g.largest, g.largest)
        force = np.array(g.position) * (to_body @ error) - np.array(g.velocity) * nu[:3] + to_body @ self._steady
        roll, pitch, yaw = attitude.tolist()
        angles = np.array((-roll, -pitch, wrap(heading - yaw)))
        moment = np.array(g.attitude) * angles - np.array(g.rate) * nu[3:]
        return Wrench(*force.tolist(), *moment.tolist())
