"""Least errors of a follower by ranges: of one moment beside the paper's, and in steady motion (Li et al. 2023).

The bound along a track, with leaders that are uncertain or late and an unknown current, is in `along`.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from estimators.core.errors import NotPositiveDefiniteError
from estimators.core.information import bound, range_information
from estimators.core.types import Array
from estimators.formation.models import DeadReckoning


def crlb(place: ArrayLike, leaders: ArrayLike, deviations: ArrayLike) -> Array:
    """The Cramér-Rao bound (2, 2) [m^2] of ranges at one moment; det = sigma^4 / S1 where all deviations are equal."""
    return bound(range_information(place, leaders, deviations))


def crlb_paper(place: ArrayLike, leaders: ArrayLike, deviations: ArrayLike) -> Array:
    """The paper's (eq. 28), with n times the trace of R^-1 in the place of R^-1: n^2 times too small if equal."""
    count = len(np.atleast_2d(leaders))
    total = float((np.broadcast_to(np.asarray(deviations, dtype=float), (count,)) ** -2.0).sum())
    return bound(range_information(place, leaders, 1.0 / math.sqrt(count * total)))


def crlb_determinant_paper(place: ArrayLike, leaders: ArrayLike, deviations: ArrayLike) -> float:
    """The determinant as printed, 1 / (I S1) (eq. 29); that of a (2, 2) matrix would be 1 / (I^2 S1)."""
    count = len(np.atleast_2d(leaders))
    total = count * float((np.broadcast_to(np.asarray(deviations, dtype=float), (count,)) ** -2.0).sum())
    return 1.0 / (total * float(np.linalg.det(range_information(place, leaders, 1.0))))


def steady(information: Array, Q: Array) -> Array:
    """The conditional posterior bound (2, 2) in steady motion: P^-1 = (P + Q)^-1 + F.

    Args:
        information: F of the ranges of one step (2, 2) [1/m^2].
        Q: Noise of one step (2, 2) [m^2].

    Raises:
        NotPositiveDefiniteError: A direction is open, in which the bound grows for ever.
    """
    values, vectors = np.linalg.eigh(information)
    if not values[0] > 1e-12 * values[1]:
        raise NotPositiveDefiniteError("a direction is open: the bound grows for ever")
    H = np.sqrt(values)[:, None] * vectors.T  # F = H' H
    from scipy.linalg import solve_discrete_are

    predicted = solve_discrete_are(np.eye(2), H.T, Q, np.eye(2))
    return np.linalg.inv(np.linalg.inv(predicted) + information)


def steady_axis(q: float, r: float) -> float:
    """Steady bound of one axis that is apart from the other: variance of noise q a step, of the measurement r [m^2]."""
    return (-q + math.sqrt(q * q + 4.0 * q * r)) / 2.0


def saturation(place: ArrayLike, leaders: ArrayLike, deviations: ArrayLike, step_variance: float) -> float:
    """Rms error [m] at which a follower on its leaders' line stays: (q s^2 / 4)^(1/6), s = 2 / sqrt(sum 1/(sigma r)^2).

    Across the line a range is quadratic, r + e^2 / (2 r); so the error grows until what it says balances the noise of
    dead reckoning, of `step_variance` q [m^2] a step across the line.
    """
    away = np.linalg.norm(np.asarray(place, dtype=float) - np.atleast_2d(leaders), axis=1)
    s2 = 4.0 / float(((np.asarray(deviations, dtype=float) * away) ** -2.0).sum())
    return (step_variance * s2 / 4.0) ** (1.0 / 6.0)


def steady_rms(
    place: ArrayLike, leaders: ArrayLike, deviations: ArrayLike, process: DeadReckoning, u: ArrayLike, step: float
) -> float:
    """Least rms error [m] in steady motion in a rigid formation; infinite on the leaders' line."""
    F = range_information(place, leaders, deviations)
    try:
        return math.sqrt(float(np.trace(steady(F, process.covariance(np.zeros(2), u, step)))))
    except NotPositiveDefiniteError:
        return math.inf
