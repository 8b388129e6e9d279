"""Decisions of a docking against closed forms: predicted miss, speed by the current, depth within reach, the frame."""

import math
from typing import Any

import numpy as np
import pytest

from auvsim.base.reading import Reading
from auvsim.missions.docking import path, speeds
from auvsim.missions.docking.decisions import (
    PredictedMiss,
    SoFar,
    depth_within_reach,
    not_ready,
    predicted_miss,
    reason_to_break_off,
)
from auvsim.missions.docking.heard import Heard
from auvsim.missions.docking.relative import Locator, Relative
from auvsim.missions.docking.settings import DockingSettings
from auvsim.navigation.estimate import COMPASS_BIAS, DEPTH_BIAS, DOCK_HEADING_BIAS, PLANAR_STATES, Estimate

CRAB = math.radians(22.0)


def at(**changed: Any) -> Relative:
    """A vehicle 30 m before the mouth."""
    values = {
        "heading": 0.1, "axis": 0.0, "north": -30.0, "east": 2.0, "along": -30.0, "cross": 2.0, "below": -1.0,
        "velocity": (1.0, 0.0), "current": (0.0, 0.0), "cross_deviation": 0.1, "below_deviation": 0.05,
        "unsteadiness": 0.0, "compass_bias": 0.0, "depth_bias": 0.0,
    }  # fmt: skip
    return Relative(**{**values, **changed})


def test_predicted_miss_is_that_of_line_of_sight() -> None:
    """Integrating the law de/dx = -sin(atan(e / L)) / cos(atan(e / L)) = -e / L from 30 m before the mouth."""
    lookahead, e, step = 7.0, 2.0, 1e-3
    for _ in range(30_000):
        course = -math.atan2(e, lookahead)
        e += step * math.tan(course)
    assert predicted_miss(at(), lookahead).cross == pytest.approx(e, rel=1e-3)  # first-order steps of 1 mm
    assert predicted_miss(at(along=0.5), lookahead).cross == 2.0  # behind the mouth nothing is left to correct


@pytest.mark.parametrize(("cross", "deviation", "beyond"), [(1.0, 0.2, True), (1.0, 0.3, False), (-1.0, 0.2, True)])
def test_a_miss_is_certain_if_the_near_side_of_its_spread_is_out(cross: float, deviation: float, beyond: bool) -> None:
    """0.75 m of mouth: 1.0 - 0.2 is outside, 1.0 - 0.3 is not; to either side."""
    assert PredictedMiss(cross, 0.0, deviation, 0.0).certain_beyond(0.75) == beyond


def test_speed_leaves_the_ground_speed_and_the_crab() -> None:
    """The vector sum: at that speed, course held on the axis, ground speed and crab are within their limits."""
    generator, raised = np.random.default_rng(3), 0
    for _ in range(500):
        axis, set_ = generator.uniform(-math.pi, math.pi, 2)
        drift = generator.uniform(0.0, 1.2)
        current = (drift * math.cos(set_), drift * math.sin(set_))
        speed = speeds.speed_through_water(1.0, axis, current, 0.5, CRAB)
        across = drift * math.sin(set_ - axis)
        assert speeds.ground_speed_along(axis, speed, current) >= 0.5 - 1e-9  # rounding
        assert abs(math.asin(across / speed)) <= CRAB + 1e-9
        slower = speeds.speed_through_water(0.2, axis, current, 0.5, CRAB)
        if speed > 1.0:  # raised no more than needed: one of both is at its limit
            raised += 1
            at_limit = speeds.ground_speed_along(axis, slower, current) - 0.5, abs(math.asin(across / slower)) - CRAB
            assert min(map(abs, at_limit)) < 1e-6
    assert 100 < raised < 500
    assert speeds.speed_through_water(1.0, 0.0, (-3.0, 0.0), 0.5, CRAB, fastest=2.5) == 2.5


def test_fastest_is_where_holding_ends() -> None:
    assert speeds.fastest(lambda speed: speed <= 2.55) == pytest.approx(2.55, abs=0.01)
    assert speeds.fastest(lambda speed: True) == 8.0


