"""A current that is the same at all times and places."""

from collections.abc import Sequence

import numpy as np

from auvsim.base.frames import Array
from auvsim.water.field import ZERO, ZERO_GRADIENT, Water


class Uniform:
    """The same water at all times and places."""

    steady_uniform = True

    def __init__(self, velocity: Sequence[float]) -> None:
        array = np.array(velocity, dtype=float)
        array.setflags(write=False)  # one array serves every caller
        self._water = Water(velocity=array, derivative=ZERO, gradient=ZERO_GRADIENT)

    def evaluate(self, time: float, position: Array) -> Water:
        """The water, whatever the time and position."""
        return self._water
