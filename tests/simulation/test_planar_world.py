"""The planar truth: the motion of the filters' own model, carried by an imposed current, with the noise asked for."""

import math

import numpy as np
import pytest
from scipy.stats import chi2
from surroundings import WATER

from auvsim.acoustics.usbl import Usbl, UsblSettings
from auvsim.base.frames import rotation
from auvsim.physics import planar_fit, scenes
from auvsim.physics.truth import StructurePose
from auvsim.physics.world import World
from auvsim.sensors.compass import Compass, CompassSettings
from auvsim.sensors.depth import Depth, DepthSettings
from auvsim.sensors.feedback import Feedback, FeedbackSettings
from auvsim.simulation.planar_world import PlanarWorld, planar_state, process_noise_increments
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands
from auvsim.water.currents import Turning, Uniform
from auvsim.water.settings import TurningSettings
from estimators.planar.model import PRESTERO, step_function

RATE = 10.0
STILL = Uniform((0.0, 0.0, 0.0))
ACTUATION = library.vehicle("remus100").actuation
RUDDERS = np.radians([0.0, 4.0, -6.0, 2.0, 12.0, 0.0])  # each for 10 s


def world(current=STILL, densities=(0.0,) * 8, seed=0, parameters=PRESTERO):
    made = PlanarWorld("auv", parameters, ACTUATION, current, RATE, np.array(densities), np.random.default_rng(seed))
    made.place("auv", np.array((3.0, -7.0, 20.0)), 1.0, 0.8, np.zeros(5))
    return made


def sail(made, ticks=10):
    """Planar states (k, 8), as often as the world is advanced, over RUDDERS."""
    states = [planar_state(made.truth("auv"))]
    for rudder in np.repeat(RUDDERS, round(10.0 * RATE / ticks)):
        made.command("auv", ACTUATION.allocate(Commands(rudder, 0.0, 0.0)))
        made.advance(ticks)
        states.append(planar_state(made.truth("auv")))
    return np.array(states)


def test_motion_is_that_of_the_planar_model():
    """Against the model's own CasADi function, which knows neither kernels nor worlds."""
    step, p = step_function(current=True), PRESTERO.vector()
    x, expected = np.array((3.0, -7.0, 1.0, 0.8, 0.0, 0.0, 0.3, -0.2)), []
    for rudder in np.repeat(RUDDERS, 100):
        expected.append(x)
        x = np.array(step(x, (rudder, 0.0), p, 0.1)[0]).ravel()
    found = sail(world(Uniform((0.3, -0.2, 0.0))), ticks=1)[:-1]
    turned = np.angle(np.exp(1j * (found[:, 2] - np.array(expected)[:, 2])))
    # The same formulas in another order: rounding of 1e-16 in 600 steps of numbers up to 50.
    assert np.abs(turned).max() < 1e-11
    assert np.delete(found, 2, axis=1) == pytest.approx(np.delete(np.array(expected), 2, axis=1), abs=1e-10)


def test_how_the_steps_are_cut_up_does_not_matter():
    densities, turning = np.full(8, 1e-5), Turning(TurningSettings(start=20.0, end=30.0))
    fine, coarse = (sail(world(turning, densities), ticks) for ticks in (1, 10))
    assert np.array_equal(fine[::10], coarse)


def test_a_steady_current_changes_only_the_ground_track():
    still, carried = sail(world()), sail(world(Uniform((0.3, -0.4, 0.0))))
    times = np.arange(len(still))[:, None]  # advanced by a second each
    # Positions up to 50 m, 600 sums: rounding of 1e-14 each.
    assert carried[:, :2] - still[:, :2] == pytest.approx(times * (0.3, -0.4), abs=1e-11)
    assert carried[:, 2:6] == pytest.approx(still[:, 2:6], abs=1e-13)  # u and v come back out of the ground's velocity