def test_no_headway_against_a_stronger_current() -> None:
    """A current of 2 m/s against 1.5 m/s: astern; across: no course holds."""
    assert speeds.ground_speed_along(0.0, 1.5, (-2.0, 0.0)) == pytest.approx(-0.5)
    assert speeds.ground_speed_along(0.0, 1.5, (0.0, 2.0)) <= 0.0


def test_depth_within_reach_is_the_slope_to_where_it_levels_out() -> None:
    """12 degrees over 100 - 15 m and half a metre: 18.57 m, above or below."""
    reach = 0.5 + 85.0 * math.tan(math.radians(12.0))
    for sign in (1.0, -1.0):
        assert depth_within_reach(at(below=sign * (reach - 0.01)), 100.0, math.radians(12.0))
        assert not depth_within_reach(at(below=sign * (reach + 0.01)), 100.0, math.radians(12.0))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_orbit_closes_on_its_circle(side: float) -> None:
    """A point that follows the course comes to the circle and stays on it, in the sense asked for."""
    x, y, step, turned = -20.0, 90.0, 0.5, 0.0
    for _ in range(2000):
        before = math.atan2(y + 5.0, x + 100.0)
        course = path.orbit(at(along=x, cross=y), (-100.0, -5.0), side)
        x, y = x + step * math.cos(course), y + step * math.sin(course)
        turned += math.remainder(math.atan2(y + 5.0, x + 100.0) - before, math.tau)
    # Steps of 0.5 m along tangents end a little outside: step^2 / 2 r each, taken back over a radius.
    assert math.hypot(x + 100.0, y + 5.0) == pytest.approx(path.ORBIT, abs=0.5)
    assert turned * side > 4.0 * math.pi


def estimate(biases: dict[str, float], north: float, east: float, variances: dict[str, float]) -> Estimate:
    names = (*PLANAR_STATES, *biases)
    mean = np.array([north, east, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, *biases.values()])
    return Estimate(
        time=0.0, position=np.array((north, east, 12.0)), heading=0.0, velocity=mean[3:6], current=mean[6:8],
        covariance=np.diag([variances.get(name, 0.0) for name in names]), initialised=True, mean=mean, names=names,
    )  # fmt: skip


def test_all_biases_are_taken_out_in_one_frame() -> None:
    """A dock whose compass shows 3 degrees too much, a compass that shows 2 too little, a gauge 0.4 m too much.

    Truth: axis 0.5 rad, heading 0.6 rad, nose 40 m before the mouth and 2 m to starboard, 1 m below.
    """
    turned, compass = math.radians(3.0), math.radians(-2.0)
    nose, along, cross = 0.8, -40.0, 2.0
    north = along * math.cos(0.5) - cross * math.sin(0.5) - nose * math.cos(0.6)
    east = along * math.sin(0.5) + cross * math.cos(0.5) - nose * math.sin(0.6)
    biases = {COMPASS_BIAS: compass, DOCK_HEADING_BIAS: turned, DEPTH_BIAS: 0.4}
    known = estimate(biases, north, east, {DOCK_HEADING_BIAS: 1e-4, "north": 0.01, "east": 0.01})
    here = Locator((0.0, 0.0), nose, 0.1).locate(0.0, known, 0.6 + compass, 13.4, 0.5 + turned, 12.0)
    assert (here.along, here.cross, here.below) == pytest.approx((along, cross, 1.0))
    assert here.off == pytest.approx(0.1)
    # Across: 0.1 m of position, and 40 m times 0.01 rad of the axis.
    assert here.cross_deviation == pytest.approx(math.hypot(0.1, 0.4))
    assert here.depth_bias == 0.4


def test_current_of_an_estimate_without_one() -> None:
    """Velocities over ground of 1.3 m/s north at 1.0 m/s commanded: 0.3 m/s of current, once it is smoothed."""
    locator = Locator((0.0, 0.0), 0.0, 0.1)
    names = ("north", "east", "heading", "surge", "sway", "yaw_rate")
    mean = np.array([-100.0, 0.0, 0.0, 1.3, -0.2, 0.0])
    over_ground = Estimate(
        time=0.0, position=np.array((-100.0, 0.0, 12.0)), heading=0.0, velocity=mean[3:6], current=np.zeros(2),
        covariance=np.zeros((6, 6)), initialised=True, mean=mean, names=names,
    )  # fmt: skip
    locator.commanded(1.0)
    for _ in range(10):
        here = locator.locate(0.0, over_ground, 0.0, 12.0, 0.0, 12.0)
    assert here.current == pytest.approx((0.3, -0.2))


