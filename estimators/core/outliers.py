"""Correction by a measurement that may be an outlier: both hypotheses are weighted and merged.

As probabilistic data association does with measurements of uncertain origin (Bar-Shalom and Tse 1975).
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from estimators.core import ekf
from estimators.core.ekf import Innovation
from estimators.core.errors import ParameterError
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel

IMPOSSIBLE = -1e300  # log likelihood of what no hypothesis explains


@dataclass(frozen=True, kw_only=True, slots=True)
class Outliers:
    """Outliers of a sensor: their probability, and their errors as an equal mixture of normal distributions."""

    prior: float = 0.03  # probability of each measurement
    # Of each component, in the measurement's unit; where components differ, one tuple of all components instead.
    deviations: tuple[float | tuple[float, ...], ...] = (3.0, 15.0)
    # As how many measurements the prior counts in a filter that learns their share; None: it stays as it is.
    worth: float | None = None

    def __post_init__(self) -> None:
        if not (0.0 < self.prior < 1.0 and self.deviations and min(np.min(d) for d in self.deviations) > 0.0):
            raise ParameterError(f"prior {self.prior} must lie in 0..1 and deviations {self.deviations} above 0")
        if self.worth is not None and not self.worth > 0.0:
            raise ParameterError(f"worth {self.worth} of an outliers' prior must lie above 0 measurements")

    def after(self, wrong: float, seen: int) -> "Outliers":
        """The outliers with the share that measurements since have taught: the mean of its beta distribution.

        Args:
            wrong: Sum of the probabilities of those seen that they were outliers.
            seen: Their number.
        """
        if self.worth is None:
            return self
        return replace(self, prior=(self.worth * self.prior + wrong) / (self.worth + seen))

    def covariance(self, size: int) -> Array:
        """Covariance (m, m) that the chance of being an outlier adds to a measurement's noise: for one taken unchecked.

        Raises:
            ParameterError: There are more or fewer deviations than components.
        """
        return self.prior * np.mean([_spread(d, size) for d in self.deviations], axis=0)


@dataclass(frozen=True, kw_only=True, slots=True)
class MixtureUpdate:
    """The outcome of a correction by a measurement that may be an outlier."""

    belief: Gaussian  # merged of both possibilities
    innovation: Innovation
    log_likelihood: float  # of the measurement
    probability: float  # that it was an outlier


def correct(belief: Gaussian, measurement: Measurement, model: MeasurementModel, outliers: Outliers) -> MixtureUpdate:
    """The belief after a measurement that may be an outlier, which carries no information on the state.

    Raises:
        NotPositiveDefiniteError, NotFiniteError: As `ekf.correct`.
    """
    corrected, innovation = ekf.correct(belief, measurement, model)
    sound = math.log1p(-outliers.prior) + log_density(innovation.covariance, innovation.residual)
    share = math.log(outliers.prior / len(outliers.deviations))
    wrong = [
        share + log_density(innovation.covariance + _spread(d, innovation.residual.size), innovation.residual)
        for d in outliers.deviations
    ]
    highest = max(sound, *wrong)
    if not math.isfinite(highest):  # so far off that its square is no number
        return MixtureUpdate(belief=belief, innovation=innovation, log_likelihood=IMPOSSIBLE, probability=1.0)
    total = math.exp(sound - highest) + sum(math.exp(w - highest) for w in wrong)
    p = 1.0 - math.exp(sound - highest) / total
    step = corrected.mean - belief.mean
    covariance = p * belief.covariance + (1.0 - p) * corrected.covariance + p * (1.0 - p) * np.outer(step, step)
    return MixtureUpdate(
        belief=Gaussian(mean=belief.mean + (1.0 - p) * step, covariance=covariance),
        innovation=innovation,
        log_likelihood=highest + math.log(total),
        probability=p,
    )


@lru_cache
def _spread(deviation: float | tuple[float, ...], size: int) -> Array:
    """Covariance (m, m) of an outlier's error; to be read only.

    Raises:
        ParameterError: There are more or fewer deviations than components.
    """
    if isinstance(deviation, tuple):
        if len(deviation) != size:
            raise ParameterError(f"outliers' deviations {deviation} must be {size}, one of each component")
        return np.diag(np.square(deviation))
    return deviation * deviation * np.eye(size)


def log_density(covariance: Array, residual: Array) -> float:
    """Logarithm of the normal density of a residual (m,) with its covariance (m, m)."""
    if residual.size == 2:  # the common cases, cheaply
        (a, b), (_, c) = covariance.tolist()
        x, y = residual.tolist()
        determinant = a * c - b * b
        return -0.5 * ((c * x * x - 2.0 * b * x * y + a * y * y) / determinant + math.log(determinant)) - math.log(
            2.0 * math.pi
        )
    if residual.size == 1:
        variance, x = covariance.item(), residual.item()
        return -0.5 * (x * (x / variance) + math.log(2.0 * math.pi * variance))
    _, logarithm = np.linalg.slogdet(2.0 * math.pi * covariance)
    return -0.5 * float(residual @ np.linalg.solve(covariance, residual) + logarithm)
