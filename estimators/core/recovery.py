"""How a filter that refuses measurements finds out that it is wrong itself: they disagree with it, but not together."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from estimators.core import ekf
from estimators.core.consistency import chi_square
from estimators.core.ekf import Innovation
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel

REMEMBERED = 4  # measurements of one source that are kept
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
    since: float = math.nan  # time from the last one accepted before it [s]

    @property
    def taken(self) -> tuple[Measurement, str, float]:
        """The verdict on it when it is used after all."""
        return self.measurement, "", self.nis


class Recovery(Protocol):
    """What a filter does about a source that it rejects again and again."""

    forces: bool  # whether one is let in after four in a row that agree with nothing
    fuses_both: bool  # whether `recover` uses the earlier one too; else the source stays suspect, and is let in

    def suffice(
        self, now: Rejected, rejected: Sequence[Rejected], agreeing: Sequence[Rejected], cautious: bool = False
    ) -> bool:
        """Whether enough of those rejected before agree with that of now; it takes one more for the cautious."""
        ...

    def agreeing(self, now: Rejected, rejected: Sequence[Rejected]) -> list[Rejected]:
        """Those of the same source rejected before that agree with that of now, the latest first."""
        ...

    def recover(self, belief: Gaussian, earlier: Rejected, now: Rejected, model: MeasurementModel) -> Gaussian:
        """The belief set right by both, or by that of now alone."""
        ...


class Readmission:
    """Recovery for any sensor: a source whose rejected measurements agree with each other is let in as if ungated.

    They agree if their innovations differ by no more than their own noise and what the belief has lost between them
    explain. Nobody can say then whether the filter is wrong or the source is biased: to let it in costs no more than to
    have no gate, while a covariance opened for it would make a biased source drag the state along. It stays let in
    until one of its measurements fits again.

    Args:
        slow: Time between a source's vectors from which on one that agrees suffices [s]; else it takes two, since wrong
            ones that come fast, or are scalars, agree by chance far more often.
        drift: How fast an error of the prediction may grow, in deviations of the measurement a second; None: 1 of a
            scalar, 0.2 of a vector, which comes fast and may be wrong in all its components.
        max_age: Age at which a rejected measurement says nothing more of the present [s].
        opening: Open the belief along the line on which it explains the innovation with the least change: for sources
            that have no bias, so that a filter that disagrees with them must be wrong itself.
    """

    fuses_both = forces = False

    def __init__(
        self, *, slow: float = 4.0, drift: float | None = None, max_age: float = MAX_AGE, opening: bool = False
    ) -> None:
        self._slow, self._drift, self._max_age, self._opening = slow, drift, max_age, opening

    def suffice(
        self, now: Rejected, rejected: Sequence[Rejected], agreeing: Sequence[Rejected], cautious: bool = False
    ) -> bool:
        """Whether enough rejected measurements agree with that of now; it takes one more for the cautious."""
        is_slow = bool(rejected) and now.measurement.stamp - rejected[-1].measurement.stamp >= self._slow
        return len(agreeing) >= (1 if is_slow and now.residual.size > 1 else 2) + cautious

    def agreeing(self, now: Rejected, rejected: Sequence[Rejected]) -> list[Rejected]:
        """Those rejected before that agree with that of now, the latest first."""
        return [earlier for earlier in reversed(rejected) if self._agree(now, earlier)]

    def recover(self, belief: Gaussian, earlier: Rejected, now: Rejected, model: MeasurementModel) -> Gaussian:
        """The belief with the measurement of now."""
        before = opened(belief, now.H, now.residual) if self._opening else belief
        return ekf.correct(before, now.measurement, model)[0]

    def _agree(self, now: Rejected, earlier: Rejected) -> bool:
        age = now.measurement.stamp - earlier.measurement.stamp
        if age > self._max_age or now.residual.size != earlier.residual.size:
            return False
        R = now.measurement.covariance + earlier.measurement.covariance
        drift = (1.0 if now.residual.size == 1 else 0.2) if self._drift is None else self._drift
        S = R * (1.0 + (drift * age) ** 2)
        if now.innovation is not None and earlier.innovation is not None:
            growth = now.innovation.covariance - earlier.innovation.covariance
            S = S + np.diag(np.maximum(np.diagonal(growth), 0.0))
        change = now.residual - earlier.residual
        return float(change @ np.linalg.solve(S, change)) <= chi_square(AGREEMENT, change.size)


def opened(belief: Gaussian, H: Array, residual: Array) -> Gaussian:
    """The belief with a covariance that makes an innovation (m,) probable: P + d d' with d = P H' (H P H')^-1 r."""
    PH = belief.covariance @ H.T
    direction = PH @ np.linalg.pinv(H @ PH, rcond=1e-10, hermitian=True) @ residual
    return Gaussian(mean=belief.mean, covariance=belief.covariance + np.outer(direction, direction))
