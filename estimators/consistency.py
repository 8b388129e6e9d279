"""Consistency of a filter: normalised squared errors and their intervals (Bar-Shalom, Li, Kirubarajan 2001, 5.4)."""

from functools import lru_cache

import numpy as np
from scipy.special import gammaincinv

from estimators.errors import ParameterError
from estimators.types import Array


@lru_cache(maxsize=256)
def chi_square(probability: float, dof: float) -> float:
    """The value below which a chi-square variable of `dof` degrees of freedom lies with `probability`."""
    if not (0.0 <= probability <= 1.0 and dof > 0):
        raise ParameterError(f"probability {probability} must lie in 0..1 and degrees of freedom {dof} above 0")
    return float(2.0 * gammaincinv(dof / 2.0, probability))


def normalised_square(error: Array, covariance: Array) -> Array:
    """e' C^-1 e of errors (..., n) with covariances (..., n, n): NEES of a state's error, NIS of an innovation."""
    return np.einsum("...i,...i->...", error, np.linalg.solve(covariance, error[..., None])[..., 0])


def nees(mean: Array, covariance: Array, truth: Array, angles: tuple[int, ...] = ()) -> Array:
    """Normalised estimation error squared (...,) of means and truths (..., n); the states `angles` are wrapped."""
    error = np.asarray(mean - truth, dtype=float).copy()
    for index in angles:
        error[..., index] = np.angle(np.exp(1j * error[..., index]))
    return normalised_square(error, covariance)


def nis(residual: Array, covariance: Array) -> Array:
    """Normalised innovation squared (...,) of residuals (..., m) with innovation covariances (..., m, m)."""
    return normalised_square(residual, covariance)


def interval(dof: float, samples: int = 1, probability: float = 0.95) -> tuple[float, float]:
    """Bounds of the mean of `samples` independent NEES or NIS values of `dof` degrees of freedom.

    One run at one time: `samples=1`. Pooled over runs: their number. The values along one run are correlated: count
    only as many as there are correlation times in it.
    """
    tail = (1.0 - probability) / 2.0
    return chi_square(tail, dof * samples) / samples, chi_square(1.0 - tail, dof * samples) / samples


def fraction_inside(values: Array, dof: float, probability: float = 0.95) -> float:
    """Share of single NEES or NIS values inside their own interval; `probability` if the filter is consistent."""
    low, high = interval(dof, 1, probability)
    return float(np.mean((values >= low) & (values <= high)))
