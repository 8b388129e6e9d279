"""The extended Kalman filter against the textbook's formulas, and its errors."""

import math

import numpy as np
import pytest

from estimators.core import loops
from estimators.core.consistency import chi_square
from estimators.core.ekf import correct, correct_angle, correct_linear, predict
from estimators.core.errors import NotFiniteError, NotPositiveDefiniteError
from estimators.core.types import Gaussian, Measurement, ProcessModel
from estimators.docking.sensors import HeadingModel, PositionModel
from estimators.planar.model import PRESTERO, PlanarProcess


def belief(seed=0, n=8):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, n))
    mean = rng.standard_normal(n)
    return Gaussian(mean=mean, covariance=root @ root.T)


def measurement(value, variance, kind="usbl"):
    value = np.atleast_1d(np.array(value, dtype=float))
    return Measurement(
        kind=kind, value=value, covariance=np.diag(np.full(value.size, variance)), stamp=0.0, received=0.0
    )


class Constant(ProcessModel):
    """A user's own process: x' = A x + B u."""

    A = np.array([[1.0, 0.5], [0.0, 0.9]])

    def evaluate(self, x, u, dt):
        return self.A @ x + dt * np.array([0.0, u[0]])

    def jacobian(self, x, u, dt):
        return self.A

    def covariance(self, x, u, dt):
        return dt * np.diag([0.1, 0.2])


class Broken(Constant):
    def evaluate(self, x, u, dt):
        return x * math.nan


@pytest.mark.parametrize("m", [1, 2, 4])
def test_correction_equals_the_information_form(m):
    before = belief(m)
    rng = np.random.default_rng(10 + m)
    H, root, residual = rng.standard_normal((m, 8)), rng.standard_normal((m, m)), rng.standard_normal(m)
    R = root @ root.T + np.eye(m)
    after, innovation = correct_linear(before, H, residual, R)
    information = np.linalg.inv(before.covariance) + H.T @ np.linalg.solve(R, H)
    S = H @ before.covariance @ H.T + R
    # Rounding of inverses: the random covariances have condition numbers up to some 1e4.
    assert after.covariance == pytest.approx(np.linalg.inv(information), rel=1e-9, abs=1e-10)
    assert after.mean == pytest.approx(before.mean + after.covariance @ H.T @ np.linalg.solve(R, residual), rel=1e-9)
    assert innovation.covariance == pytest.approx(S, rel=1e-12)
    assert innovation.nis == pytest.approx(residual @ np.linalg.solve(S, residual), rel=1e-10)
    assert innovation.gain == pytest.approx(before.covariance @ H.T @ np.linalg.inv(S), rel=1e-8, abs=1e-10)
    assert (after.covariance == after.covariance.T).all()


def test_joint_correction_equals_sequential():
    before = belief(3)
    heading, position = measurement(before.mean[2] + 0.1, 1e-3, "compass"), measurement(before.mean[:2] + 0.2, 0.01)
    sequential, _ = correct(before, heading, HeadingModel())
    residual = position.value - sequential.mean[:2]
    sequential, _ = correct_linear(sequential, np.eye(2, 8), residual, position.covariance)
    H = np.eye(3, 8)
    joint, _ = correct_linear(before, H, np.array([0.2, 0.2, 0.1]), np.diag([0.01, 0.01, 1e-3]))
    assert joint.mean == pytest.approx(sequential.mean, rel=1e-10)
    assert joint.covariance == pytest.approx(sequential.covariance, rel=1e-9, abs=1e-12)


def test_tiny_noise_leaves_a_positive_covariance():
    before = Gaussian(mean=np.zeros(8), covariance=belief(4).covariance * 1e4)
    after, _ = correct_linear(before, np.eye(2, 8), np.ones(2), 1e-10 * np.eye(2))
    assert np.linalg.eigvalsh(after.covariance)[0] > 0.0  # where P - K S K' loses its sign to rounding


def test_own_process_by_the_generic_path():
    before = belief(5, n=2)
    after = predict(before, Constant(), (2.0,), 0.5)
    A = Constant.A
    assert after.mean == pytest.approx(A @ before.mean + [0.0, 1.0])
    assert after.covariance == pytest.approx(A @ before.covariance @ A.T + np.diag([0.05, 0.1]))


