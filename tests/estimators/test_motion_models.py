"""Motions and sensors by composition: derivatives against differences, closed forms, noise against samples."""

import math
from dataclasses import replace

import numpy as np
import pytest
from models_runs import measured

from estimators.core import ekf, ukf
from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.models import sensors
from estimators.core.models.motion import (
    constant_velocity,
    dead_reckoning,
    unicycle,
    with_current,
    with_depth,
    with_error,
    with_input_error,
)
from estimators.core.models.process import MotionProcess
from estimators.core.states import StateSpace
from estimators.core.types import Gaussian

BODY = with_error(
    with_error(with_error(with_depth(with_current(constant_velocity(True))), "b", "m"), "s", "1"), "t", "s"
)
MOTIONS = {
    "unicycle": (with_input_error(with_input_error(unicycle(), "speed", "scale"), "turn_rate", "bias"), (1.2, 0.3)),
    "dead_reckoning": (with_current(dead_reckoning()), (1.1, -0.2, 0.1)),
    "given_heading": (dead_reckoning("given"), (1.1, -0.2, 0.7)),
    "constant_velocity": (constant_velocity(), ()),
    "body": (with_error(BODY, "slow", "m", time_constant=40.0), ()),
}
SENSORS = {
    "fix": (sensors.fix(BODY, point=(0.7, -0.2), lag="t", bias=("b", None)), ()),
    "range": (sensors.range_to(BODY, (30.0, -5.0, 4.0), depth="depth", point=(0.7, 0.1), bias="b", scale="s"), ()),
    "moving_range": (sensors.range_to(BODY, depth=2.0, lag="t"), (30.0, -5.0, 4.0)),
    "bearing": (sensors.bearing_to(BODY, (30.0, -5.0, 4.0), bias="b"), ()),
    "bearing_from_north": (sensors.bearing_to(BODY, relative=False), (3.0, -5.0, 4.0)),
    "range_bearing": (sensors.range_and_bearing(BODY), (-8.0, 20.0, 0.0)),
    "bottom": (sensors.dvl(BODY, scale="s"), ()),
    "water": (sensors.dvl(BODY, track="water"), ()),
    "ground": (sensors.dvl(with_error(constant_velocity(), "heading", "rad")), ()),
    "depth": (sensors.depth(BODY, bias="b"), ()),
    "altitude": (sensors.altitude(BODY, 50.0), ()),
    "compass": (sensors.compass(BODY, bias="b"), ()),
    "gyro": (sensors.gyro(BODY, scale="s"), ()),
    "log": (sensors.speed_log(BODY, scale="s", bias="b"), ()),
}


def differences(function, x, h=1e-5):
    return np.array([(function(x + h * e) - function(x - h * e)) / (2 * h) for e in np.eye(x.size)]).T


def some_state(n, seed=0):
    return np.random.default_rng(seed).uniform(-0.8, 0.8, n) + np.array([5.0, -3.0, *[0.0] * (n - 2)])


@pytest.mark.parametrize("name", MOTIONS)
def test_jacobians_of_motions_equal_differences(name):
    motion, u = MOTIONS[name]
    process = MotionProcess(motion, {"north": 0.1})
    x = some_state(len(motion.space))
    F = differences(lambda y: process.move(y[None], u, 0.8)[0], x)
    assert process.jacobian(x, u, 0.8) == pytest.approx(F, rel=1e-7, abs=1e-8)  # truncation h^2 and rounding 1e-16/h
    assert process.jacobian(x, u, 0.8) != pytest.approx(np.eye(x.size), abs=0.1) or name == "given_heading"


@pytest.mark.parametrize("name", SENSORS)
def test_jacobians_of_sensors_equal_differences(name):
    sensor, parameters = SENSORS[name]
    x = some_state(len(sensor.space), 3)
    seen = measured(name, np.zeros(sensor.size), 1.0, 0.0, parameters=parameters)
    H = differences(lambda y: sensor.residual(sensor.evaluate(y, seen), sensor.evaluate(x, seen)), x)
    assert sensor.jacobian(x, seen) == pytest.approx(H, abs=1e-8)
    other = some_state(len(sensor.space), 4)
    assert sensor.is_linear == bool((sensor.jacobian(x, seen) == sensor.jacobian(other, seen)).all())
    assert sensor.is_angle == (name == "compass")


