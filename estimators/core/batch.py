"""Maximum a posteriori estimate of a whole trajectory: Gauss-Newton on the sparse problem; a yardstick for filters."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu, spsolve

from estimators.core.errors import NotFiniteError
from estimators.core.history import Node
from estimators.core.loops import wrap
from estimators.core.types import Array, Gaussian, Models, ProcessModel, model_of


@dataclass(frozen=True, kw_only=True, slots=True)
class Trajectory:
    """The most probable states at the nodes."""

    means: Array  # (k, n)
    cost: float  # half the sum of squared normalised residuals
    iterations: int
    information: sparse.csc_matrix  # (k n, k n) of all states, at the solution
    reweighted: Array  # weight of each residual of a measurement in the cost, 1 where no loss is robust

    def covariance(self, index: int) -> Array:
        """Covariance (n, n) of the state at a node, given everything."""
        n = self.means.shape[1]
        place = index % len(self.means) * n
        unit = np.zeros((self.means.size, n))
        unit[place : place + n] = np.eye(n)
        return splu(self.information).solve(unit)[place : place + n]


def solve(
    nodes: Sequence[Node[Any]],
    prior: Gaussian,
    process: ProcessModel,
    models: Models,
    guess: Array,
    *,
    angles: tuple[int, ...] | None = None,
    huber: float | None = None,
    iterations: int = 20,
    tolerance: float = 1e-4,
) -> Trajectory:
    """The states that maximise the posterior density of all measurements of the nodes.

    Args:
        nodes: Times, inputs and measurements; those of the first node are in the prior.
        prior: Belief at the first node, with its measurements.
        process: How states move on; its noise must reach all states.
        models: What the measurements of each kind, or (kind, source), show; those not named are ignored.
        guess: States (k, n) to start from, those of a filter say.
        angles: States that are angles; None: those of the process.
        huber: Normalised residual beyond which a measurement's cost grows linearly (Huber 1964), 1.5 say; None: its
            cost is quadratic.
        iterations: At most.
        tolerance: Of the last step, in standard deviations of the prior.

    Raises:
        NotFiniteError: It does not converge.
    """
    x = np.array(guess, dtype=float)
    angles = process.angles if angles is None else angles
    scale = np.sqrt(np.diagonal(prior.covariance))
    for iteration in range(1, iterations + 1):
        terms = list(_terms(nodes, prior, process, models, x, angles))
        weights = np.array([_weight(t, huber) for t in terms if t.is_measured])
        if huber is not None:
            terms = [t if not t.is_measured else _reweighted(t, huber) for t in terms]
        J, residuals = _normalised(terms, x.shape[1], len(x))
        information = (J.T @ J).tocsc()
        step = spsolve(information, -J.T @ residuals).reshape(x.shape)
        x += step
        if not np.isfinite(x).all():
            break
        if np.abs(step / scale).max() < tolerance:
            cost = 0.5 * float(residuals @ residuals)
            return Trajectory(means=x, cost=cost, iterations=iteration, information=information, reweighted=weights)
    raise NotFiniteError(f"Gauss-Newton over {len(nodes)} nodes has not converged after {iterations} iterations")


class _Term(NamedTuple):
    """A residual of some states, of which the cost holds half the normalised square."""

    values: Array  # (m,)
    covariance: Array  # (m, m)
    parts: tuple[tuple[int, Array], ...]  # index of each state and the residual's derivative (m, n) by it
    is_measured: bool = False


def _weight(term: _Term, huber: float | None) -> float:
    """Huber's weight of a residual."""
    if huber is None:
        return 1.0
    size = float(np.sqrt(term.values @ np.linalg.solve(term.covariance, term.values)))
    return 1.0 if size <= huber else huber / size


def _reweighted(term: _Term, huber: float) -> _Term:
    return term._replace(covariance=term.covariance / _weight(term, huber))


def _terms(
    nodes: Sequence[Node[Any]],
    prior: Gaussian,
    process: ProcessModel,
    models: Models,
    x: Array,
    angles: tuple[int, ...],
) -> Iterator[_Term]:
    """Prior, process noise and measurements, linearised at the states x (k, n)."""
    identity = np.eye(x.shape[1])
    yield _Term(_wrapped(x[0] - prior.mean, angles), prior.covariance, ((0, identity),))
    for k in range(1, len(nodes)):
        before, node = nodes[k - 1], nodes[k]
        u, duration = before.input, node.time - before.time
        change = _wrapped(x[k] - process.evaluate(x[k - 1], u, duration), angles)
        F, Q = process.jacobian(x[k - 1], u, duration), process.covariance(x[k - 1], u, duration)
        yield _Term(change, Q, ((k - 1, -F), (k, identity)))
        for measurement in node.measurements:
            if (model := model_of(models, measurement)) is not None:
                expected, H = model.shown(x[k], measurement)
                error = model.residual(measurement.value, expected)
                yield _Term(error, model.covariance(x[k], measurement), ((k, -H),), True)


def _normalised(terms: Iterable[_Term], n: int, count: int) -> tuple[sparse.csr_matrix, Array]:
    """Jacobian (r, count n) and values (r,) of all residuals, each divided by the root of its covariance."""
    rows, columns, data, residuals, row = [], [], [], [], 0
    for (m, parts), group in groupby(sorted(terms, key=_form), key=_form):  # equal ones at once
        alike = list(group)
        augmented = np.array([np.column_stack((t.values, *(part for _, part in t.parts))) for t in alike])
        normalised = np.linalg.solve(np.linalg.cholesky([t.covariance for t in alike]), augmented)
        residuals.append(normalised[:, :, 0].ravel())
        places = row + np.arange(len(alike) * m).reshape(-1, m, 1)
        row += places.size
        for p in range(parts):
            block = normalised[:, :, 1 + n * p : 1 + n * (p + 1)]
            states = np.array([t.parts[p][0] for t in alike])[:, None, None] * n + np.arange(n)
            rows.append(np.broadcast_to(places, block.shape).ravel())
            columns.append(np.broadcast_to(states, block.shape).ravel())
            data.append(block.ravel())
    places = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_matrix((np.concatenate(data), places), shape=(row, count * n)), np.concatenate(residuals)


def _form(term: _Term) -> tuple[int, int]:
    """Sizes of a term: of its residual, and how many states it concerns."""
    return term.values.size, len(term.parts)


def _wrapped(difference: Array, angles: tuple[int, ...]) -> Array:
    for index in angles:
        difference[index] = wrap(difference[index])
    return difference
