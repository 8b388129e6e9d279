"""Recovery of a filter that is wrong itself: by rejected fixes that agree with each other."""

import math
from typing import NamedTuple

import numpy as np

from estimators.core import ekf
from estimators.core.consistency import chi_square
from estimators.core.types import Array, Gaussian, Measurement
from estimators.docking.models import DockingNoise

REMEMBERED = 4  # rejected fixes that are kept; the next one then is taken in any case
PROBABLE = 0.95  # probability of fixes that are not compared even after a rejected one
AGREEMENT = 0.99  # probability with which two good fixes are found to agree
MAX_AGE = 30.0  # age beyond which a rejected fix is discarded [s]


class Rejected(NamedTuple):
    """A fix that was taken for an outlier, kept until a fix is accepted."""

    fix: Measurement
    residual: Array  # (2,) against the prediction at its time [m]
    H: Array  # (2, n)
    nis: float = math.nan

    @property
    def taken(self) -> tuple[Measurement, str, float]:
        """The verdict on it when it is used after all."""
        return self.fix, "", self.nis


def agreeing(now: Rejected, rejected: tuple[Rejected, ...], noise: DockingNoise) -> list[Rejected]:
    """Those of the `rejected` fixes that agree with that of `now` and with each other, the latest first."""
    found: list[Rejected] = []
    for earlier in reversed(rejected):
        if now.fix.stamp - earlier.fix.stamp <= MAX_AGE and agree(now, [*found, earlier], noise):
            found.append(earlier)
    return found


def agree(now: Rejected, earlier: list[Rejected], noise: DockingNoise) -> bool:
    """Whether one error of the position and one of the current explain all innovations.

    The current's error has the deviation that it has at first, and may change by as much in the time after which a fix
    is discarded. So two fixes agree if they lie within reach of such a current, and three only if they nearly move
    along: wrong fixes do so far more rarely.
    """
    ages = np.array([now.fix.stamp - rejected.fix.stamp for rejected in earlier])
    shorter, longer = np.minimum.outer(ages, ages), np.maximum.outer(ages, ages)
    # Of an integrated random walk between two ages (Wahba 1978).
    walk = shorter**2 * (3.0 * longer - shorter) / (6.0 * MAX_AGE)
    drift = noise.initial_current**2 * (np.outer(ages, ages) + walk)
    S = np.kron(drift, np.eye(2)) + np.kron(np.ones_like(drift), now.fix.covariance)
    for k, rejected in enumerate(earlier):
        S[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += rejected.fix.covariance
    change = np.concatenate([rejected.residual - now.residual for rejected in earlier])
    return float(change @ np.linalg.solve(S, change)) <= chi_square(AGREEMENT, change.size)


def recover(belief: Gaussian, earlier: Rejected, now: Rejected, noise: DockingNoise) -> Gaussian:
    """Belief with position and current opened up and both fixes fused, the earlier one carried to now."""
    T = now.fix.stamp - earlier.fix.stamp
    covariance = belief.covariance.copy()
    covariance[[0, 1], [0, 1]] += now.residual @ now.residual + earlier.residual @ earlier.residual
    covariance[[6, 7], [6, 7]] += noise.initial_current**2
    H = np.vstack((now.H, earlier.H))
    H[2:, 6:8] -= T * np.eye(2)  # then, the error of the position was smaller by what the current's has added since
    R = np.zeros((4, 4))
    R[:2, :2] = now.fix.covariance
    R[2:, 2:] = earlier.fix.covariance + (noise.position * T + noise.current * T**3 / 3.0) * np.eye(2)
    residual = np.concatenate((now.residual, earlier.residual))
    return ekf.correct_linear(Gaussian(mean=belief.mean, covariance=covariance), H, residual, R)[0]
