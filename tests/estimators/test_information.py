"""Static Fisher information against closed forms, finite differences of log-likelihoods, and criteria by definition."""

import math

import numpy as np
import pytest

from estimators.core.errors import NotPositiveDefiniteError, ParameterError
from estimators.core.information import (
    bearing_information,
    bound,
    criteria,
    error_ellipse,
    marginal,
    range_information,
    rms_bound,
)

LEADERS = np.array([[700.0, 130.0], [-420.0, -560.0], [55.0, -810.0]])
SIGMAS = np.array([1.5, 2.0, 4.5])
PLACE = np.array([13.0, -37.0])


def expected_information(show, x, sigmas):
    """J' J of normalised values by central differences: the information of independent Gaussian values."""
    h = 1e-4
    J = np.array([(show(x + h * e) - show(x - h * e)) / (2.0 * h) for e in np.eye(x.size)]).T / sigmas[:, None]
    return J.T @ J


def test_ranges_carry_the_information_of_their_derivatives():
    def show(x):
        return np.linalg.norm(x - LEADERS, axis=1)

    F = range_information(PLACE, LEADERS, SIGMAS)
    np.testing.assert_allclose(F, expected_information(show, PLACE, SIGMAS), rtol=1e-7)


def test_bearings_and_elevations_carry_the_information_of_their_derivatives_in_3d():
    beacons = np.column_stack((LEADERS, [12.0, 40.0, -5.0]))
    x = np.array([*PLACE, 90.0])
    turns, tilts = np.array([0.01, 0.02, 0.03]), np.array([0.04, 0.015, 0.02])

    def show(x):
        away = x - beacons
        bearings = np.arctan2(away[:, 1], away[:, 0])
        return np.concatenate((bearings, np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1]))))

    F = bearing_information(x, beacons, turns, tilts)
    np.testing.assert_allclose(F, expected_information(show, x, np.concatenate((turns, tilts))), rtol=1e-6)


def test_ranges_in_3d_and_a_bearing_in_2d():
    beacons = np.column_stack((LEADERS, [12.0, 40.0, -5.0]))
    x = np.array([*PLACE, 90.0])
    F = range_information(x, beacons, SIGMAS)
    np.testing.assert_allclose(
        F, expected_information(lambda x: np.linalg.norm(x - beacons, axis=1), x, SIGMAS), rtol=1e-7
    )
    # One bearing of 0.02 rad to a beacon 50 m south: 1 m to the east.
    F = bearing_information([0.0, 0.0], [[-50.0, 0.0]], 0.02)
    np.testing.assert_allclose(F, [[0.0, 0.0], [0.0, 1.0]], atol=1e-12)


def test_determinant_by_pairs_of_bearings():
    """det F = sum over pairs of sin^2(theta_i - theta_j) / (sigma_i sigma_j)^2."""
    F = range_information(PLACE, LEADERS, SIGMAS)
    theta = np.arctan2(*(PLACE - LEADERS).T[::-1])
    pairs = [(0, 1), (0, 2), (1, 2)]
    by_pairs = sum(math.sin(theta[i] - theta[j]) ** 2 / (SIGMAS[i] * SIGMAS[j]) ** 2 for i, j in pairs)
    assert criteria(F).d == pytest.approx(by_pairs, rel=1e-12)


def test_criteria_follow_their_definitions_and_grids_broadcast():
    places = PLACE + np.random.default_rng(3).normal(0.0, 200.0, (4, 5, 2))
    F = range_information(places, LEADERS, SIGMAS)
    assert F.shape == (4, 5, 2, 2)
    d, a, e = criteria(F)
    values = np.linalg.eigvalsh(F)
    np.testing.assert_allclose(d, values.prod(axis=-1), rtol=1e-12)
    np.testing.assert_allclose(a, 1.0 / (1.0 / values).sum(axis=-1), rtol=1e-12)
    np.testing.assert_allclose(e, values[..., 0], rtol=1e-12)
    np.testing.assert_allclose(rms_bound(F) ** -2, a, rtol=1e-12)


def test_a_line_of_beacons_leaves_a_direction_open():
    F = range_information([0.0, 0.0], [[100.0, 0.0], [-70.0, 0.0]], 2.0)
    assert np.isinf(rms_bound(F))
    assert np.isinf(np.diagonal(bound(F))).all()
    assert criteria(F).a == 0.0


def test_ellipse_axes_bearing_and_probability():
    """A covariance built of its axes gives them back; 95 % of a Gaussian lies inside."""
    bearing = math.radians(127.0)
    c, s = math.cos(bearing), math.sin(bearing)
    R = np.array([[c, -s], [s, c]])
    P = R @ np.diag([9.0, 4.0]) @ R.T
    found = error_ellipse(P)
    assert found == pytest.approx((3.0, 2.0, bearing))
    assert found.area == pytest.approx(6.0 * math.pi)
    large = error_ellipse(P, 0.95)
    errors = np.random.default_rng(5).multivariate_normal((0.0, 0.0), P, 20000) @ R
    inside = np.mean((errors[:, 0] / large.major) ** 2 + (errors[:, 1] / large.minor) ** 2 < 1.0)
    assert inside == pytest.approx(0.95, abs=4.0 * math.sqrt(0.95 * 0.05 / 20000))


def test_what_is_unknown_besides_costs_its_share():
    """Two places known only by their difference and one of them: the marginal is that of the sum of variances."""
    F = np.array([[0.25, -0.25], [-0.25, 0.25 + 1.0 / 9.0]])  # difference to 2 m, the second to 3 m
    assert marginal(F, 1)[0, 0] == pytest.approx(1.0 / (4.0 + 9.0))
    with pytest.raises(NotPositiveDefiniteError):
        marginal(np.array([[1.0, 0.0], [0.0, 0.0]]), 1)


@pytest.mark.parametrize(
    ("place", "deviations"), [((700.0, 130.0), 2.0), ((0.0, 0.0), 0.0), ((0.0, 0.0), math.nan), ((0.0, 0.0, 1.0), 1.0)]
)
def test_what_cannot_be_is_refused(place, deviations):
    with pytest.raises(ParameterError):
        range_information(place, LEADERS, deviations)
