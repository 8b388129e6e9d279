"""Recovery from rejected fixes: covariances against simulation and against a second derivation."""

import math

import numpy as np
import pytest

from estimators.core.consistency import chi_square
from estimators.core.recovery import AGREEMENT, MAX_AGE, Rejected
from estimators.core.types import Array, Gaussian, Measurement
from estimators.docking.noise import DockingNoise
from estimators.docking.recovery import agree, recover

NOISE = DockingNoise(position=0.02, current=4e-3, initial_current=0.4)
NOW, EARLIER = 100.0, (95.0, 83.0)  # stamps [s]
SPREAD, CROSS = 0.3, 0.05  # of the fixes' covariances [m^2]


def rejected(stamp: float, residual: Array | tuple[float, float], scale: float = 1.0) -> Rejected:
    """A fix of correlated errors."""
    H = np.zeros((2, 8))
    H[:, :2], H[:, 2] = np.eye(2), (-0.2, 0.35)  # a transponder off-centre shows the heading, too
    covariance = scale * np.array([[SPREAD, CROSS], [CROSS, 0.5 * SPREAD]])
    fix = Measurement(kind="usbl", value=np.zeros(2), covariance=covariance, stamp=stamp, received=stamp)
    return Rejected(fix, np.array(residual), H)


def simulated_drift(ages: Array, count: int = 40_000) -> Array:
    """Covariance (k, k) of one component of the way that a drifting current has made since each age [m^2].

    Back from now: the current's error starts with its initial deviation and walks, by as much in MAX_AGE.
    """
    generator, step = np.random.default_rng(1), 0.25
    current = NOISE.initial_current * generator.standard_normal(count)
    way, found = np.zeros(count), []
    for k in range(1, round(ages.max() / step) + 1):
        change = NOISE.initial_current * math.sqrt(step / MAX_AGE) * generator.standard_normal(count)
        way += step * (current + 0.5 * change)
        current = current + change
        if np.isclose(k * step, ages).any():
            found.append(way.copy())
    return np.cov(found)


def test_fixes_agree_up_to_the_quantile_of_what_a_drifting_current_does() -> None:
    """In random directions the verdict changes where the squared distance in the simulated covariance passes it.

    Simulated covariances are right to 1 %; 3 % to either side are left open.
    """
    now = rejected(NOW, (0.0, 0.0))
    earlier = [rejected(stamp, (0.0, 0.0), 2.0) for stamp in EARLIER]
    drift = simulated_drift(NOW - np.array(EARLIER))
    S = np.kron(drift, np.eye(2)) + np.kron(np.ones((2, 2)), now.measurement.covariance)
    for k, fix in enumerate(earlier):
        S[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += fix.measurement.covariance
    generator = np.random.default_rng(2)
    vectors = np.linalg.eigh(S)[1].T
    for direction in (*vectors, *generator.standard_normal((20, 4))):
        edge = math.sqrt(chi_square(AGREEMENT, 4) / (direction @ np.linalg.solve(S, direction))) * direction
        for share, expected in ((0.97, True), (1.03, False)):
            changed = [f._replace(residual=share * edge[2 * k : 2 * k + 2]) for k, f in enumerate(earlier)]
            assert agree(now, changed, NOISE) == expected


@pytest.mark.parametrize("age", [5.0, 17.0])
def test_recovery_is_the_least_squares_of_both_fixes(age: float) -> None:
    """Against information form, in which the way between the fixes' times is an unknown of its own.

    Then = now - age * current - way, the way with the variance of white noise on the position and of a walk of the
    current: position * T + current * T^3 / 3.
    """
    generator = np.random.default_rng(3)
    root = np.diag([2.0, 3.0, 0.1, 0.2, 0.1, 0.05, 0.2, 0.3]) @ (np.eye(8) + 0.2 * generator.standard_normal((8, 8)))
    belief = Gaussian(mean=generator.standard_normal(8), covariance=root @ root.T)
    now, earlier = rejected(NOW, (25.0, -14.0)), rejected(NOW - age, (22.0, -17.0), 2.0)
    found = recover(belief, earlier, now, NOISE)

    prior = belief.covariance.copy()
    prior[[0, 1], [0, 1]] += 25.0**2 + 14.0**2 + 22.0**2 + 17.0**2
    prior[[6, 7], [6, 7]] += NOISE.initial_current**2
    information = np.zeros((10, 10))
    information[:8, :8] = np.linalg.inv(prior)
    information[8:, 8:] = np.eye(2) / (NOISE.position * age + NOISE.current * age**3 / 3.0)
    H_now, H_then = np.hstack([now.H, np.zeros((2, 2))]), np.hstack([earlier.H, -np.eye(2)])
    H_then[:, 6:8] = -age * np.eye(2)
    vector = np.zeros(10)
    for H, fix in ((H_now, now), (H_then, earlier)):
        information += H.T @ np.linalg.solve(fix.measurement.covariance, H)
        vector += H.T @ np.linalg.solve(fix.measurement.covariance, fix.residual)
    covariance = np.linalg.inv(information)
    assert found.mean - belief.mean == pytest.approx((covariance @ vector)[:8], rel=1e-6, abs=1e-8)
    assert found.covariance == pytest.approx(covariance[:8, :8], rel=1e-6, abs=1e-8)
