"""NEES, NIS and their intervals against scipy's chi-square and a simulated consistent filter."""

import numpy as np
import pytest
from scipy.stats import chi2

from estimators.consistency import chi_square, fraction_inside, interval, nees, nis
from estimators.errors import ParameterError


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
