"""Maximum a posteriori estimate of a whole trajectory: Gauss-Newton on the sparse problem; a yardstick for filters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from estimators.errors import NotFiniteError
from estimators.history import Node
from estimators.loops import wrap
from estimators.types import Array, Gaussian, MeasurementModel, ProcessModel


@dataclass(frozen=True, kw_only=True, slots=True)
class Trajectory:
    """The most probable states at the nodes."""

    means: Array  # (k, n)
    cost: float  # half the sum of squared normalised residuals
    iterations: int


def solve(
    nodes: Sequence[Node[Any]],
    prior: Gaussian,
    process: ProcessModel,
    models: Mapping[str, MeasurementModel],
    guess: Array,
    *,
    angles: tuple[int, ...] = (2,),
    iterations: int = 20,
    tolerance: float = 1e-4,
) -> Trajectory:
    """The states that maximise the posterior density of all measurements of the nodes.

    Args:
        nodes: Times, inputs and measurements; those of the first node are in the prior.
        prior: Belief at the first node, with its measurements.
        process: How states move on; its noise must reach all states.
        models: What the measurements of each kind show; kinds not named are ignored.
        guess: States (k, n) to start from, those of a filter say.
        angles: States that are angles.
        iterations: At most.
        tolerance: Of the last step, in standard deviations of the prior.

    Raises:
        NotFiniteError: It does not converge.
    """
    x = np.array(guess, dtype=float)
    scale = np.sqrt(np.diagonal(prior.covariance))
    for iteration in range(1, iterations + 1):
        J, residuals = _linearised(nodes, prior, process, models, x, angles)
        step = spsolve((J.T @ J).tocsc(), -J.T @ residuals).reshape(x.shape)
        x += step
        if not np.isfinite(x).all():
            break
        if np.abs(step / scale).max() < tolerance:
            return Trajectory(means=x, cost=0.5 * float(residuals @ residuals), iterations=iteration)
    raise NotFiniteError(f"Gauss-Newton over {len(nodes)} nodes has not converged after {iterations} iterations")


def _linearised(
    nodes: Sequence[Node[Any]],
    prior: Gaussian,
    process: ProcessModel,
    models: Mapping[str, MeasurementModel],
    x: Array,
    angles: tuple[int, ...],
) -> tuple[sparse.csr_matrix, Array]:
    """Jacobian and values of the normalised residuals: prior, process noise and measurements."""
    n = x.shape[1]
    blocks: list[tuple[int, int, Array]] = []  # row, node, values
    residuals: list[Array] = []
    row = 0

    def add(values: Array, covariance: Array, *parts: tuple[int, Array]) -> None:
        nonlocal row
        L = np.linalg.cholesky(covariance)
        normalised = np.linalg.solve(L, np.column_stack((values, *(part for _, part in parts))))
        residuals.append(np.asarray(normalised[:, 0], dtype=np.float64))
        for position, (k, _) in enumerate(parts):
            part = normalised[:, 1 + n * position : 1 + n * (position + 1)]
            blocks.append((row, k, np.asarray(part, dtype=np.float64)))
        row += len(values)

    add(_wrapped(x[0] - prior.mean, angles), prior.covariance, (0, np.eye(n)))
    for k in range(1, len(nodes)):
        before, node = nodes[k - 1], nodes[k]
        u, duration = before.input, node.time - before.time
        change = _wrapped(x[k] - process.evaluate(x[k - 1], u, duration), angles)
        F, Q = process.jacobian(x[k - 1], u, duration), process.covariance(x[k - 1], u, duration)
        add(change, Q, (k - 1, -F), (k, np.eye(n)))
        for measurement in node.measurements:
            if (model := models.get(measurement.kind)) is not None:
                error = model.residual(measurement.value, model.evaluate(x[k]))
                add(error, model.covariance(x[k], measurement), (k, -model.jacobian(x[k])))
    rows = np.concatenate([np.repeat(r + np.arange(len(b)), n) for r, _, b in blocks])
    columns = np.concatenate([np.broadcast_to(k * n + np.arange(n), b.shape).ravel() for _, k, b in blocks])
    data = np.concatenate([b.ravel() for *_, b in blocks])
    return sparse.csr_matrix((data, (rows, columns)), shape=(row, x.size)), np.concatenate(residuals)


def _wrapped(difference: Array, angles: tuple[int, ...]) -> Array:
    for index in angles:
        difference[index] = wrap(difference[index])
    return difference