def test_closed_forms_of_the_sensors():
    space = BODY.space
    x = space.vector(
        {"north": 3.0, "east": 1.0, "heading": math.pi / 2, "surge": 1.5, "sway": -0.2, "yaw_rate": 0.1, "depth": 7.0,
         "current_north": 0.3, "current_east": 0.4, "b": 0.5, "s": 0.1, "t": 2.0}
    )  # fmt: skip

    def value(name, parameters=None):
        sensor, given = SENSORS[name]
        return sensor.evaluate(x, measured(name, np.zeros(sensor.size), 1.0, 0.0, parameters=parameters or given))

    # Pointing east: starboard is south. The hull's point lies 0.7 m east and 0.2 m north of the origin.
    ground = np.array([0.3 + 0.2, 1.5 + 0.4])
    arm = np.array([0.2, 0.7])  # the heading turns on by 0.2 rad in the lag
    turned = np.array(
        [math.cos(0.2) * arm[0] - math.sin(0.2) * arm[1], math.sin(0.2) * arm[0] + math.cos(0.2) * arm[1]]
    )
    assert value("fix") == pytest.approx(np.array([3.0, 1.0]) + 2.0 * ground + turned + [0.5, 0.0])
    slant = math.sqrt((30.0 - 2.9) ** 2 + (-5.0 - 1.7) ** 2 + (4.0 - 7.0) ** 2)
    assert value("range") == pytest.approx([1.1 * slant + 0.5])
    assert value("bearing") == pytest.approx([math.atan2(-6.0, 27.0) - math.pi / 2 + 0.5])
    assert value("bearing_from_north") == pytest.approx([-math.pi / 2])
    assert value("range_bearing", (3.0, 5.0, 0.0)) == pytest.approx([4.0, 0.0])
    assert value("bottom") == pytest.approx([1.1 * 1.9, 1.1 * -0.5])
    assert value("water") == pytest.approx([1.5, -0.2])
    assert value("depth") == pytest.approx([7.5])
    assert value("altitude") == pytest.approx([43.0])
    assert value("gyro") == pytest.approx([0.11])
    assert value("log") == pytest.approx([1.1 * 1.5 + 0.5])


def test_closed_forms_of_the_motions():
    motion, _ = MOTIONS["unicycle"]
    x = motion.space.vector({"heading": 3.1, "speed_scale": 0.25, "turn_rate_bias": 0.02})
    moved = MotionProcess(motion, {}).evaluate(x, (1.25, 0.12), 1.0)
    # A turn of 0.1 rad/s at 1 m/s; the midpoint rule errs by (0.1)^2 / 24 of the chord.
    assert moved[:2] == pytest.approx([math.cos(3.15), math.sin(3.15)], abs=1e-3)
    assert moved[2] == pytest.approx(3.2 - 2 * math.pi)  # wrapped, as the heading is declared an angle
    motion, _ = MOTIONS["dead_reckoning"]
    x = motion.space.vector({"heading": math.pi / 2, "current_north": 0.3})
    moved = MotionProcess(motion, {}).evaluate(x, (1.0, 0.2, 0.0), 2.0)
    assert moved[:2] == pytest.approx([2.0 * (0.3 - 0.2), 2.0])
    motion, _ = MOTIONS["body"]
    moved = MotionProcess(motion, {}).evaluate(motion.space.vector({"slow": 1.0}), (), 8.0)
    assert moved[motion.space.index("slow")] == pytest.approx(math.exp(-0.2), rel=1e-4)