def test_an_approach_waits_for_depth_by_the_way_through_the_water() -> None:
    """From a gate 200 m off 15 m are flown out; with a following current that leaves 120 m of water, 9 m at most."""
    settings = DockingSettings(descent_deg=6.0)
    assert not_ready(at(below=-15.0), 200.0, 200.0, settings) is None
    assert not_ready(at(below=-15.0), 200.0, 120.0, settings) == "15.0 m above the dock"


@pytest.mark.parametrize(("current", "way"), [((0.0, 0.5), 160.0), ((0.0, -0.4), 250.0), ((1.2, 0.0), 250.0)])
def test_way_through_the_water_is_that_of_the_drifting_vehicle(current: tuple[float, float], way: float) -> None:
    """East for 200 m at 2 m/s: 2.5 and 1.6 m/s over ground; across 1.2 m/s, 1.6 m/s are left."""
    assert speeds.way_through_water(200.0, math.pi / 2, 2.0, current) == pytest.approx(way)


@pytest.mark.parametrize(("cross", "below", "deviation"), [(0.3, 0.4, 0.5), (-1.1, -0.2, 0.9), (0.0, 0.0, 0.05)])
def test_chance_is_the_share_of_draws_within_the_circle(cross: float, below: float, deviation: float) -> None:
    """200 000 draws of the part across, at the depth that is known: their share errs by 0.0011 at most (one sigma)."""
    draws = cross + deviation * np.random.default_rng(4).standard_normal(200_000)
    share = np.mean(np.hypot(draws, below) < 0.75)
    assert PredictedMiss(cross, below, deviation, 0.3).chance_within(0.75) == pytest.approx(share, abs=0.004)


def test_nothing_passes_outside_the_depth_of_the_mouth() -> None:
    assert PredictedMiss(0.0, 0.8, 0.5, 0.0).chance_within(0.75) == 0.0


@pytest.mark.parametrize(
    ("along", "silence", "last", "breaks_off"),
    [
        (-5.0, 0.0, False, False),  # 0.5 m of deviation: within 0.75 m with 87 %
        (-5.0, 8.0, False, True),  # 8 s of a current uncertain by 0.15 m/s: 1.2 m more, 43 %
        (-5.0, 8.0, True, False),  # nothing to lose
        (-7.0, 8.0, False, False),  # a fix may still come
        (-7.0, 24.0, False, True),  # 16 %: it would not help
        (-3.0, 24.0, False, False),  # past the point of no return
    ],
)
def test_it_goes_in_by_the_chance_that_the_last_fix_left(along, silence, last, breaks_off) -> None:
    here = at(along=along, cross=0.0, below=0.0, cross_deviation=0.5, unsteadiness=0.15)
    reason = reason_to_break_off(here, SoFar(silence, 0.0, 1.0, last), DockingSettings(), 0.75, 1.3)
    assert bool(reason) == breaks_off
    assert not reason or reason.startswith("chance of ")


def test_packets_are_foretold_by_their_numbers() -> None:
    """Packets 3, 4 and 7 of one every 8 s, 3 s late, jittered by 0.3 s: two were lost, and the next is due at 75 s."""
    heard = Heard(None)
    assert heard.interval is None
    value = np.array([50.0, 1.0, 2.0, 0.1, 0.0, 0.0, 12.0])
    for number, jitter in ((3, 0.3), (4, -0.2), (7, 0.3)):
        heard.observe([Reading("usbl", 8.0 * number + jitter, 8.0 * number + jitter + 3.0, value, number)])
    assert heard.interval == pytest.approx(8.0)
    last = 8.0 * 7 + 3.3
    assert heard.due(60.0, 12.0, 8.0) == pytest.approx(last + 16.0 - 60.0)
    assert heard.due(60.0, 1.0, 8.0) == pytest.approx(last + 8.0 - 60.0)
