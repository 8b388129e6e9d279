"""A structure's wake: exact gradient, conservation of volume and momentum, place and direction."""

import numpy as np
import pytest
from current_fields import build, check_derivatives

WAKE = {"kind": "wake", "north": 3.0, "east": -2.0, "depth": 15.0, "speed": 0.5, "direction_deg": 30.0}
WAKE |= {"drag_area": 2.0, "lee": 0.6, "growth": 0.06}
ALONG = np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0)), 0.0])
ACROSS = np.array([-ALONG[1], ALONG[0], 0.0])
PLACE = np.array([3.0, -2.0, 15.0])


def at(along, across=0.0, down=0.0):
    return build(WAKE).evaluate(0.0, PLACE + along * ALONG + across * ACROSS + down * np.array([0.0, 0.0, 1.0]))


def test_gradient_is_exact():
    """Near the axis the expansions for small distances hold, far off the quotients: both must be met."""
    check_derivatives(build(WAKE), [0, -10, -10, 8], [9, 20, 15, 22], count=150, within=2e-5)
    for along in (-1.0, 0.3, 2.0, 9.0):
        place = PLACE + along * ALONG
        check_derivatives(build(WAKE), [0, *(place - 1e-3)], [1, *(place + 1e-3)], count=3, within=2e-5)


def test_volume_is_conserved():
    random = np.random.default_rng(1)
    for _ in range(100):
        gradient = at(*random.uniform([-4, -3, -3], [20, 3, 3])).gradient
        assert np.trace(gradient) == pytest.approx(0.0, abs=1e-12)
        assert np.abs(gradient).max() < 5.0


@pytest.mark.parametrize("distance", [8.0, 15.0, 30.0])
def test_momentum_lost_is_the_drag(distance):
    """The integral of (U - d) d over the wake is C_D A U^2 / 2 at any distance: 2 m2 are 0.25 m4/s2 at 0.5 m/s."""
    radii, weights = np.polynomial.legendre.leggauss(60)
    radii, weights = 10.0 * (radii + 1.0), 10.0 * weights
    deficits = np.array([-at(distance, r).velocity @ ALONG for r in radii])
    lost = (2.0 * np.pi * radii * weights * deficits * (0.5 - deficits)).sum()
    assert lost == pytest.approx(0.5 * 2.0 * 0.5**2, rel=1e-6)


def test_the_lee_is_behind_and_fades():
    on_axis = [-float(at(x).velocity @ ALONG) for x in np.linspace(-5.0, 60.0, 400)]
    assert max(on_axis) < 0.6 * 0.5
    assert max(on_axis) > 0.7 * 0.6 * 0.5
    assert on_axis[0] < 1e-3 * max(on_axis)
    assert on_axis[-1] < 0.15 * max(on_axis)
    assert abs(at(5.0, 6.0).velocity @ ALONG) < 1e-6
    # The wake fills from the sides: inward across.
    assert at(10.0, 1.0).velocity @ ACROSS < 0.0 < at(10.0, -1.0).velocity @ ACROSS
    assert at(10.0, 0.0, 1.0).velocity[2] < 0.0


def test_still_water_has_no_wake():
    water = build({**WAKE, "speed": 0.0}).evaluate(0.0, PLACE + 2.0 * ALONG)
    assert not water.velocity.any()
    assert not water.gradient.any()