def test_noise_of_inputs_acts_along_them():
    """Against samples: a unicycle whose speed errs spreads along its heading, not across."""
    motion = unicycle()
    process = MotionProcess(motion, {}, input_noise={"speed": 0.04, "turn_rate": 0.0009}, max_substep=0.1)
    mean, u, duration = np.array([0.0, 0.0, 0.7]), (1.0, 0.1), 2.0
    _, P, _ = process.propagate(mean, np.zeros((3, 3)), u, duration)
    rng, count, h = np.random.default_rng(1), 4000, 0.1
    points = np.tile(mean, (count, 1))
    for _ in range(round(duration / h)):
        speed = u[0] + math.sqrt(0.04 / h) * rng.standard_normal(count)
        turn = u[1] + math.sqrt(0.0009 / h) * rng.standard_normal(count)
        middle = points[:, 2] + 0.5 * h * turn
        points += h * np.column_stack((speed * np.cos(middle), speed * np.sin(middle), turn))
    sampled = np.cov(points.T)
    # 4000 samples: 2.2 % a deviation of a variance.
    assert np.diagonal(P) == pytest.approx(np.diagonal(sampled), rel=0.08)
    assert P[0, 1] == pytest.approx(sampled[0, 1], rel=0.1)


def test_noise_hardly_depends_on_the_substeps():
    motion, u = MOTIONS["unicycle"]
    x, densities = some_state(len(motion.space)), {"north": 1e-3, "heading": 1e-4, "turn_rate_bias": 1e-5}
    one, many = (
        MotionProcess(motion, densities, input_noise={"speed": 0.01}, max_substep=h).covariance(x, u, 0.4)
        for h in (0.4, 0.01)
    )
    assert one == pytest.approx(many, abs=0.05 * float(np.diagonal(many).max()))


def test_a_cloud_moves_as_its_points_do_also_over_the_turn():
    motion, u = MOTIONS["unicycle"]
    process = MotionProcess(motion, {"heading": 1e-4})
    belief = Gaussian(mean=motion.space.vector({"heading": 3.13}), covariance=1e-4 * np.eye(5))
    by_points, by_derivative = ukf.predict(belief, process, u, 0.5), ekf.predict(belief, process, u, 0.5)
    assert by_points.mean == pytest.approx(by_derivative.mean, abs=1e-3)  # second order of 0.01 rad
    assert by_points.covariance == pytest.approx(by_derivative.covariance, abs=1e-5)


def test_what_does_not_exist_is_named():
    with pytest.raises(ParameterError, match="no state 'depth'; there are north"):
        sensors.depth(unicycle())
    with pytest.raises(ParameterError, match="no state 'bias_z'"):
        sensors.range_to(unicycle(), (0.0, 0.0, 0.0), bias="bias_z")
    with pytest.raises(ParameterError, match="no input 'thrust'; there are speed, turn_rate"):
        with_input_error(unicycle(), "thrust", "bias")
    with pytest.raises(ParameterError, match="velocity among the states"):
        sensors.fix(with_error(unicycle(), "t", "s"), lag="t")
    with pytest.raises(ParameterError, match="no DVL water track"):
        sensors.dvl(constant_velocity(), track="water")
    with pytest.raises(ParameterError, match="is there already"):
        with_current(with_current(unicycle()))
    with pytest.raises(ParameterError, match="0 parameters; its model has 1 and 3"):
        sensors.range_to(unicycle()).evaluate(np.zeros(3), measured("range", [1.0], 1.0, 0.0))
    with pytest.raises(NotFiniteError, match="nothing finite"):
        sensors.range_to(unicycle(), (0.0, 0.0, 0.0)).jacobian(np.zeros(3), measured("range", [1.0], 1.0, 0.0))
    with pytest.raises(ParameterError, match="must be speed, turn_rate"):
        MotionProcess(unicycle(), {}).evaluate(np.zeros(3), (1.0,), 1.0)
    with pytest.raises(ParameterError, match="must be >= 0"):
        MotionProcess(unicycle(), {"north": -1.0})


def test_a_state_space_gives_places_by_name():
    space = StateSpace({"north": "m", "heading": "rad"}, ("heading",))
    assert space.angles == (1,)
    belief = space.belief({"heading": 0.3}, {"north": 2.0})
    assert belief.mean.tolist() == [0.0, 0.3]
    assert np.diagonal(belief.covariance).tolist() == [4.0, 0.0]
    assert replace(space.extended("depth", "m")).names == ("north", "heading", "depth")