def test_generic_path_equals_the_compiled_one():
    process = PlanarProcess(PRESTERO, np.full(8, 1e-3))

    class Uncompiled(ProcessModel):
        evaluate, jacobian, covariance = process.evaluate, process.jacobian, process.covariance

    before = belief(6)
    compiled, generic = (predict(before, p, (0.1, 0.0), 0.5) for p in (process, Uncompiled()))
    assert compiled.mean == pytest.approx(generic.mean, rel=1e-13)
    assert compiled.covariance == pytest.approx(generic.covariance, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("model", [HeadingModel(), PositionModel((0.6, -0.2))])
def test_measurement_jacobians_equal_finite_differences(model):
    x, h = belief(7).mean, 1e-5
    columns = [(model.evaluate(x + h * e) - model.evaluate(x - h * e)) / (2 * h) for e in np.eye(8)]
    assert model.jacobian(x) == pytest.approx(np.array(columns).T, abs=1e-6)  # truncation h^2 = 1e-10


def test_heading_innovation_is_the_short_way_round():
    before = Gaussian(mean=np.array([0, 0, 3.1, 0.8, 0, 0, 0, 0.0]), covariance=np.eye(8))
    _, innovation = correct(before, measurement(-3.1, 0.1, "compass"), HeadingModel())
    assert innovation.residual[0] == pytest.approx(2 * math.pi - 6.2)


@pytest.mark.parametrize("heading", [HeadingModel(), HeadingModel(8, bias=6)], ids=["plain", "biased"])
def test_an_angle_at_once_is_the_angle_by_the_long_way(heading):
    before = belief(10)
    for value in (-3.1, 0.0, 3.1):
        sample = measurement(value, 0.1, "compass")
        after, nis = correct_angle(before, heading.jacobian(before.mean), sample.value, sample.covariance)
        expected, innovation = correct(before, sample, heading)
        assert nis == innovation.nis
        assert (after.mean == expected.mean).all()
        assert (after.covariance == expected.covariance).all()


@pytest.mark.parametrize("angle", [-7.0, -math.pi, -1.0, 0.0, math.pi, 3.5, 100.0])
def test_wrap(angle):
    wrapped = loops.wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0, abs=1e-12)
    if -math.pi < angle <= math.pi:
        assert wrapped == angle


def test_gate_rejects_and_leaves_the_belief():
    before = Gaussian(mean=np.zeros(8), covariance=np.eye(8))
    # NIS of a position (d, 0) is d^2 / (1 + 1).
    edge = math.sqrt(2.0 * chi_square(0.99, 2))
    inside, accepted = correct(before, measurement([0.999 * edge, 0.0], 1.0), PositionModel(), gate=0.99)
    outside, refused = correct(before, measurement([1.001 * edge, 0.0], 1.0), PositionModel(), gate=0.99)
    assert accepted.accepted
    assert inside.mean[0] == pytest.approx(0.999 * edge / 2)
    assert not refused.accepted
    assert outside is before


def test_errors_have_names():
    before = belief(8)
    with pytest.raises(NotPositiveDefiniteError, match="not positive definite"):
        correct_linear(before, np.zeros((1, 8)), np.ones(1), np.zeros((1, 1)))
    with pytest.raises(NotFiniteError, match="not finite"):
        correct_linear(before, np.eye(1, 8), np.full(1, math.inf), np.eye(1))
    with pytest.raises(NotPositiveDefiniteError, match="not positive definite"):
        correct_angle(before, np.zeros((1, 8)), np.ones(1), np.zeros((1, 1)))
    overflowing = Gaussian(mean=before.mean, covariance=1e308 * np.eye(8))
    with pytest.raises(NotFiniteError, match="not finite"):
        correct_angle(overflowing, np.eye(1, 8), np.ones(1), np.eye(1))
    with pytest.raises(NotFiniteError, match="not finite"):
        predict(belief(9, n=2), Broken(), (0.0,), 0.5)
