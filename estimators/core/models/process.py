"""A `Motion` as a compiled process model."""

import math
from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.kernels import motion_kernels
from estimators.core.models.motion import Motion
from estimators.core.types import Array, ProcessModel


def symbols(motion: Motion) -> tuple[ca.SX, dict[str, ca.SX], ca.SX, dict[str, ca.SX]]:
    """State (n,) and input (k,) as vectors and by name."""
    x, u = ca.SX.sym("x", len(motion.space)), ca.SX.sym("u", len(motion.inputs))
    states = {name: x[k] for k, name in enumerate(motion.space.names)}
    return x, states, u, {name: u[k] for k, name in enumerate(motion.inputs)}


def derivative(motion: Motion, states: Mapping[str, ca.SX], inputs: Mapping[str, ca.SX]) -> ca.SX:
    """dx/dt (n,)."""
    rates = motion.rates(states, inputs)
    return ca.vertcat(*(rates.get(name, ca.SX(0)) for name in motion.space.names))


def step_function(motion: Motion) -> ca.Function:
    """One midpoint step (x, u, p, h) -> (x', dx'/dx, dx'/du / h); p is empty."""
    x, states, u, inputs = symbols(motion)
    h = ca.SX.sym("h")
    middle = x + h / 2 * derivative(motion, states, inputs)
    half = {name: middle[k] for k, name in enumerate(motion.space.names)}
    following = x + h * derivative(motion, half, inputs)
    outputs = [following, ca.jacobian(following, x), ca.jacobian(following, u) / h]
    return ca.Function(motion.name, [x, u, ca.SX.sym("p", 0), h], ca.cse(outputs))


class MotionProcess(ProcessModel):
    """A motion with noise, in substeps short enough for the midpoint rule.

    Args:
        motion: How the state moves.
        noise: Power spectral densities of the states' noise by name [unit^2/s]; those not named have none.
        input_noise: Power spectral densities of the inputs' noise by name [unit^2 s]; it acts where the input acts, so
            that a unicycle's speed errs along its heading.
        max_substep: Longest substep [s].

    Raises:
        ParameterError: There is no state or input of a name, or a density is below 0.
    """

    def __init__(
        self,
        motion: Motion,
        noise: Mapping[str, float],
        *,
        input_noise: Mapping[str, float] | None = None,
        max_substep: float = 0.5,
    ) -> None:
        self.motion, self.space = motion, motion.space
        self.angles = motion.space.angles
        self.noise = motion.space.vector(noise)
        unknown = [name for name in input_noise or {} if name not in motion.inputs]
        if unknown:
            raise ParameterError(f"no input '{unknown[0]}'; there are {', '.join(motion.inputs) or 'none'}")
        self.input_noise = np.array([(input_noise or {}).get(name, 0.0) for name in motion.inputs])
        if not ((self.noise >= 0.0).all() and (self.input_noise >= 0.0).all() and max_substep > 0.0):
            raise ParameterError(f"noise {noise}, {input_noise} must be >= 0 and the substep {max_substep} s above 0")
        self._max_substep, self._p = max_substep, np.zeros(0)
        kernels = motion_kernels(step_function(motion), motion.space.angles)
        self._predict, self._move = kernels.predict, kernels.move

    def evaluate(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """State after `dt` [s] with the input held."""
        return self.propagate(x, np.zeros((x.size, x.size)), u, dt)[0]

    def jacobian(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Derivative of `evaluate`: the product of the substeps' Jacobians."""
        return self._linearised(x, np.zeros((x.size, x.size)), u, dt)[2]

    def covariance(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Noise gathered over `dt`."""
        return self.propagate(x, np.zeros((x.size, x.size)), u, dt)[1]

    def propagate(self, mean: Array, covariance: Array, u: Sequence[float], dt: float) -> tuple[Array, Array, int]:
        """Mean and covariance after `dt` in one compiled call, and the substeps it took."""
        x, P, _, finite = self._linearised(mean, covariance, u, dt)
        if not finite:
            raise NotFiniteError(f"prediction over {dt:g} s from {mean} with input {u} is not finite")
        return x, P, self._substeps(dt)

    def move(self, points: Array, u: Sequence[float], dt: float) -> Array:
        """States (k, n) after `dt`, each from one of `points` (k, n); angles are not wrapped."""
        moved = np.array(points, dtype=float)
        self._move(moved, tuple(map(float, u)), self._p, dt, self._substeps(dt))
        return moved

    def _linearised(self, mean: Array, covariance: Array, u: Sequence[float], dt: float):
        given = tuple(map(float, u))
        if len(given) != self.input_noise.size:
            raise ParameterError(f"input {given} must be {', '.join(self.motion.inputs) or 'empty'}")
        return self._predict(mean, covariance, given, self._p, self.noise, self.input_noise, dt, self._substeps(dt))

    def _substeps(self, dt: float) -> int:
        return max(1, math.ceil(dt / self._max_substep - 1e-9))
