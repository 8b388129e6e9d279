"""A steady current that changes with depth."""

from bisect import bisect_right

import numpy as np

from auvsim.base.frames import Array
from auvsim.base.interpolation import cubic_hermite
from auvsim.water.field import ZERO, Water, horizontal
from auvsim.water.settings import ShearSettings


class Shear:
    """A steady current interpolated in depth."""

    steady_uniform = False

    def __init__(self, settings: ShearSettings) -> None:
        from scipy.interpolate import PchipInterpolator

        self._linear = settings.profile == "linear"
        self._depths = [point.depth for point in settings.points]
        velocities = np.array([horizontal(point.speed, point.direction_deg) for point in settings.points])
        slopes = PchipInterpolator(self._depths, velocities).derivative()(self._depths)
        if not self._linear:
            slopes[[0, -1]] = 0.0  # joins the constant current beyond the ends without a kink; still monotone
        self._knots: list[list[float]] = np.hstack([velocities, slopes]).tolist()

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at the depth of a position (3,) in NED [m], at all times the same."""
        depths = self._depths
        depth = float(position[2])
        if not self._linear:
            depth = min(max(depth, depths[0]), depths[-1])
        index = min(max(bisect_right(depths, depth) - 1, 0), len(depths) - 2)
        width = depths[index + 1] - depths[index]
        fraction = (depth - depths[index]) / width
        (n0, e0, dn0, de0), (n1, e1, dn1, de1) = self._knots[index], self._knots[index + 1]
        north, north_slope = cubic_hermite(n0, n1, dn0, dn1, width, fraction)
        east, east_slope = cubic_hermite(e0, e1, de0, de1, width, fraction)
        gradient = np.array(((0.0, 0.0, north_slope), (0.0, 0.0, east_slope), (0.0, 0.0, 0.0)))
        return Water(velocity=np.array((north, east, 0.0)), derivative=ZERO, gradient=gradient)
