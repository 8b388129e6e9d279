"""The hovering controller: attitude by gyro and compass, its law, and a vehicle that it holds by its own sensors."""

import math

import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.base.frames import rotation
from auvsim.base.reading import Reading
from auvsim.control import registry
from auvsim.control.attitude import Attitude
from auvsim.control.controller import ControllerSetup, Setpoints, Station
from auvsim.control.hovering import Hovering, HoveringController, HoveringSettings
from auvsim.navigation.estimate import Estimate
from auvsim.physics.planar_fit import Level
from auvsim.physics.propulsion import propulsion
from auvsim.vehicles import library

ROV, DENSITY, PERIOD = "bluerov2_heavy", 1026.0, 0.1
ACTUATION = library.vehicle(ROV).actuation
SURGE_DRAG = lambda u: 13.7 * u + 141.0 * u * abs(u)  # noqa: E731 (README of the vehicle)


def controller(**settings):
    return HoveringController(
        ControllerSetup(
            settings=HoveringSettings(**settings),
            actuation=ACTUATION,
            ahead=propulsion(ROV, 1.0, DENSITY).ahead,
            period=PERIOD,
        )
    )


def shown(made, *, heading=0.4, pitch=0.0, roll=0.0, depth=10.0, time=0.0):
    made.observe(
        [
            Reading("compass", time, time, np.array([heading, pitch, roll])),
            Reading("depth", time, time, np.array([depth])),
        ]
    )


def estimate(**views):
    known = {"time": 0.0, "position": np.array([3.0, -2.0, 10.0]), "heading": 0.4, "velocity": np.zeros(3)}
    return Estimate(**{**known, "current": np.zeros(2), "covariance": np.eye(8), "initialised": True, **views})


def test_the_demand_of_a_speed_is_the_vehicles_drag():
    """And what its thrusters cannot give is not held."""
    ahead, holds = propulsion(ROV, 1.0, DENSITY)
    for speed in (0.3, 0.7):
        assert ahead(speed).surge == pytest.approx(SURGE_DRAG(speed), rel=1e-9)
    assert ahead(0.0).surge == 0.0
    assert holds(0.7)
    assert not holds(1.2)  # 220 N, more than 4 x 51.5 x cos 45 = 146 N


def test_resistance_is_that_of_each_axis():
    level = Level(ROV, DENSITY)
    still = level.resistance(np.zeros(6))
    assert (level.resistance((0.0, 0.4, 0.0, 0.0, 0.0, 0.0)) - still)[1] == pytest.approx(-217.0 * 0.16, rel=1e-9)
    heave = (level.resistance((0.0, 0.0, -0.3, 0.0, 0.0, 0.0)) - still)[2]
    assert heave == pytest.approx(33.0 * 0.3 + 190.0 * 0.09, rel=1e-9)


def test_attitude_follows_a_gyro_and_forgets_its_bias():
    """A gyro that shows 0.02 rad/s too much leaves bias x time constant; noise of the compass is averaged."""
    generator, made, bias = np.random.default_rng(3), Attitude(time_constant=1.0), np.array([0.02, -0.01, 0.03])
    truth = np.array([0.1, -0.2, 2.0])
    found = []
    for k in range(600):
        time = k * PERIOD
        made.turned(time, bias)
        made.shown(time, truth + 0.01 * generator.standard_normal(3))
        if k > 100:
            found.append(made.angles - truth)
    turning = np.array(
        [
            0.02 + math.tan(-0.2) * (-0.01 * math.sin(0.1) + 0.03 * math.cos(0.1)),
            -0.01 * math.cos(0.1) - 0.03 * math.sin(0.1),
        ]
    )
    # a tenth of each innovation is taken: what is left is (1 - 0.1) of a time constant's turning
    assert np.mean(found, axis=0)[:2] == pytest.approx(0.9 * turning, abs=2e-3)
    assert np.std(found, axis=0).max() < 0.01 * math.sqrt(0.1 / 1.9) * 1.3  # of a filter of gain 0.1


def test_attitude_turns_by_eulers_kinematics():
    """A constant body rate for three seconds, against the rotation that it is; the compass is seen once."""
    rates, start = np.array([0.3, -0.2, 0.5]), (0.2, -0.3, 1.0)
    made, step = Attitude(), 1e-3
    made.shown(0.0, np.array(start))
    for k in range(1, 3001):
        made.turned(k * step, rates)
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_matrix(rotation(*start)) * Rotation.from_rotvec(3.0 * rates)
    assert rotation(*made.angles.tolist()) == pytest.approx(turned.as_matrix(), abs=2e-3)  # first order in the step


