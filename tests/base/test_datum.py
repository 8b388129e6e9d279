"""The datum against closed forms of the ellipsoid and an independent inverse."""

import numpy as np
import pytest
from scipy.optimize import fsolve

from auvsim.base.datum import Datum, ecef_to_geodetic, geodetic_to_ecef
from auvsim.base.errors import InputError

A, B = 6378137.0, 6356752.314245179  # semi-axes of WGS84 [m] (NGA.STND.0036, table 3.1 and derived)
PLACES = [(63.4, 10.4), (-33.9, 151.2), (0.0, 0.0), (41.5, -70.7), (-78.0, 179.99), (12.3, -179.99)]


def test_axes_of_the_ellipsoid():
    assert geodetic_to_ecef(0.0, 0.0) == pytest.approx([A, 0, 0], abs=1e-9)
    assert geodetic_to_ecef(0.0, 90.0, 10.0) == pytest.approx([0, A + 10.0, 0], abs=1e-8)
    assert geodetic_to_ecef(-90.0, 33.0, 5.0) == pytest.approx([0, 0, -B - 5.0], abs=1e-8)


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_a_place_lies_on_the_ellipsoid_and_height_along_its_normal(latitude, longitude):
    x, y, z = geodetic_to_ecef(latitude, longitude)
    assert (x * x + y * y) / A**2 + z * z / B**2 == pytest.approx(1.0, abs=1e-14)
    gradient = np.array([x / A**2, y / A**2, z / B**2])
    normal = gradient / np.linalg.norm(gradient)
    # 1e-9 m is a rounding of 6e6 m.
    assert geodetic_to_ecef(latitude, longitude, 70.0) - [x, y, z] == pytest.approx(70.0 * normal, abs=3e-9)


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_axes_of_ned_are_tangents_and_normal(latitude, longitude):
    """By differences of the forward map alone: a little more latitude is north, longitude east, height up."""
    datum = Datum(latitude=latitude, longitude=longitude)
    step = 1e-4  # [deg], some 10 m: the curvature's share is 1e-6 of it
    for index, (dlat, dlon, dh) in enumerate([(step, 0.0, 0.0), (0.0, step, 0.0), (0.0, 0.0, -10.0)]):
        ned = datum.ned(latitude + dlat, longitude + dlon, dh)
        direction = ned / np.linalg.norm(ned)
        assert direction == pytest.approx(np.eye(3)[index], abs=2e-6)
    assert datum.ned(latitude, longitude) == pytest.approx(np.zeros(3), abs=1e-9)


def test_lengths_of_a_degree():
    """A short way north and east is M dphi and N cos(phi) dlambda, with the ellipsoid's two radii of curvature."""
    phi = np.radians(63.4)
    e2 = 1.0 - (B / A) ** 2
    root = np.sqrt(1.0 - e2 * np.sin(phi) ** 2)
    meridian, prime = A * (1.0 - e2) / root**3, A / root
    datum = Datum(latitude=63.4, longitude=10.4)
    north = datum.ned(63.4 + 1e-4, 10.4)[0]
    east = datum.ned(63.4, 10.4 + 1e-4)[1]
    assert north == pytest.approx(meridian * np.radians(1e-4), rel=1e-6)
    assert east == pytest.approx(prime * np.cos(phi) * np.radians(1e-4), rel=1e-6)


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_there_and_back(latitude, longitude):
    random = np.random.default_rng(1)
    position = random.uniform(-1.0, 1.0, (40, 3)) * [5e4, 5e4, 6e3]
    datum = Datum(latitude=latitude, longitude=longitude)
    geodetic = datum.geodetic(position)
    assert datum.ned(*geodetic) == pytest.approx(position, abs=1e-8)  # rounding of 6e6 m is 1e-9
    assert np.all(np.abs(geodetic.longitude) <= 180.0)


def test_the_inverse_solves_the_forward_map():
    """An independent inverse: Newton's method on the forward map written out here."""

    def forward(unknown):
        phi, height = unknown
        normal = A**2 / np.hypot(A * np.cos(phi), B * np.sin(phi))
        p, z = (normal + height) * np.cos(phi), (normal * (B / A) ** 2 + height) * np.sin(phi)
        return [(p - 5.1e6) / A, (z - 3.9e6) / A]

    phi, height = fsolve(forward, [0.65, 0.0], xtol=1e-14)
    lam = 2.1
    found = ecef_to_geodetic(np.array([5.1e6 * np.cos(lam), 5.1e6 * np.sin(lam), 3.9e6]))
    assert found.latitude == pytest.approx(np.degrees(phi), abs=1e-11)
    assert found.longitude == pytest.approx(np.degrees(lam), abs=1e-12)
    assert found.height == pytest.approx(height, abs=1e-6)


@pytest.mark.parametrize(("latitude", "longitude"), [(90.1, 0.0), (0.0, 180.5), (float("nan"), 0.0)])
def test_a_place_off_the_earth_is_refused(latitude, longitude):
    with pytest.raises(InputError, match="latitude must be within -90 to 90"):
        Datum(latitude=latitude, longitude=longitude)
