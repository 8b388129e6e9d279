"""The most probable sequence on a trellis of odometry errors, and its probabilities (paper 5, eq. 7 to 13).

The likelihood of a frame sees only the motion since the frame before, so a node is the error of odometry, not a place.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Array
from estimators.map_path import kernels


@dataclass(frozen=True, kw_only=True)
class ErrorLattice:
    """What odometry may show too much: errors of speed and turn rate, a Gaussian random walk between limits."""

    speed: float = 0.3  # largest [m/s]
    turn_rate: float = np.radians(1.0)  # largest [rad/s]
    nodes: tuple[int, int] = (13, 13)  # of speed and of turn rate
    speed_walk: float = 0.085  # standard deviation of its change in 1 s [m/s]
    turn_rate_walk: float = np.radians(0.25)  # [rad/s]

    def __post_init__(self) -> None:
        sizes = (self.speed, self.turn_rate, self.speed_walk, self.turn_rate_walk)
        if not (min(sizes) > 0.0 and min(self.nodes) >= 1):
            raise ParameterError(f"{self}: limits and walks must be above 0, and there must be a node or more")

    @cached_property
    def axes(self) -> tuple[Array, Array]:
        """Errors of speed and turn rate along the two axes."""
        limits = (self.speed, self.turn_rate)
        speed, turn_rate = (
            np.linspace(-a, a, n) if n > 1 else np.zeros(1) for a, n in zip(limits, self.nodes, strict=True)
        )
        return speed, turn_rate

    @cached_property
    def errors(self) -> Array:
        """Errors (k, 2) of all nodes, the turn rate's changing fastest."""
        return np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=2).reshape(-1, 2)

    def transitions(self, duration: float) -> tuple[Array, Array]:
        """Log densities [node, node before] of the two errors' changes over `duration` [s], but for a constant."""
        walks = (self.speed_walk, self.turn_rate_walk)
        speed, turn_rate = (
            -0.5 * (axis[:, None] - axis[None, :]) ** 2 / (walk**2 * duration)
            for axis, walk in zip(self.axes, walks, strict=True)
        )
        return speed, turn_rate


def advance(scores: Array, log_likelihood: Array, transitions: tuple[Array, Array]) -> tuple[Array, np.ndarray]:
    """One step of the recursion h(x) = log L(x) + max [h'(x') + log p(x | x')] (eq. 13).

    Args:
        scores: Of the nodes before (k,).
        log_likelihood: Of the nodes (k,).
        transitions: As of `ErrorLattice.transitions`, (a, a) and (b, b) with a b = k.

    Returns:
        The nodes' scores (k,), and which of the nodes before each came from (k,).
    """
    a, b = len(transitions[0]), len(transitions[1])
    best, came_from = kernels.max_plus(np.ascontiguousarray(scores.reshape(a, b)), *transitions)
    return best.ravel() + log_likelihood, came_from.ravel()


def backtrack(last: int, came_from: Sequence[np.ndarray]) -> list[int]:
    """The nodes of the path that ends at node `last`, by what each step came from, first to last."""
    path = [int(last)]
    for step in reversed(came_from):
        path.append(int(step[path[-1]]))
    return path[::-1]


def mix(log_weights: Array, transitions: tuple[Array, Array]) -> Array:
    """Probabilities [node, node before] (k, k) of where each node came from, by sums where `advance` has maxima.

    Returns:
        Joint log probabilities, not normalised.
    """
    first, second = transitions
    a, b = len(first), len(second)
    joint = first[:, None, :, None] + second[None, :, None, :]
    return joint.reshape(a * b, a * b) + log_weights[None, :]
