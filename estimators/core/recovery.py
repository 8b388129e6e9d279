"""How a filter that refuses measurements finds out that it is wrong itself: they disagree with it, but not together."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from estimators.core import ekf
from estimators.core.consistency import chi_square
from estimators.core.ekf import Innovation
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel

REMEMBERED = 4  # measurements of one source that are kept; the next one is then taken in any case
PROBABLE = 0.95  # probability of those that are not compared even after one was rejected
AGREEMENT = 0.99  # probability with which two good ones are found to agree
MAX_AGE = 30.0  # age at which a rejected one says nothing more of the present [s]


class Rejected(NamedTuple):
    """A measurement that was taken for an outlier, kept until one of its source is accepted."""

    measurement: Measurement
    residual: Array  # (m,) against the prediction at its time
    H: Array  # (m, n)
    nis: float = math.nan
    innovation: Innovation | None = None

    @property
    def taken(self) -> tuple[Measurement, str, float]:
        """The verdict on it when it is used after all."""
        return self.measurement, "", self.nis


class Recovery(Protocol):
    """What a filter does about measurements that it rejects."""

    def agreeing(self, now: Rejected, rejected: Sequence[Rejected]) -> list[Rejected]:
        """Those of the same source rejected before that agree with that of now, the latest first."""
        ...

    def recover(self, belief: Gaussian, earlier: Rejected, now: Rejected, model: MeasurementModel) -> Gaussian:
        """The belief set right by both."""
        ...


class OpenedRecovery:
    """Recovery for any sensor.

    Two rejected measurements agree if their innovations differ by no more than their own noise and what the belief may
    have moved between them explain. Then the belief is opened along the line on which it explains the innovation with
    the least change, P + d d' with d = P H' (H P H')^-1 r, and corrected: the state that was thought certain follows,
    what it is correlated with follows along, the rest stays.

    Args:
        drift: How fast an error of the prediction may grow, in deviations of the measurement a second.
    """

    def __init__(self, drift: float = 0.2) -> None:
        self._drift = drift

    def agreeing(self, now: Rejected, rejected: Sequence[Rejected]) -> list[Rejected]:
        """See `Recovery`."""
        return [earlier for earlier in reversed(rejected) if self._agree(now, earlier)]

    def _agree(self, now: Rejected, earlier: Rejected) -> bool:
        age = now.measurement.stamp - earlier.measurement.stamp
        if age > MAX_AGE or now.residual.size != earlier.residual.size:
            return False
        R = now.measurement.covariance + earlier.measurement.covariance
        S = R * (1.0 + (self._drift * age) ** 2)
        if now.innovation is not None and earlier.innovation is not None:
            growth = now.innovation.covariance - earlier.innovation.covariance
            S = S + np.diag(np.maximum(np.diagonal(growth), 0.0))
        change = now.residual - earlier.residual
        return float(change @ np.linalg.solve(S, change)) <= chi_square(AGREEMENT, change.size)

    def recover(self, belief: Gaussian, earlier: Rejected, now: Rejected, model: MeasurementModel) -> Gaussian:
        """See `Recovery`."""
        return ekf.correct(opened(belief, now.H, now.residual), now.measurement, model)[0]


def opened(belief: Gaussian, H: Array, residual: Array) -> Gaussian:
    """The belief with the covariance that makes an innovation (m,) probable; P + d d', H d = residual."""
    PH = belief.covariance @ H.T
    direction = PH @ np.linalg.pinv(H @ PH, rcond=1e-10, hermitian=True) @ residual
    return Gaussian(mean=belief.mean, covariance=belief.covariance + np.outer(direction, direction))
