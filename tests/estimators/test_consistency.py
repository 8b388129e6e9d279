"""NEES, NIS and their intervals against scipy's chi-square and a simulated consistent filter."""

import numpy as np
import pytest
from scipy.stats import chi2

from estimators.core.consistency import (
    assess,
    autocorrelation,
    chi_square,
    effective_samples,
    fraction_inside,
    interval,
    ljung_box,
    nees,
    nis,
    whiten,
)
from estimators.core.errors import ParameterError


@pytest.mark.parametrize("dof", [1, 2, 8, 320])
def test_quantiles_equal_scipy(dof):
    for probability in (0.005, 0.5, 0.999):
        assert chi_square(probability, dof) == pytest.approx(chi2.ppf(probability, dof), rel=1e-9)


def test_pooled_interval_narrows_about_the_degrees_of_freedom():
    low, high = interval(8, samples=100)
    assert (low, high) == pytest.approx((chi2.ppf(0.025, 800) / 100, chi2.ppf(0.975, 800) / 100))
    assert interval(8)[0] < low < 8 < high < interval(8)[1]


def test_consistent_errors_lie_inside():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((3, 3))
    P = root @ root.T
    errors = rng.standard_normal((4000, 3)) @ root.T
    values = nees(errors, np.broadcast_to(P, (4000, 3, 3)), np.zeros((4000, 3)))
    low, high = interval(3, samples=4000, probability=0.999)
    assert low < values.mean() < high
    # Binomial: sqrt(0.95 * 0.05 / 4000) = 0.0034, three of them.
    assert fraction_inside(values, 3) == pytest.approx(0.95, abs=0.0105)
    assert not low < nis(1.1 * errors, np.broadcast_to(P, (4000, 3, 3))).mean() < high


def test_angles_are_wrapped():
    value = nees(np.array([0.0, 3.1]), np.eye(2), np.array([0.0, -3.1]), angles=(1,))
    assert value == pytest.approx((2 * np.pi - 6.2) ** 2)


def test_bad_probability_is_refused():
    with pytest.raises(ParameterError, match="probability"):
        chi_square(1.5, 2)


def correlated(rng, count, rho):
    """A stationary first-order autoregression of unit variance."""
    x = np.empty(count)
    x[0] = rng.standard_normal()
    for k in range(1, count):
        x[k] = rho * x[k - 1] + np.sqrt(1 - rho**2) * rng.standard_normal()
    return x


def test_effective_samples_of_an_autoregression():
    rng = np.random.default_rng(1)
    rho, count = 0.9, 50_000
    # k (1 - rho) / (1 + rho) in theory; the sum of so many sampled autocorrelations scatters by some per cent.
    expected = count * (1 - rho) / (1 + rho)
    assert effective_samples(correlated(rng, count, rho)) == pytest.approx(expected, rel=0.15)
    assert effective_samples(rng.standard_normal(count)) == pytest.approx(count, rel=0.05)
    assert effective_samples(np.ones(10)) == 1.0


def test_runs_are_assessed_with_the_samples_they_hold():
    rng = np.random.default_rng(2)
    missed = 0
    for _ in range(100):
        values = np.array([[correlated(rng, 400, 0.8) ** 2 for _ in range(2)] for _ in range(4)]).sum(axis=1)
        found = assess(values, 2)
        missed += not found.holds
        assert 4 * 400 > found.samples > 50
    # 5 % expected; the sampled correlation times leave a few more out. Counting all values as independent, it is 40.
    assert missed < 15
    values = rng.chisquare(2, (5, 400))
    assert assess(values, 2).holds
    assert not assess(1.3 * values, 2).holds
    assert assess(values[0], 2).samples < assess(values, 2).samples


def test_whitened_innovations_have_unit_covariance():
    rng = np.random.default_rng(3)
    root = np.array([[2.0, 0.0], [1.0, 0.5]])
    residual = rng.standard_normal((20_000, 2)) @ root.T
    white = whiten(residual, np.broadcast_to(root @ root.T, (20_000, 2, 2)))
    assert np.cov(white.T) == pytest.approx(np.eye(2), abs=0.04)  # four deviations of 1 / sqrt(20000 / 2)


def test_autocorrelation_of_white_and_of_correlated_innovations():
    rng = np.random.default_rng(4)
    white = autocorrelation(rng.standard_normal((5000, 2)), 20)
    assert np.abs(white).max() < 4.0 / np.sqrt(5000 * 2)
    assert white.std() == pytest.approx(1.0 / np.sqrt(5000 * 2), rel=0.5)
    assert autocorrelation(correlated(rng, 50_000, 0.7)[:, None], 3) == pytest.approx([0.7, 0.49, 0.343], abs=0.03)


def test_ljung_box_tells_white_from_correlated():
    rng = np.random.default_rng(5)
    probabilities = [ljung_box(rng.standard_normal((300, 2))).probability for _ in range(400)]
    # Uniform, if white: mean 0.5 with a deviation of 0.289 / 20, four of them; 5 % below 0.05 with one of 1.1 %.
    assert np.mean(probabilities) == pytest.approx(0.5, abs=0.06)
    assert np.mean(np.array(probabilities) < 0.05) == pytest.approx(0.05, abs=0.045)
    found = ljung_box(np.stack([correlated(rng, 300, 0.4) for _ in range(2)], axis=1))
    assert found.dof == 20
    assert found.probability < 1e-4
    with pytest.raises(ParameterError, match="too few"):
        ljung_box(np.zeros((19, 1)))
