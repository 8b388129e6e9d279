"""A graph of poses in the plane and its least squares solution: sparse Gauss-Newton with robust weights."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.types import Array
from estimators.map_path.poses import between, wrapped

if TYPE_CHECKING:
    from scipy import sparse


class Edge(NamedTuple):
    """Where one pose lies relative to another."""

    first: int
    second: int
    relative: Array  # (3,) forward, starboard [m], turn [rad] of the second from the first
    covariance: Array  # (3, 3)


@dataclass(frozen=True, kw_only=True, slots=True)
class GraphSolution:
    """The most probable poses."""

    poses: Array  # (n, 3)
    weights: Array  # (edges,) 1, and less where a robust loss doubts an edge
    cost: float  # half the weighted sum of squared normalised residuals
    iterations: int
    information: "sparse.csc_matrix"  # (3 n, 3 n) with the prior of the first pose

    def covariance(self, index: int) -> Array:
        """Covariance (3, 3) of a pose given the whole graph."""
        from scipy.sparse.linalg import splu

        place = index % len(self.poses) * 3
        unit = np.zeros((3 * len(self.poses), 3))
        unit[place : place + 3] = np.eye(3)
        return splu(self.information).solve(unit)[place : place + 3]


def optimise(
    guess: Array,
    edges: Sequence[Edge],
    prior: Array,
    *,
    fixes: Sequence[tuple[int, Array, Array]] = (),
    huber: float | None = 3.0,
    iterations: int = 100,
    tolerance: float = 1e-4,
) -> GraphSolution:
    """Poses that minimise the squares of the edges' normalised residuals.

    Args:
        guess: Poses (n, 3) to start from; the first is the mean of its prior.
        edges: Relative poses.
        prior: Covariance (3, 3) of the first pose.
        fixes: Pose's index, place (2,) north, east [m], and covariance (2, 2), of a second GPS fix say.
        huber: Normalised residual (root of the sum of the edge's squares) beyond which the cost is linear; None: never.
        iterations: At most.
        tolerance: Of the last step [m, rad].

    Raises:
        ParameterError: An edge is of a pose that is not there, or of a pose with itself.
        NotFiniteError: It does not converge.
    """
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    poses = np.array(guess, dtype=float)
    first, second = (np.array([e[k] for e in edges], dtype=int) for k in (0, 1))
    if len(edges) and not (min(first.min(), second.min()) >= 0 and max(first.max(), second.max()) < len(poses)):
        raise ParameterError(f"an edge is of a pose that is not among the {len(poses)}")
    if (first == second).any():
        raise ParameterError("an edge joins a pose to itself")
    measured = np.array([e.relative for e in edges]).reshape(-1, 3)
    whitening = np.linalg.inv(np.linalg.cholesky(np.array([e.covariance for e in edges]).reshape(-1, 3, 3)))
    for iteration in range(1, iterations + 1):
        residuals, by_first, by_second = _residuals(poses, first, second, measured)
        whitened = np.einsum("eij,ej->ei", whitening, residuals)
        sizes = np.sqrt(np.sum(whitened**2, axis=1))
        weights = np.ones(len(edges)) if huber is None else huber / np.maximum(sizes, huber)
        roots = np.sqrt(weights)[:, None, None] * whitening
        J = _jacobian(roots @ by_first, roots @ by_second, first, second, len(poses))
        r = (np.sqrt(weights)[:, None] * whitened).ravel()
        information, gradient = (J.T @ J).tolil(), J.T @ r
        start = np.linalg.inv(prior)
        information[:3, :3] += start
        gradient[:3] += start @ np.append(poses[0, :2] - guess[0, :2], wrapped(poses[0, 2] - guess[0, 2]))
        for index, place, covariance in fixes:
            inverse, at = np.linalg.inv(covariance), slice(3 * index, 3 * index + 2)
            information[at, at] += inverse
            gradient[at] += inverse @ (poses[index, :2] - place)
        information = csc_matrix(information)
        try:
            step = -splu(information).solve(gradient).reshape(-1, 3)
        except RuntimeError:  # singular, after poses have run away
            break
        poses = poses + step
        poses[:, 2] = wrapped(poses[:, 2])
        if not np.isfinite(poses).all():
            break
        if np.abs(step).max() < tolerance:
            cost = 0.5 * float(r @ r)
            return GraphSolution(poses=poses, weights=weights, cost=cost, iterations=iteration, information=information)
    raise NotFiniteError(f"Gauss-Newton over {len(poses)} poses has not converged after {iterations} iterations")


def _residuals(poses: Array, first: np.ndarray, second: np.ndarray, measured: Array) -> tuple[Array, Array, Array]:
    """Residuals (e, 3) and their derivatives (e, 3, 3) by the first and the second poses."""
    relative = between(poses[first], poses[second])
    residuals = relative - measured
    residuals[:, 2] = wrapped(residuals[:, 2])
    c, s = np.cos(poses[first, 2]), np.sin(poses[first, 2])
    by_second = np.zeros((len(first), 3, 3))
    by_second[:, 0, 0], by_second[:, 0, 1], by_second[:, 1, 0], by_second[:, 1, 1] = c, s, -s, c
    by_second[:, 2, 2] = 1.0
    by_first = -by_second
    by_first[:, 0, 2], by_first[:, 1, 2] = relative[:, 1], -relative[:, 0]
    return residuals, by_first, by_second


def _jacobian(by_first: Array, by_second: Array, first: np.ndarray, second: np.ndarray, count: int):
    """The sparse Jacobian (3 e, 3 n)."""
    from scipy.sparse import csr_matrix

    rows = 3 * np.arange(len(first))[:, None, None] + np.arange(3)[:, None]
    parts, columns = [], []
    for block, index in ((by_first, first), (by_second, second)):
        parts.append(block.ravel())
        columns.append(np.broadcast_to(3 * index[:, None, None] + np.arange(3), block.shape).ravel())
    row = np.broadcast_to(rows, by_first.shape).ravel()
    data, place = np.concatenate(parts), (np.concatenate((row, row)), np.concatenate(columns))
    return csr_matrix((data, place), shape=(3 * len(first), 3 * count))
