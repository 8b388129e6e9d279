"""The unscented filter: exact where all is linear, right to second order elsewhere, angles the short way round."""

import math

import numpy as np
import pytest
from test_ekf import Constant, belief, measurement

from estimators.core import ekf, ukf
from estimators.core.errors import NotPositiveDefiniteError, ParameterError
from estimators.core.types import Gaussian, MeasurementModel
from estimators.docking.augmented import AugmentedFilter
from estimators.docking.sensors import HeadingModel, PositionModel
from estimators.planar.model import PRESTERO, PlanarProcess


class Unmarked(MeasurementModel):
    """A sensor that does not say whether it is linear."""

    def __init__(self, model):
        self.evaluate, self.jacobian = model.evaluate, model.jacobian
        self.covariance, self.residual = model.covariance, model.residual


class Range(MeasurementModel):
    """Distance and bearing of the origin, the textbook's nonlinear sensor."""

    def evaluate(self, x, measurement=None):
        return np.array([math.hypot(x[0], x[1]), math.atan2(x[1], x[0])])

    def covariance(self, x, measurement):
        return measurement.covariance

    def residual(self, value, expected):
        difference = value - expected
        return np.array([difference[0], math.remainder(difference[1], 2.0 * math.pi)])


def test_sigma_points_have_the_moments_of_the_belief():
    before = belief(1)
    points, weights = ukf.sigma_points(before)
    mean = weights @ points
    assert weights.sum() == pytest.approx(1.0)
    assert mean == pytest.approx(before.mean, abs=1e-12)
    assert (weights * (points - mean).T) @ (points - mean) == pytest.approx(before.covariance, rel=1e-12, abs=1e-12)


def test_a_linear_process_and_sensor_give_the_kalman_filter():
    before = belief(2, n=2)
    expected = ekf.predict(before, Constant(), (2.0,), 0.5)
    predicted = ukf.predict(before, Constant(), (2.0,), 0.5)
    assert predicted.mean == pytest.approx(expected.mean, abs=1e-12)  # rounding only
    assert predicted.covariance == pytest.approx(expected.covariance, abs=1e-12)
    before = belief(3)
    fix = measurement(before.mean[:2] + 0.3, 0.1)
    for model in (PositionModel(), Unmarked(PositionModel())):
        corrected, innovation = ukf.correct(before, fix, model)
        expected, expected_innovation = ekf.correct(before, fix, PositionModel())
        # Through the inverse of a covariance whose condition number is some 1e4.
        assert corrected.mean == pytest.approx(expected.mean, rel=1e-9, abs=1e-10)
        assert corrected.covariance == pytest.approx(expected.covariance, rel=1e-9, abs=1e-9)
        assert innovation.nis == pytest.approx(expected_innovation.nis, rel=1e-9)


def test_prediction_through_a_wide_heading_is_that_of_monte_carlo():
    """Headings spread by 0.4 rad: the mean way is shorter than that of the mean heading, which an EKF cannot see."""
    process = PlanarProcess(PRESTERO, np.zeros(8))
    mean = np.array([0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0])
    before = Gaussian(mean=mean, covariance=np.diag([1e-6, 1e-6, 0.16, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6]))
    rng = np.random.default_rng(0)
    moved = process.move(rng.multivariate_normal(mean, before.covariance, size=40000), (0.0, 0.0), 0.5)
    unscented = ukf.predict(before, process, (0.0, 0.0), 0.5)
    extended = ekf.predict(before, process, (0.0, 0.0), 0.5)
    # Monte Carlo: a spread of 0.17 m over 40000 points is 1e-3 m; the loss of way, 0.5 (1 - exp(-0.08)) m, is 0.04 m.
    assert unscented.mean[:2] == pytest.approx(moved[:, :2].mean(axis=0), abs=4e-3)
    assert np.linalg.norm(extended.mean[:2] - moved[:, :2].mean(axis=0)) > 0.03


def test_correction_by_a_curved_sensor_has_the_transform_s_covariance():
    mean, P = np.array([10.0, 1.0]), np.diag([1.0, 4.0])
    seen = measurement([10.2, 0.2], 0.01)
    after, innovation = ukf.correct(Gaussian(mean=mean, covariance=P), seen, Range())
    points, weights = ukf.sigma_points(Gaussian(mean=mean, covariance=P))
    values = np.array([Range().evaluate(x, None) for x in points])
    spread, deviations = values - weights @ values, points - mean
    S, cross = (weights * spread.T) @ spread + seen.covariance, (weights * deviations.T) @ spread
    K = cross @ np.linalg.inv(S)
    assert innovation.covariance == pytest.approx(S, rel=1e-12)
    assert after.mean == pytest.approx(mean + K @ (seen.value - weights @ values), rel=1e-12)
    assert after.covariance == pytest.approx(P - K @ S @ K.T, rel=1e-10)


def test_angles_are_taken_the_short_way_round():
    mean = np.array([0, 0, 3.1, 0.8, 0, 0, 0, 0.0])
    before = Gaussian(mean=mean, covariance=0.01 * np.eye(8))
    compass = measurement(-3.1, 0.01, "compass")
    for model in (HeadingModel(), Unmarked(HeadingModel())):
        after, innovation = ukf.correct(before, compass, model)
        assert innovation.residual[0] == pytest.approx(2 * math.pi - 6.2)
        assert after.mean[2] == pytest.approx(3.1 + 0.5 * (2 * math.pi - 6.2))
    turning = Gaussian(mean=np.array([0, 0, 3.1, 0.8, 0, 0.2, 0, 0.0]), covariance=0.01 * np.eye(8))
    predicted = ukf.predict(turning, PlanarProcess(PRESTERO, np.zeros(8)), (0.0, 0.0), 0.5)
    assert -math.pi < predicted.mean[2] < -3.0
    assert predicted.covariance[2, 2] < 0.02  # not that of points on both sides of a jump of 2 pi


def test_errors_have_names():
    flat = Gaussian(mean=np.zeros(8), covariance=np.zeros((8, 8)))
    with pytest.raises(NotPositiveDefiniteError, match="not positive definite"):
        ukf.predict(flat, PlanarProcess(PRESTERO, np.zeros(8)), (0.0, 0.0), 0.5)
    with pytest.raises(ParameterError, match="there are extended, unscented"):
        AugmentedFilter(PRESTERO, transform="cubature")  # pyright: ignore[reportArgumentType]
