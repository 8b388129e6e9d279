"""Maps of a bound: what is sampled, what is hatched, and that symbols and ellipses point where they say."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure

from auvsim.analysis import bound_maps
from auvsim.analysis.bound_maps import MapEllipse, Symbol
from estimators.core.information import Ellipse, range_information, rms_bound

BEACONS = np.array([[0.0, -300.0], [0.0, 100.0]])  # on an east-west line
NORTH, EAST = np.linspace(-200.0, 300.0, 21), np.linspace(-450.5, 350.0, 33)


def sampled():
    return bound_maps.sample(lambda p: rms_bound(range_information(p, BEACONS, 2.0)), NORTH, EAST)


def test_the_grid_is_north_by_east():
    shown = sampled()
    assert shown.bound.shape == (21, 33)
    at = np.array([NORTH[3], EAST[20]])
    assert shown.bound[3, 20] == pytest.approx(float(rms_bound(range_information(at, BEACONS, 2.0))))
    assert np.isinf(shown.bound[NORTH == 0.0]).all()  # on the beacons' line one direction is open


def test_a_map_names_its_blind_region_vehicles_ellipses_and_units():
    figure = Figure()
    axes = figure.subplots()
    symbols = [Symbol("follower", 50.0, -20.0, heading=math.radians(30.0)), Symbol("leaders", 0.0, -300.0)]
    symbols.append(Symbol("leaders", 0.0, 100.0))
    ellipse = MapEllipse(50.0, -20.0, Ellipse(4.0, 2.0, math.radians(20.0)))
    bound_maps.draw(
        axes, sampled(), title="two beacons", blind=9.0, symbols=symbols, ellipses=[ellipse], ellipse_scale=10
    )
    legend = axes.get_legend()
    assert legend is not None
    named = [text.get_text() for text in legend.get_texts()]
    assert named == ["blind: above 9 m", "error ellipse, enlarged 10 times", "follower", "leaders"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east [m]", "north [m]")
    patch = axes.patches[-1]
    # Corners of the major axis: 20 deg east of north, 40 m away, enlarged 10 times.
    ends = patch.get_transform().transform([[1.0, 0.0], [-1.0, 0.0]])
    inverse = axes.transData.inverted().transform(ends)
    east, north = inverse[np.argmax(inverse[:, 1])] - (-20.0, 50.0)
    assert (east, north) == pytest.approx((40.0 * math.sin(math.radians(20.0)), 40.0 * math.cos(math.radians(20.0))))


def test_an_arrow_points_along_its_heading():
    tip = bound_maps._arrow(math.radians(30.0))[0]
    assert tip == pytest.approx((0.5, math.sqrt(0.75)))  # right, up


@pytest.mark.parametrize(("low", "high"), [(0.2, 300.0), (2.3, 4.1), (2.31, 2.34), (0.07, 0.9)])
def test_contours_are_few_and_inside(low, high):
    levels = bound_maps._levels(low, high)
    assert 2 <= len(levels) <= bound_maps.MOST_LEVELS
    assert all(low <= level <= high * 1.001 for level in levels)
    assert levels == sorted(set(levels))
