"""Filters of many runs at once, for studies: the steps of `core.ekf` and `core.ukf` with a leading axis of runs.

Each step takes means (k, n) and covariances (k, n, n) and gives new ones; `shown` and the like are those of a model.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from estimators.core.types import Array

Shown = Callable[[Array], tuple[Array, Array]]  # states (k, n) -> values (k, m) and derivatives (k, m, n)


class Beliefs(NamedTuple):
    """Gaussian beliefs of k runs."""

    mean: Array  # (k, n)
    covariance: Array  # (k, n, n)


def predict(beliefs: Beliefs, F: Array, shift: Array, Q: Array) -> Beliefs:
    """F x + shift, F P F' + Q; F (n, n), shift (k, n), Q (k, n, n) or (n, n)."""
    mean = beliefs.mean @ F.T + shift
    return Beliefs(mean, F @ beliefs.covariance @ F.T + Q)


def correct(beliefs: Beliefs, residual: Array, H: Array, R: Array) -> Beliefs:
    """The Kalman correction by residuals (k, m) with derivatives (k, m, n) and noise R (k, m, m) or (m, m)."""
    x, P = beliefs
    cross = P @ np.swapaxes(H, -1, -2)
    K = np.swapaxes(np.linalg.solve(H @ cross + R, np.swapaxes(cross, -1, -2)), -1, -2)
    rest = np.eye(x.shape[-1]) - K @ H
    P = rest @ P @ np.swapaxes(rest, -1, -2) + K @ R @ np.swapaxes(K, -1, -2)  # Joseph's form
    return Beliefs(x + (K @ residual[..., None])[..., 0], 0.5 * (P + np.swapaxes(P, -1, -2)))


def extended(beliefs: Beliefs, z: Array, R: Array, shown: Shown) -> Beliefs:
    """The extended filter's correction by values z (k, m)."""
    expected, H = shown(beliefs.mean)
    return correct(beliefs, z - expected, H, R)


def iterated(beliefs: Beliefs, z: Array, R: Array, shown: Shown, iterations: int = 5) -> Beliefs:
    """Corrections linearised anew at each result (Bell and Cathey 1993)."""
    result = extended(beliefs, z, R, shown)
    for _ in range(iterations - 1):
        expected, H = shown(result.mean)
        residual = z - expected - (H @ (beliefs.mean - result.mean)[..., None])[..., 0]
        result = correct(beliefs, residual, H, R)
    return result


def second_order(beliefs: Beliefs, z: Array, R: Array, shown: Shown, curvature: Callable[[Array], Array]) -> Beliefs:
    """The Gaussian second-order filter's correction (Bar-Shalom, Li, Kirubarajan 2001, 10.3.3).

    `curvature` gives second derivatives (k, m, d, d) by the first d states: the values expected are larger by half
    their trace with P, and their noise by half the trace of the products.
    """
    expected, H = shown(beliefs.mean)
    A = curvature(beliefs.mean)
    spread = A @ beliefs.covariance[:, None, : A.shape[-1], : A.shape[-1]]  # (k, m, d, d)
    shift = 0.5 * np.trace(spread, axis1=-2, axis2=-1)
    more = 0.5 * np.einsum("kaij,kbji->kab", spread, spread)
    return correct(beliefs, z - expected - shift, H, R + more)


def unscented(beliefs: Beliefs, z: Array, R: Array, evaluate: Callable[[Array], Array]) -> Beliefs:
    """The unscented filter's correction, kappa = 0; `evaluate` takes states (k, 2n, n) and gives values (k, 2n, m)."""
    x, P = beliefs
    n = x.shape[-1]
    offsets = np.sqrt(n) * np.swapaxes(np.linalg.cholesky(P), -1, -2)
    offsets = np.concatenate((offsets, -offsets), axis=1)  # (k, 2n, n)
    shown = evaluate(x[:, None, :] + offsets)
    mean = shown.mean(axis=1)
    spread = shown - mean[:, None]
    cross = np.swapaxes(spread, -1, -2) @ offsets / (2 * n)  # (k, m, n)
    H = np.swapaxes(np.linalg.solve(P, np.swapaxes(cross, -1, -2)), -1, -2)
    rest = np.swapaxes(spread, -1, -2) @ spread / (2 * n) - H @ np.swapaxes(cross, -1, -2)
    return correct(beliefs, z - mean, H, R + rest)
