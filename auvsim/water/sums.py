"""Sums of currents."""

from collections.abc import Sequence

from auvsim.base.frames import Array
from auvsim.water.field import ZERO, ZERO_GRADIENT, CurrentField, Water


class Sum:
    """The sum of current fields."""

    def __init__(self, terms: Sequence[CurrentField]) -> None:
        self.terms = tuple(terms)
        self.steady_uniform = all(term.steady_uniform for term in terms)

    def evaluate(self, time: float, position: Array) -> Water:
        """The sum of the terms at a time [s] and a position (3,) in NED [m]."""
        velocity, derivative, gradient = ZERO, ZERO, ZERO_GRADIENT
        for term in self.terms:
            water = term.evaluate(time, position)
            velocity = velocity + water.velocity
            derivative = derivative + water.derivative
            gradient = gradient + water.gradient
        return Water(velocity=velocity, derivative=derivative, gradient=gradient)
