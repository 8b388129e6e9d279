"""A uniform current that changes with time as given at some knots."""

from bisect import bisect_right

import numpy as np

from auvsim.base.frames import Array
from auvsim.water.field import ZERO, ZERO_GRADIENT, Water
from auvsim.water.settings import KnotsSettings


class Knots:
    """A uniform current, linear in time between knots, constant before the first and after the last.

    So it never is faster, nor changes faster, than at and between the knots. The derivative jumps at the knots; there
    it is the one that follows.
    """

    steady_uniform = False

    def __init__(self, settings: KnotsSettings) -> None:
        self._times = [knot.time for knot in settings.knots]
        self._velocities = [np.array((knot.north, knot.east, 0.0)) for knot in settings.knots]

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at a time [s], the same everywhere."""
        after = bisect_right(self._times, time)
        if after in (0, len(self._times)):
            return Water(velocity=self._velocities[max(after - 1, 0)], derivative=ZERO, gradient=ZERO_GRADIENT)
        start, first, last = self._times[after - 1], self._velocities[after - 1], self._velocities[after]
        rate = (last - first) / (self._times[after] - start)
        return Water(velocity=first + (time - start) * rate, derivative=rate, gradient=ZERO_GRADIENT)
