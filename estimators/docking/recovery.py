"""How a filter that rejects fixes finds out that it is wrong itself: fixes that disagree with it, but not together."""

import math
from collections.abc import Sequence

import numpy as np

from estimators.core import ekf
from estimators.core.consistency import chi_square
from estimators.core.recovery import AGREEMENT, MAX_AGE, Rejected
from estimators.core.types import Gaussian, MeasurementModel
from estimators.docking.noise import DockingNoise

PLAUSIBLE = 0.999  # probability with which a change of the current is taken for one


def agreeing(now: Rejected, rejected: Sequence[Rejected], noise: DockingNoise) -> list[Rejected]:
    """Those of the `rejected` fixes that agree with that of `now` and with each other, the latest first."""
    found: list[Rejected] = []
    for earlier in reversed(rejected):
        if now.measurement.stamp - earlier.measurement.stamp <= MAX_AGE and agree(now, [*found, earlier], noise):
            found.append(earlier)
    return found


def agree(now: Rejected, earlier: list[Rejected], noise: DockingNoise) -> bool:
    """Whether one error of the position and one of the current explain all innovations.

    The current's error has the deviation that it has at first, and may change by as much in the time after which a fix
    is forgotten. So two fixes agree if they lie within reach of such a current, and three only if they nearly move
    along: wrong fixes do so far more rarely.
    """
    ages = np.array([now.measurement.stamp - rejected.measurement.stamp for rejected in earlier])
    shorter, longer = np.minimum.outer(ages, ages), np.maximum.outer(ages, ages)
    # Of an integrated random walk between two ages (Wahba 1978).
    walk = shorter**2 * (3.0 * longer - shorter) / (6.0 * MAX_AGE)
    drift = noise.initial_current**2 * (np.outer(ages, ages) + walk)
    S = np.kron(drift, np.eye(2)) + np.kron(np.ones_like(drift), now.measurement.covariance)
    for k, rejected in enumerate(earlier):
        S[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += rejected.measurement.covariance
    change = np.concatenate([rejected.residual - now.residual for rejected in earlier])
    return float(change @ np.linalg.solve(S, change)) <= chi_square(AGREEMENT, change.size)


def plausible(first: Rejected, noise: DockingNoise) -> bool:
    """Whether a current that changed since the fix before explains the first fix that disagrees."""
    if first.innovation is None or not math.isfinite(first.since):
        return True
    drift = (noise.initial_current * first.since) ** 2 * np.eye(2)
    nis = float(first.residual @ np.linalg.solve(first.innovation.covariance + drift, first.residual))
    return nis <= chi_square(PLAUSIBLE, first.residual.size)


def recover(belief: Gaussian, earlier: Rejected, now: Rejected, noise: DockingNoise) -> Gaussian:
    """Belief with position and current opened up and both fixes fused, the earlier one carried to now."""
    T = now.measurement.stamp - earlier.measurement.stamp
    covariance = belief.covariance.copy()
    covariance[[0, 1], [0, 1]] += now.residual @ now.residual + earlier.residual @ earlier.residual
    covariance[[6, 7], [6, 7]] += noise.initial_current**2
    H = np.vstack((now.H, earlier.H))
    H[2:, 6:8] -= T * np.eye(2)  # then, the error of the position was smaller by what the current's has added since
    R = np.zeros((4, 4))
    R[:2, :2] = now.measurement.covariance
    R[2:, 2:] = earlier.measurement.covariance + (noise.position * T + noise.current * T**3 / 3.0) * np.eye(2)
    residual = np.concatenate((now.residual, earlier.residual))
    return ekf.correct_linear(Gaussian(mean=belief.mean, covariance=covariance), H, residual, R)[0]


class FixRecovery:
    """The `Recovery` of a filter on the planar model: its position and its current are opened, both fixes fused.

    Args:
        noise: That the filter assumes.
        echo: Time for which a false echo may show one place [s]; 0: it does not reckon with any.
    """

    fuses_both = forces = True

    def __init__(self, noise: DockingNoise, echo: float = 0.0) -> None:
        self._noise, self._echo = noise, echo

    def suffice(
        self, now: Rejected, rejected: Sequence[Rejected], agreeing: Sequence[Rejected], cautious: bool = False
    ) -> bool:
        """One agreeing fix: it takes two to find the position and the current.

        For the cautious, two; and where the track could not have gone to where they say, even in a current that
        changed, it takes them longer than a false echo lasts.
        """
        if not cautious:
            return len(agreeing) >= 1
        lasts = bool(agreeing) and now.measurement.stamp - agreeing[-1].measurement.stamp >= self._echo
        return len(agreeing) >= 2 and (lasts or plausible(rejected[0], self._noise))

    def agreeing(self, now: Rejected, rejected: Sequence[Rejected]) -> list[Rejected]:
        """Those of the rejected fixes that agree with that of now and with each other, the latest first."""
        return agreeing(now, rejected, self._noise)

    def recover(self, belief: Gaussian, earlier: Rejected, now: Rejected, model: MeasurementModel) -> Gaussian:
        """The belief with both fixes fused."""
        return recover(belief, earlier, now, self._noise)
