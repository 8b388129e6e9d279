"""Interacting multiple models: mixing and merging of the beliefs of several modes (Blom and Bar-Shalom 1988)."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from estimators.core import loops
from estimators.core.types import Array, Gaussian


def mix(
    beliefs: Sequence[Gaussian], weights: Array, transition: Array, angles: tuple[int, ...] = ()
) -> tuple[tuple[Gaussian, ...], Array]:
    """Each mode's belief after a possible change of mode, and the modes' probabilities then.

    Args:
        beliefs: One of each of m modes.
        weights: Their probabilities (m,).
        transition: (m, m) probability of changing from mode i (row) to mode j (column).
        angles: States that are angles, kept in (-pi, pi].
    """
    means, covariances = stacked(beliefs)
    following = weights @ transition
    mixed = loops.mix(means, covariances, weights, transition, following, indices(angles))
    return tuple(Gaussian(mean=x, covariance=P) for x, P in zip(*mixed, strict=True)), following


def merge(beliefs: Sequence[Gaussian], weights: Array, angles: tuple[int, ...] = ()) -> Gaussian:
    """The Gaussian that has the mean and the covariance of a mixture of `beliefs` with probabilities `weights`."""
    mean, covariance = loops.merge(*stacked(beliefs), weights, indices(angles))
    return Gaussian(mean=mean, covariance=covariance)


def update(weights: Array, log_likelihoods: Sequence[float]) -> Array:
    """The modes' probabilities (m,) after a measurement, from its log likelihood under each."""
    shares = weights * np.exp(np.subtract(log_likelihoods, max(log_likelihoods)))
    return shares / shares.sum()


def stacked(beliefs: Sequence[Gaussian]) -> tuple[Array, Array]:
    """Means (m, n) and covariances (m, n, n) of m beliefs."""
    return np.array([b.mean for b in beliefs]), np.array([b.covariance for b in beliefs])


@lru_cache
def indices(angles: tuple[int, ...]) -> NDArray[np.int64]:
    """States that are angles, as compiled loops take them."""
    return np.array(angles, dtype=np.int64)