def test_the_law_pushes_to_its_place_in_the_vehicles_axes():
    """Place 0.5 m east of a vehicle that looks 0.4 rad off north, without integral: a force in the body's axes."""
    law = Hovering(HoveringSettings(integral=(0.0, 0.0, 0.0)), PERIOD)
    found = law.command(np.array([0.0, 0.5, 0.0]), np.array([0.0, 0.0, 0.4]), np.zeros(6), 0.4)
    assert found[:2] == pytest.approx((30.0 * math.sin(0.4), 30.0 * math.cos(0.4)))
    far = law.command(np.array([0.0, 50.0, 0.0]), np.array([0.0, 0.0, 0.4]), np.zeros(6), 0.4)
    assert math.hypot(*far[:2]) == pytest.approx(60.0)  # no more than of the reach of 1 m
    turned = law.command(np.zeros(3), np.array([0.0, 0.0, 0.4]), np.zeros(6), 0.4 + math.pi + 0.1)
    assert turned.yaw == pytest.approx(-6.0 * 0.5)  # the short way round, and no more than of 0.5 rad


def test_axes_that_are_not_held_get_no_force():
    law = Hovering(HoveringSettings(), PERIOD)
    for _ in range(20):
        law.command(np.array([0.3, -0.2, 0.1]), np.zeros(3), np.zeros(6), 0.0)
    free = law.command(np.array([math.nan, math.nan, 0.1]), np.zeros(3), np.zeros(6), 0.0)
    assert free.surge == free.sway == 0.0
    assert free.heave > 80.0 * 0.1  # whose integral goes on


def test_a_place_is_held_on_the_estimate_and_a_speed_in_the_open_loop():
    made = controller(integral=(0.0, 0.0, 0.0))
    assert made.heading is None
    shown(made)
    made.locate(estimate(velocity=np.array([0.2, 0.0, 0.0]), current=np.array([0.0, 0.1])))
    found = made.command(Station(0.4, 10.0, 0.1, (3.5, -2.0)))
    over_ground = np.array([0.2 + 0.1 * math.sin(0.4), 0.1 * math.cos(0.4)])
    wanted = 60.0 * 0.5 * np.array([math.cos(0.4), -math.sin(0.4)]) - 50.0 * over_ground
    assert found[:2] == pytest.approx(wanted)
    assert made.command(Setpoints(0.4, 10.0, 0.5)).surge == pytest.approx(SURGE_DRAG(0.5))
    assert made.command(Setpoints(0.4, 10.0, -0.5)).surge == pytest.approx(-SURGE_DRAG(0.5))
    made.locate(estimate(initialised=False))
    assert made.command(Station(0.4, 10.0, 0.1, (3.5, -2.0)))[:2] == (0.0, 0.0)  # it does not know where it is


def test_vertical_velocity_is_the_dvls():
    """Level by pitch: 0.3 m/s ahead with the nose 0.2 rad up climbs."""
    made = controller(integral=(0.0, 0.0, 0.0))
    shown(made, heading=0.0, pitch=0.2)
    made.observe([Reading("dvl", 0.0, 0.0, np.array([0.3, 0.0, 0.05, math.nan, math.nan, math.nan]))])
    made.locate(estimate(position=np.array([0.0, 0.0, 10.0]), heading=0.0))
    found = made.command(Station(0.0, 10.0, 0.1, (0.0, 0.0)))
    down = -0.3 * math.sin(0.2) + 0.05 * math.cos(0.2)
    assert found.heave == pytest.approx(-60.0 * down * math.cos(0.2))


def test_it_warns_of_a_place_it_cannot_hold():
    made = controller(position=(900.0, 900.0, 900.0))
    shown(made)
    made.locate(estimate())
    for _ in range(51):
        assert made.warning is None or made.command
        made.command(Station(0.4, 10.0, 0.1, (8.0, -2.0)))
    assert made.warning
    made.command(Setpoints(0.4, 10.0, 0.0))
    assert made.warning is None


def test_a_vehicle_with_fins_cannot_hover():
    torpedo = library.vehicle("remus100").actuation
    setup = ControllerSetup(settings=HoveringSettings(), actuation=torpedo, ahead=torpedo.at_speed, period=PERIOD)
    with pytest.raises(InputError, match="hovering needs thrusters in all directions, not rudder_upper"):
        registry.build("hovering", setup)


def test_estimates_move_on_by_dead_reckoning():
    """Two seconds later, with water and vehicle moving, against a plain sum; and the heading turns."""
    found = estimate(velocity=np.array([0.4, -0.1, 0.05]), current=np.array([0.2, -0.3]))
    here, over_ground, heading = found.at(2.0)
    psi = 0.4 + 0.05 * 2.0
    north = 0.4 * math.cos(psi) + 0.1 * math.sin(psi) + 0.2
    east = 0.4 * math.sin(psi) - 0.1 * math.cos(psi) - 0.3
    assert heading == pytest.approx(psi)
    assert here == pytest.approx((3.0 + 2.0 * north, -2.0 + 2.0 * east))
    assert over_ground == pytest.approx(
        (math.cos(psi) * north + math.sin(psi) * east, -math.sin(psi) * north + math.cos(psi) * east)
    )


def test_shares_say_what_is_too_much():
    push = np.array((60.0, -25.0, 10.0, 0.5, 0.0, 1.0))
    most = push / ACTUATION.shares(push).max()
    for factor, full in ((0.999, False), (1.001, True)):
        assert (max(map(abs, ACTUATION.allocate(factor * most))) > 1.0 - 1e-9) is full