def test_a_turning_current_carries_the_vehicle_along():
    turning = Turning(TurningSettings(speed=0.5, direction_deg=30.0, start=20.0, end=30.0))
    still, carried = sail(world()), sail(world(turning))
    times = np.linspace(0.0, 60.0, 6_001)
    water = np.array([turning.evaluate(t, np.zeros(3)).velocity[:2] for t in times])
    way = np.vstack((np.zeros(2), np.cumsum(0.5 * (water[1:] + water[:-1]), axis=0) * 0.01))[::100]
    # The current is held for a step of 0.1 s: late by half of it, 0.05 s of a change of 0.71 m/s.
    assert np.abs(carried[:, :2] - still[:, :2] - way).max() < 0.036
    assert carried[:, 6:8] == pytest.approx(water[::100], abs=1e-12)
    assert carried[:, 3:6] == pytest.approx(still[:, 3:6], abs=1e-12)


@pytest.mark.parametrize("state", range(8))
def test_noise_has_the_variance_asked_for(state):
    """Of a vehicle at rest without thrust, where 2 s of a small noise of one state stay what they are."""
    density, seeds, duration = 1e-5, 300, 2.0
    densities = np.where(np.arange(8) == state, density, 0.0)
    parameters = planar_fit.fit_planar_model("remus100", 1.0).parameters
    squares = 0.0
    for seed in range(seeds):
        made = world(densities=densities, seed=seed, parameters=parameters)
        made.place("auv", np.array((0.0, 0.0, 20.0)), 0.0, 0.0, np.zeros(5))
        made.advance(round(duration * RATE))
        squares += planar_state(made.truth("auv"))[state] ** 2 / (density * duration)
    assert chi2.ppf(0.0005, seeds) < squares < chi2.ppf(0.9995, seeds)


def test_kicks_are_noise_and_changes_of_the_current():
    current = np.array([[0.1, 0.2], [0.3, 0.2], [0.3, -0.2]])
    densities = np.array([4e-4, 0.0, 1e-6, 0.0, 0.0, 0.0, 1e-5, 0.0])
    drawn = np.random.default_rng(4).standard_normal((2, 8)) * np.sqrt(densities * 0.1)
    drawn[:, 6:] += [[0.2, 0.0], [0.0, -0.4]]
    assert process_noise_increments(np.random.default_rng(4), densities, 0.1, current) == pytest.approx(
        drawn, abs=1e-16
    )


def test_truth_is_of_one_piece():
    made = world(Uniform((0.3, -0.2, 0.0)), densities=np.full(8, 1e-6))
    made.command("auv", ACTUATION.allocate(Commands(0.1, 0.05, 60.0)))
    before = made.truth("auv")
    made.advance(300)
    truth = made.truth("auv")
    assert (before.time, truth.time, made.time) == (0.0, 30.0, 30.0)
    roll, pitch, yaw = truth.attitude
    assert (roll, pitch, truth.position[2]) == (0.0, 0.0, 20.0)
    assert -math.pi < yaw <= math.pi
    w, x, y, z = truth.quaternion
    assert (x, y, math.atan2(2 * w * z, 1 - 2 * z * z)) == pytest.approx((0.0, 0.0, yaw))
    # Velocity over ground is that through the water and that of the water.
    state = planar_state(truth)
    ground = rotation(*truth.attitude) @ truth.nu[:3]
    through = rotation(0.0, 0.0, yaw) @ (*state[3:5], 0.0)
    assert ground == pytest.approx(through + truth.current, abs=1e-12)
    assert ACTUATION.effective(truth.actuators) == pytest.approx((0.1, 0.05, 60.0))
    made.place("auv", np.zeros(3), 0.5, 1.0, (0.0, 0.0, 0.0, 0.0, 40.0))
    assert made.time == 0.0
    assert planar_state(made.truth("auv")) == pytest.approx((0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.3, -0.2), abs=1e-15)


