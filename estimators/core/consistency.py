"""Consistency of a filter: normalised squared errors and their intervals (Bar-Shalom, Li, Kirubarajan 2001, 5.4)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import gammaincc, gammaincinv

from estimators.core.errors import ParameterError
from estimators.core.types import Array


@dataclass(frozen=True, kw_only=True, slots=True)
class Consistency:
    """A mean of NEES or NIS values per degree of freedom, and where that of a consistent filter lies."""

    mean: float
    low: float
    high: float
    samples: float  # independent ones among the values

    @property
    def holds(self) -> bool:
        """Whether the mean lies in its interval."""
        return self.low <= self.mean <= self.high


@dataclass(frozen=True, kw_only=True, slots=True)
class Whiteness:
    """The test of Ljung and Box (1978) on innovations."""

    statistic: float
    dof: int
    probability: float  # of a statistic at least as large, if the innovations are white


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


def assess(values: Array, dof: float, probability: float = 0.95) -> Consistency:
    """Consistency of NEES or NIS values (k,) of one run, or (runs, k) pooled over runs, of `dof` degrees of freedom.

    Values along a run are correlated; as many of them count as there are independent ones.
    """
    runs = np.atleast_2d(np.asarray(values, dtype=float))
    samples = float(sum(effective_samples(run) for run in runs))
    low, high = (
        chi_square(p, dof * samples) / (dof * samples) for p in (0.5 - 0.5 * probability, 0.5 + 0.5 * probability)
    )
    return Consistency(mean=float(runs.mean()) / dof, low=low, high=high, samples=samples)


def effective_samples(values: Array) -> float:
    """Independent values among (k,) correlated ones, k / (1 + 2 sum of autocorrelations up to the first below 0)."""
    k = len(values)
    centred = values - values.mean()
    spectrum = np.abs(np.fft.rfft(centred, 2 * k)) ** 2
    correlation = np.fft.irfft(spectrum)[:k]
    if not correlation[0] > 0.0:
        return 1.0
    correlation /= correlation[0]
    end = int(np.argmax(correlation < 0.0)) or k
    return k / (1.0 + 2.0 * float(correlation[1:end].sum()))


def whiten(residual: Array, covariance: Array) -> Array:
    """Innovations (..., m) in units of their deviations: L^-1 r with L L' their covariance (..., m, m)."""
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), residual[..., None])[..., 0], dtype=np.float64)


def autocorrelation(innovations: Array, lags: int) -> Array:
    """Normalised autocorrelations (lags,) at lag 1 .. `lags` of whitened innovations (k, m) in time order.

    Of white ones, each is normal with variance 1 / (k m) about 0 (Bar-Shalom, Li, Kirubarajan 2001, 5.4.2); of
    innovations that are all 0 it is 0.
    """
    squares = np.sum(innovations**2, axis=1)
    return np.array(
        [
            np.sum(innovations[:-lag] * innovations[lag:])
            / max(np.sqrt(squares[:-lag].sum() * squares[lag:].sum()), np.finfo(float).tiny)
            for lag in range(1, lags + 1)
        ]
    )


def ljung_box(innovations: Array, lags: int = 10) -> Whiteness:
    """Whether whitened innovations (k, m) in time order are white, each component for itself.

    Raises:
        ParameterError: There are fewer innovations than two a lag.
    """
    k, m = innovations.shape
    if k < 2 * lags:
        raise ParameterError(f"{k} innovations are too few for {lags} lags; there must be {2 * lags}")
    weights = 1.0 / (k - np.arange(1, lags + 1))
    squares = sum(float(weights @ autocorrelation(innovations[:, [c]], lags) ** 2) for c in range(m))
    statistic, dof = k * (k + 2.0) * squares, lags * m
    return Whiteness(statistic=statistic, dof=dof, probability=float(gammaincc(dof / 2.0, statistic / 2.0)))
