"""A steady current slowed by the sea floor."""

import math

import numpy as np

from auvsim.base.frames import Array
from auvsim.water.field import ZERO, Water, horizontal
from auvsim.water.settings import BoundaryLayerSettings


class BoundaryLayer:
    """The logarithmic law of the wall, u proportional to ln(1 + h / z_0) at a height h (Soulsby 1997, eq. 24).

    The height saturates between half a thickness and one and a half, so that the gradient is continuous. Below the
    floor the water is still.
    """

    steady_uniform = False

    def __init__(self, settings: BoundaryLayerSettings) -> None:
        self._floor, self._thickness, self._roughness = settings.floor, settings.thickness, settings.roughness
        scale = 1.0 / math.log1p(settings.thickness / settings.roughness)
        self._velocity = np.array([*horizontal(settings.speed, settings.direction_deg), 0.0]) * scale

    def evaluate(self, time: float, position: Array) -> Water:
        """The water at the depth of a position (3,) in NED [m], at all times the same."""
        thickness = self._thickness
        height = max(self._floor - float(position[2]), 0.0)
        over = min(max(height - 0.5 * thickness, 0.0), thickness)
        felt = min(height, 1.5 * thickness) - 0.5 * over * over / thickness
        slope = (1.0 - over / thickness) / (self._roughness + felt)
        gradient = np.zeros((3, 3))
        gradient[:, 2] = -slope * self._velocity if position[2] <= self._floor else 0.0
        velocity = math.log1p(felt / self._roughness) * self._velocity
        return Water(velocity=velocity, derivative=ZERO, gradient=gradient)