def test_fins_do_not_pass_their_limit():
    made, limited = world(), world()
    made.command("auv", ACTUATION.allocate(Commands(5.0, 0.0, 0.0)))
    limited.command("auv", ACTUATION.allocate(Commands(ACTUATION.fin_limit, 0.0, 0.0)))
    for each in (made, limited):
        each.advance(50)
    assert planar_state(made.truth("auv")) == pytest.approx(planar_state(limited.truth("auv")), abs=1e-12)
    assert np.abs(made.truth("auv").actuators[:-1]).max() == pytest.approx(ACTUATION.fin_limit)


def test_the_trials_sensors_measure_it():
    """Without noise they give the state back, the USBL that between two truths."""
    made = world(Uniform((0.3, -0.2, 0.0)))
    made.command("auv", ACTUATION.allocate(Commands(0.1, 0.0, 50.0)))
    quiet = {"dock_heading_bias_deg": 0.0, "dock_tilt_bias_deg": 0.0, "dock_depth_noise": 0.0, "dock_depth_bias": 0.0}
    settings = UsblSettings(noise_scale=0.0, outlier_probability=0.0, transponder=(0.0, 0.0, 0.0), **quiet)
    usbl = Usbl(settings, np.random.default_rng(1), StructurePose(depth=20.0, heading=0.0))
    compass = Compass(CompassSettings(heading_noise_deg=0.0, heading_bias_deg=0.0), np.random.default_rng(2))
    depth = Depth(DepthSettings(noise=0.0, bias=0.0), np.random.default_rng(3))
    feedback = Feedback(FeedbackSettings(), np.random.default_rng(4))
    pings, times, states, truth = [], [], [], made.truth("auv")
    for _ in range(300):
        times.append(truth.time)
        states.append(planar_state(truth))
        made.advance(1)
        before, truth = truth, made.truth("auv")
        pings += usbl.poll(before, truth)
        assert compass.measure(truth, WATER).value[0] == pytest.approx(truth.attitude[2], abs=1e-12)
        assert depth.measure(truth, WATER).value[0] == 20.0
        assert ACTUATION.effective(feedback.measure(truth, WATER).value).rudder == pytest.approx(0.1)
    assert len(pings) >= 5
    for ping in pings:
        measured = ping.reading.value[:2] + np.array(settings.transceiver[:2])
        way = [np.interp(ping.reading.stamp, times, column) for column in np.array(states)[:, :2].T]
        # Between truths the way bends by at most r U dt^2 / 8 = 0.1 x 1 x 0.01 / 8 from the chord.
        assert measured == pytest.approx(way, abs=2e-4)


def test_it_moves_as_the_vehicle_of_which_its_model_is_condensed():
    """The same calls to both worlds: turns in a current; the tolerance is that of an open-loop minute of a condensed
    model, 2 % of the way and 2 degrees (see test_condense)."""
    fitted, current = planar_fit.fit_planar_model("remus100", 1.0), Uniform((0.3, -0.2, 0.0))
    physical = World(scenes.scene({"auv": "remus100"}, {}, scenes.WorldSettings(), 100.0), current)
    planar = PlanarWorld("auv", fitted.parameters, ACTUATION, current, RATE, np.zeros(8), np.random.default_rng(0))
    ends = []
    for each, rate in ((physical, 100.0), (planar, RATE)):
        start = ACTUATION.allocate(ACTUATION.at_speed(fitted.shaft_speed))
        each.place("auv", np.array((200.0, 0.0, 20.0)), 0.5, 1.0, start)
        for rudder in (0.1, -0.15, 0.05, 0.0):
            each.command("auv", ACTUATION.allocate(Commands(rudder, 0.0, fitted.shaft_speed)))
            each.advance(round(15.0 * rate))
        ends.append(planar_state(each.truth("auv")))
        assert each.time == pytest.approx(60.0)
    difference = ends[0] - ends[1]
    assert math.hypot(*difference[:2]) < 0.02 * 60.0
    assert abs(difference[2]) < math.radians(2.0)
    assert difference[6:] == pytest.approx((0.0, 0.0), abs=1e-12)
