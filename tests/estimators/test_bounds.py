"""The posterior Cramér-Rao bound: the Kalman filter's covariance where all is linear, Tichavsky's form elsewhere."""

import numpy as np
import pytest

from estimators.core import ekf
from estimators.core.bounds import PosteriorBound, inverse
from estimators.core.errors import NotPositiveDefiniteError
from estimators.core.history import History
from estimators.core.types import Gaussian, Measurement, MeasurementModel, ProcessModel

P0 = np.diag([1.0, 0.5])
Q = np.array([[0.02, 0.01], [0.01, 0.05]])


class Linear(ProcessModel):
    A = np.array([[1.0, 0.5], [0.0, 0.9]])

    def evaluate(self, x, u, dt):
        return np.linalg.matrix_power(self.A, round(dt / 0.5)) @ x

    def jacobian(self, x, u, dt):
        return self.A

    def covariance(self, x, u, dt):
        return Q


class Growth(Linear):
    """Scalar, nonlinear: x' = x + 0.5 sin x, y = x^2 / 2."""

    def jacobian(self, x, u, dt):
        return np.array([[1.0 + 0.5 * np.cos(x[0])]])

    def covariance(self, x, u, dt):
        return np.array([[0.1]])


class First(MeasurementModel):
    def __init__(self, slope):
        self.jacobian = slope

    def covariance(self, x, measurement):
        return measurement.covariance


def seen(stamp, received=None):
    return Measurement(
        kind="y", value=np.zeros(1), covariance=np.array([[0.3]]), stamp=stamp, received=received or stamp
    )


def bound_history(process, model, truths, prior):
    first = lambda nodes, index: prior if nodes[index].time == 0.0 else None  # noqa: E731
    return History(PosteriorBound(process, {"y": model}, truths, first), step=0.5)


def test_linear_bound_is_the_kalman_covariance():
    H = np.array([[1.0, 0.0]])
    history = bound_history(Linear(), First(lambda x, m: H), lambda time: np.zeros((3, 2)), P0)
    belief = Gaussian(mean=np.zeros(2), covariance=P0)
    for k in range(20):
        history.append(0.5 * k, (), [seen(0.5 * k)])
        state = history.replay()
        if k:
            belief = ekf.predict(belief, Linear(), (), 0.5)
            belief, _ = ekf.correct_linear(belief, H, np.zeros(1), np.array([[0.3]]))
        assert state is not None
        assert state.belief.covariance == pytest.approx(belief.covariance, rel=1e-9)  # rounding of a few inverses


def test_nonlinear_bound_is_tichavskys():
    rng = np.random.default_rng(0)
    paths = rng.standard_normal((50, 11, 1)).cumsum(axis=1)
    history = bound_history(
        Growth(), First(lambda x, m: np.array([[x[0]]])), lambda time: paths[:, round(time / 0.5)], np.eye(1)
    )
    J = 1.0
    for k in range(11):
        history.append(0.5 * k, (), [seen(0.5 * k)])
        state = history.replay()
        if k:
            F = 1.0 + 0.5 * np.cos(paths[:, k - 1, 0])
            D11, D12, D22 = np.mean(F**2) / 0.1, -np.mean(F) / 0.1, 1 / 0.1 + np.mean(paths[:, k, 0] ** 2) / 0.3
            J = D22 - D12**2 / (J + D11)
        assert state is not None
        assert state.information[0, 0] == pytest.approx(J, rel=1e-10)


def test_a_late_measurement_counts_from_its_arrival():
    H = np.array([[1.0, 0.0]])
    prompt, late = (bound_history(Linear(), First(lambda x, m: H), lambda time: np.zeros((1, 2)), P0) for _ in range(2))
    for k in range(6):
        for history in (prompt, late):
            history.append(0.5 * k, (), [seen(0.0)] if k == 0 else [])
        if k == 2:
            prompt.insert(seen(1.0))
        if k == 4:
            late.insert(seen(1.0, 2.0))
        a, b = prompt.replay(), late.replay()
        assert a is not None
        assert b is not None
        if k in (2, 3):
            assert a.belief.covariance[0, 0] < b.belief.covariance[0, 0]
        else:
            assert (a.information == b.information).all()


def test_inverse_of_badly_scaled_matrices():
    C, units = np.array([[1.0, 0.3], [0.3, 1.0]]), np.outer((1e-9, 1e6), (1e-9, 1e6))
    assert inverse(C * units) == pytest.approx(np.linalg.inv(C) / units, rel=1e-12, abs=0.0)
    with pytest.raises(NotPositiveDefiniteError, match="not positive definite"):
        inverse(np.diag([1.0, 0.0]))
