"""Interacting multiple models: mixing and merging of the beliefs of several modes (Blom and Bar-Shalom 1988)."""

from collections.abc import Sequence

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
    means, covariances, indices = _stacked(beliefs, angles)
    following = weights @ transition
    mixed = []
    for j, weight in enumerate(following):
        mean, covariance = loops.merge(means, covariances, weights * transition[:, j] / weight, indices)
        mixed.append(Gaussian(mean=mean, covariance=covariance))
    return tuple(mixed), following


def merge(beliefs: Sequence[Gaussian], weights: Array, angles: tuple[int, ...] = ()) -> Gaussian:
    """The Gaussian that has the mean and the covariance of a mixture of `beliefs` with probabilities `weights`."""
    means, covariances, indices = _stacked(beliefs, angles)
    mean, covariance = loops.merge(means, covariances, weights, indices)
    return Gaussian(mean=mean, covariance=covariance)


def update(weights: Array, log_likelihoods: Sequence[float]) -> Array:
    """The modes' probabilities (m,) after a measurement, from its log likelihood under each."""
    shares = weights * np.exp(np.subtract(log_likelihoods, max(log_likelihoods)))
    return shares / shares.sum()


def _stacked(beliefs: Sequence[Gaussian], angles: tuple[int, ...]) -> tuple[Array, Array, NDArray[np.int64]]:
    means, covariances = np.array([b.mean for b in beliefs]), np.array([b.covariance for b in beliefs])
    return means, covariances, np.array(angles, dtype=np.int64)
