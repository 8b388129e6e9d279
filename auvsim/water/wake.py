"""Wake of a structure: the velocity deficit of the current behind it."""

import math

import numpy as np

from auvsim.base.frames import Array
from auvsim.water.field import ZERO, Water, horizontal
from auvsim.water.settings import WakeSettings


class Wake:
    """A round wake of Gaussian profile that conserves momentum and volume.

    On the axis the deficit is `U d`, `d = 1 - sqrt(1 - m / s^2)`, with `m` the drag area over 2 pi and `s` the standard
    deviation of the profile, which grows along the stream (Bastankhah & Porté-Agel 2014, eq. 19, written with the drag
    area). The deficit begins smoothly, within a third of s; the flow across the stream, inward where the
    wake fills up, is the one that conserves volume. Turbulence is left out.
    """

    steady_uniform = False

    def __init__(self, settings: WakeSettings) -> None:
        self._place = np.array([settings.north, settings.east, settings.depth])
        north, east = horizontal(1.0, settings.direction_deg)
        self._axes = np.array([[north, east, 0.0], [-east, north, 0.0], [0.0, 0.0, 1.0]])  # along, starboard, down
        self._speed, self._growth = settings.speed, settings.growth
        self._moment = settings.drag_area / (2.0 * math.pi)
        self._width = math.sqrt(self._moment / (settings.lee * (2.0 - settings.lee)))

    def _profile(self, x: float) -> tuple[Array, Array]:
        """At x [m] along the stream: variance `s^2` of the profile, and volume missing `q = s^2 d` per 2 pi U.

        Each as (3,): value, first and second derivative in x.
        """
        width, growth, begins = self._width, self._growth, self._width / 3.0
        rise = math.exp(-abs(x) / begins)
        soft = max(x, 0.0) + begins * math.log1p(rise)  # max(x, 0), smoothly
        begin = 1.0 / (1.0 + rise) if x >= 0.0 else rise / (1.0 + rise)  # its slope, from 0 to 1
        curve = rise / (begins * (1.0 + rise) ** 2)
        s = width + growth * soft
        variance = np.array([s * s, 2.0 * s * growth * begin, 2.0 * growth * (growth * begin**2 + s * curve)])
        # q = v - sqrt(v^2 - m v), times `begin`.
        v, m = variance[0], self._moment
        root = math.sqrt(v * v - m * v)
        first = 1.0 - (v - 0.5 * m) / root
        second = 0.25 * m * m / root**3
        missing = np.array([v - root, first * variance[1], second * variance[1] ** 2 + first * variance[2]])
        starts = np.array([begin, curve, curve * (1.0 - 2.0 * begin) / begins])
        value = missing[0] * starts[0]
        slope = missing[1] * starts[0] + missing[0] * starts[1]
        bend = missing[2] * starts[0] + 2.0 * missing[1] * starts[1] + missing[0] * starts[2]
        return variance, np.array([value, slope, bend])

    def evaluate(self, time: float, position: Array) -> Water:
        """The change that the structure makes at a position (3,) in NED [m], at all times the same."""
        x, y, z = (self._axes @ (np.asarray(position, dtype=float) - self._place)).tolist()
        (v, v1, v2), (q, q1, q2) = (values.tolist() for values in self._profile(x))
        rho = 0.5 * (y * y + z * z) / v
        e = math.exp(-rho)
        filled = -math.expm1(-rho) / rho if rho > 1e-4 else 1.0 - 0.5 * rho  # (1 - e) / rho
        filled1 = (e - filled) / rho if rho > 1e-4 else -0.5 + rho / 3.0  # its derivative
        rho_x = -rho * v1 / v
        along = -e * q / v
        along_x = -e * (q1 / v - q * v1 / v**2) - along * rho_x
        # Across, (y, z) b, so that the divergence is zero.
        b = 0.5 * (q1 * filled - q * e * v1 / v) / v
        b_rho = 0.5 * (q1 * filled1 + q * e * v1 / v) / v
        change = q2 * filled - q1 * e * v1 / v - q * e * (v2 / v - (v1 / v) ** 2)
        b_x = 0.5 * change / v - b * v1 / v + b_rho * rho_x
        velocity = self._speed * np.array([along, y * b, z * b])
        gradient = self._speed * np.array(
            [
                [along_x, -along * y / v, -along * z / v],
                [y * b_x, b + y * y * b_rho / v, y * z * b_rho / v],
                [z * b_x, y * z * b_rho / v, b + z * z * b_rho / v],
            ]
        )
        axes = self._axes
        return Water(velocity=velocity @ axes, derivative=ZERO, gradient=axes.T @ gradient @ axes)
