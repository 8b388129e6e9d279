"""Fusion of beliefs whose correlation is unknown: covariance intersection (Julier and Uhlmann 1997)."""

import math

import numpy as np

from estimators.core.bounds import inverse
from estimators.core.types import Array, Gaussian, wrapped


def intersect(
    a: Gaussian, b: Gaussian, angles: tuple[int, ...] = (), weight: float | None = None
) -> tuple[Gaussian, float]:
    """A belief that is consistent whatever the correlation of two beliefs of one state, and the weight of the first.

    P^-1 = w A^-1 + (1 - w) B^-1; the weight is that of the least determinant unless it is given.

    Raises:
        NotPositiveDefiniteError: A covariance is not positive definite.
    """
    A, B = inverse(a.covariance), inverse(b.covariance)

    def log_volume(w: float) -> float:
        return -float(np.linalg.slogdet(w * A + (1.0 - w) * B)[1])

    if weight is None:
        from scipy.optimize import minimize_scalar

        found = float(minimize_scalar(log_volume, bounds=(0.0, 1.0), method="bounded").x)
        weight = min((0.0, found, 1.0), key=log_volume)
    return _weighed(a, b, weight * A, (1.0 - weight) * B, angles), weight


def intersect_partial(belief: Gaussian, H: Array, value: Array, covariance: Array, weight: float) -> Gaussian:
    """The belief after a measurement H x of which it is unknown how correlated it is with the belief.

    As of another vehicle that has used one's own position before: P / w and R / (1 - w) are fused as if independent.
    """
    P, R = belief.covariance / weight, covariance / (1.0 - weight)
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    mean = belief.mean + K @ (value - H @ belief.mean)
    L = np.eye(belief.mean.size) - K @ H
    return Gaussian(mean=mean, covariance=L @ P @ L.T + K @ R @ K.T)


def cautious_variance(own: float, told: float) -> float:
    """The variance with which a scalar measurement is to count whose error may have any correlation with one's own.

    With the usual gain K of that variance the error is at worst (1 - K) sqrt(own) + K sqrt(told), which is to be no
    larger than the corrected variance (1 - K) own says: 1 - K = (r / (1 - r))^2 with r = sqrt(told / own). Infinite
    from r = 1/2 on: of two errors that may be one, the mean helps no more than the better of them.

    Args:
        own: Predicted variance of what is measured.
        told: Variance of the measurement's error.
    """
    if not told < 0.25 * own:
        return math.inf
    r = math.sqrt(told / own)
    kept = (r / (1.0 - r)) ** 2  # 1 - K
    return own * kept / (1.0 - kept)


def _weighed(a: Gaussian, b: Gaussian, A: Array, B: Array, angles: tuple[int, ...]) -> Gaussian:
    P = inverse(A + B)
    change = P @ B @ wrapped(b.mean - a.mean, angles)
    return Gaussian(mean=wrapped(a.mean + change, angles), covariance=P)
