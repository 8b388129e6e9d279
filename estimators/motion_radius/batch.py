"""Most probable trajectory given all ranges: iterated Kalman smoothing, which is Gauss-Newton (Bell 1994).

A yardstick for filters, and the answer for a log. The states are those of `core.models.odometry`; those that are known
may have no variance, which `core.batch` does not allow.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from estimators.core import loops
from estimators.core.compiling import compiled
from estimators.core.errors import NotFiniteError
from estimators.core.history import Node
from estimators.core.models.odometry import Displacement, N, OdometryNoise, move, show_range, spread
from estimators.core.types import Array, Gaussian
from estimators.motion_radius.ranges import KIND

TOLERANCE = 1e-3  # of the last step [m]


class Smoothed(NamedTuple):
    """Beliefs at the nodes that have a range, given all of them."""

    times: Array  # (k,) [s]
    means: Array  # (k, 9)
    covariances: Array  # (k, 9, 9)
    iterations: int


def solve(
    nodes: Sequence[Node[Any]],
    start: Gaussian,
    noise: OdometryNoise,
    end: Array,
    *,
    walks: Array | None = None,
    iterations: int = 30,
) -> Smoothed:
    """The most probable states.

    Args:
        nodes: Times, inputs (forward, starboard speed, heading) and measurements, of which ranges are used.
        start: Belief (9,) at the first node.
        noise: Of the odometry.
        end: State (9,) at the last node from which it starts to search, that of a filter.
        walks: Densities (9,) of random walks of the states [unit^2/s]; None: all are constant.
        iterations: At most.

    Raises:
        NotFiniteError: It does not converge.
    """
    times, displacements, ranges = _gathered(nodes, noise)
    q = np.zeros(N) if walks is None else np.array(walks, dtype=float)
    free = np.flatnonzero(np.diagonal(start.covariance) + q > 0.0)
    means = _walked_back(displacements, end)  # the start, and each range
    for iteration in range(1, iterations + 1):
        before = means
        means, covariances = _smooth(start.mean, start.covariance, displacements, ranges, q, free, before)
        if not np.isfinite(means).all():
            break
        if np.abs(means[:, :2] - before[:, :2]).max() < TOLERANCE:
            return Smoothed(times, means[1:], covariances[1:], iteration)
    raise NotFiniteError(f"smoothing of {len(ranges)} ranges has not converged after {iterations} iterations")


def _gathered(nodes: Sequence[Node[Any]], noise: OdometryNoise) -> tuple[Array, Array, Array]:
    """Times (k,), displacements (k, 6) before each range, and ranges (k, 5): value, variance, place below the own."""
    times, displacements, ranges, since = [], [], [], Displacement()
    for k, node in enumerate(nodes):
        if k:
            u = nodes[k - 1].input
            since = since.extended(u[0], u[1], u[2], node.time - nodes[k - 1].time, noise)
        for m in node.measurements:
            if m.kind == KIND:
                north, east, depth, own, _ = m.parameters
                times.append(node.time)
                displacements.append(since)
                ranges.append((m.value[0], m.covariance[0, 0], north, east, depth - own))
                since = Displacement()
    return np.array(times), np.array(displacements), np.array(ranges)


def _walked_back(displacements: Array, end: Array) -> Array:
    """States (k + 1, 9) that lead to `end`, the errors and the current as they are there."""
    means = np.repeat(np.array(end, dtype=float)[None], len(displacements) + 1, axis=0)
    F, following = np.eye(N), np.empty(N)
    for k in range(len(means) - 1, 0, -1):
        still = means[k].copy()
        still[5] = -still[5]
        move(still, tuple(displacements[k - 1]), following, F)
        means[k - 1, :2] = 2.0 * still[:2] - following[:2]
        means[k - 1, 4] = following[4]
    return means


@compiled
def _smooth(mean, covariance, displacements, ranges, q, free, at):
    """Means and covariances (k + 1, ...) at the start and each of k ranges, all linearised at `at` (k + 1, 9)."""
    k, n = at.shape
    x, P = mean.copy(), covariance.copy()
    xs, Ps = np.empty((k, n)), np.empty((k, n, n))
    predicted, spreads, Fs = np.empty((k, n)), np.empty((k, n, n)), np.empty((k, n, n))
    F, work, following, H = np.eye(n), np.empty((n, n)), np.empty(n), np.empty((1, n))
    R, residual = np.empty((1, 1)), np.empty(1)
    xs[0], Ps[0] = x, P
    for i in range(1, k):
        e, r = displacements[i - 1], ranges[i - 1]
        d = (e[0], e[1], e[2], e[3], e[4], e[5])
        move(at[i - 1], d, following, F)
        x = following + F @ (x - at[i - 1])
        P = P.copy()
        spread(P, F, d, q, work)
        predicted[i], spreads[i], Fs[i] = x, P, F
        residual[0] = r[0] - show_range(at[i], r[2], r[3], r[4], H) - H[0] @ (x - at[i])
        R[0, 0] = r[1]
        x, P, _, _, _, _ = loops.correct(x, P, H, residual, R, np.inf)
        xs[i], Ps[i] = x, P
    m = len(free)
    S, b = np.empty((m, m)), np.empty(m)
    for i in range(k - 2, -1, -1):
        for a in range(m):
            for c in range(m):
                S[a, c] = spreads[i + 1][free[a], free[c]]
        scale = 1.0 / np.sqrt(np.diag(S))
        L = loops.factor(S * np.outer(scale, scale))[0]
        PF = Ps[i] @ Fs[i + 1].T
        gain = np.zeros((n, n))
        for row in range(n):
            for a in range(m):
                b[a] = PF[row, free[a]] * scale[a]
            loops.solve(L, b)
            for a in range(m):
                gain[row, free[a]] = b[a] * scale[a]
        xs[i] = xs[i] + gain @ (xs[i + 1] - predicted[i + 1])
        Ps[i] = Ps[i] + gain @ (Ps[i + 1] - spreads[i + 1]) @ gain.T
    return xs, Ps
