"""The autopilot: signs and limits by hand-made readings, and the loop closed on the REMUS 100 in MuJoCo."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from auvsim.base.frames import Array, rotation, wrap
from auvsim.base.randomness import stream
from auvsim.base.reading import Reading
from auvsim.control.controller import ControllerSetup, Setpoints
from auvsim.control.torpedo import Autopilot, AutopilotSettings
from auvsim.physics import planar_fit, scenes
from auvsim.physics.scenes import WorldSettings
from auvsim.physics.world import World
from auvsim.sensors.compass import Compass, CompassSettings
from auvsim.sensors.depth import Depth, DepthSettings
from auvsim.vehicles import library
from auvsim.vehicles.actuation import FinsAndShaft
from auvsim.water.currents import Uniform

PERIOD = 0.1  # of control [s]
FIN_LIMIT, SHAFT_LIMIT = 0.26, 160.0  # [rad], [rad/s]
QUIET = (CompassSettings(heading_noise_deg=0, heading_bias_deg=0, tilt_noise_deg=0), DepthSettings(noise=0, bias=0))


def setup(settings: AutopilotSettings) -> ControllerSetup:
    """Two pairs of fins and a shaft."""
    limits = np.array([[-FIN_LIMIT, FIN_LIMIT]] * 4 + [[-SHAFT_LIMIT, SHAFT_LIMIT]])
    matrix = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    actuation = FinsAndShaft(fins=("a", "b", "c", "d"), matrix=matrix, limits=limits, lags=np.zeros(5))
    return ControllerSetup(
        settings=settings, actuation=actuation, ahead=lambda speed: actuation.at_speed(80.0 * speed), period=PERIOD
    )


def autopilot(heading=0.0, depth=10.0, pitch=0.0, yaw_rate=0.0, settings=None) -> Autopilot:
    """An autopilot that has seen ten seconds of steady readings up to time 0."""
    pilot = Autopilot(setup(settings or AutopilotSettings()))
    for time in np.arange(-10.0, PERIOD / 2, PERIOD).tolist():
        compass = np.array([wrap(heading + yaw_rate * time), pitch, 0.0])
        pilot.observe([Reading("compass", time, time, compass), Reading("depth", time, time, np.array([depth]))])
    return pilot


@pytest.mark.parametrize(
    ("measured", "wanted", "sign"),
    [(0.0, 0.05, 1), (0.0, -0.05, -1), (3.13, -3.13, 1), (-3.13, 3.13, -1), (3.0, 3.0 + 2 * math.pi, 0)],
)
def test_rudder_turns_the_short_way(measured: float, wanted: float, sign: int) -> None:
    """A wanted heading to starboard gives positive rudder, in proportion, also across 180 degrees."""
    rudder = autopilot(heading=measured).command(Setpoints(wanted, 10.0, 1.0)).rudder
    assert rudder == pytest.approx(AutopilotSettings().heading_gain * wrap(wanted - measured), abs=1e-9)
    assert sign == 0 or rudder * sign > 0.0


def test_rudder_damps_the_turn() -> None:
    """On the wanted heading but still turning to starboard: rudder to port."""
    rate = 0.02
    pilot = autopilot(heading=3.14, yaw_rate=rate)  # passing 180 degrees within the ten seconds
    assert pilot.command(Setpoints(3.14, 10.0, 1.0)).rudder == pytest.approx(
        -AutopilotSettings().yaw_rate_gain * rate, rel=0.02
    )


@pytest.mark.parametrize(("depth", "sign"), [(10.5, 1), (9.5, -1)])
def test_stern_plane_dives_when_too_shallow(depth: float, sign: int) -> None:
    """Too shallow: positive stern plane (dives); the commanded pitch is nose down, in proportion."""
    elevator = autopilot(depth=10.0).command(Setpoints(0.0, depth, 1.0)).elevator
    s = AutopilotSettings()
    assert elevator == pytest.approx(s.pitch_gain * s.depth_gain * (depth - 10.0))
    assert elevator * sign > 0.0


def test_stern_plane_stops_at_the_wanted_pitch() -> None:
    """The pitch that the depth error asks for is held with the planes amidships; more pitch than that is taken off."""
    wanted = -AutopilotSettings().depth_gain * 1.0
    assert autopilot(pitch=wanted).command(Setpoints(0.0, 11.0, 1.0)).elevator == pytest.approx(0.0, abs=1e-9)
    assert autopilot(pitch=wanted - 0.05).command(Setpoints(0.0, 11.0, 1.0)).elevator < 0.0


def test_pitch_command_is_limited() -> None:
    """However far the depth: at the limit of pitch the planes are amidships."""
    limit = math.radians(AutopilotSettings().pitch_limit_deg)
    assert autopilot(pitch=-limit).command(Setpoints(0.0, 500.0, 1.0)).elevator == pytest.approx(0.0, abs=1e-9)
    assert autopilot(pitch=limit).command(Setpoints(0.0, -500.0, 1.0)).elevator == pytest.approx(0.0, abs=1e-9)


def test_actuators_are_limited() -> None:
    """Rudder, stern plane and shaft at their limits, of either sign."""
    assert autopilot(pitch=0.5).command(Setpoints(2.0, 50.0, 9.0)) == (FIN_LIMIT, FIN_LIMIT, SHAFT_LIMIT)
    assert autopilot(pitch=-0.5).command(Setpoints(-2.0, 0.0, -9.0)) == (FIN_LIMIT, FIN_LIMIT, -SHAFT_LIMIT)


def test_astern_the_fins_act_the_other_way() -> None:
    """Flow from astern turns the sign of every fin, once the way ahead is off; the shaft turns back as fast."""
    pilot = autopilot(settings=AutopilotSettings(depth_integral_gain=0.0))
    ahead = pilot.command(Setpoints(0.01, 10.1, 1.0))
    still_ahead = pilot.command(Setpoints(0.01, 10.1, -1.0))
    assert still_ahead.rudder == pytest.approx(ahead.rudder)
    for _ in range(100):
        astern = pilot.command(Setpoints(0.01, 10.1, -1.0))
    assert astern.rudder == pytest.approx(-AutopilotSettings().astern_factor * ahead.rudder)
    assert astern.elevator == pytest.approx(-ahead.elevator)
    assert astern.shaft_speed == -ahead.shaft_speed
    assert autopilot().command(Setpoints(0.0, 10.0, 0.0)).shaft_speed == 0.0


def test_waits_for_its_first_readings() -> None:
    """Fins amidships until both compass and gauge have spoken; other sensors are none of its business."""
    pilot = Autopilot(setup(AutopilotSettings()))
    pilot.observe([Reading("feedback", 0.0, 0.0, np.ones(5)), Reading("compass", 0.0, 0.0, np.zeros(3))])
    assert pilot.command(Setpoints(1.0, 20.0, 1.0)) == (0.0, 0.0, 80.0)
    assert pilot.depth is None
    pilot.observe([Reading("depth", 0.0, 0.0, np.array([3.0]))])
    assert (pilot.heading, pilot.depth) == (0.0, 3.0)
    assert pilot.command(Setpoints(1.0, 20.0, 1.0)).rudder > 0.0


def test_integral_waits_while_far_off() -> None:
    """A long dive winds nothing up; a small standing error is integrated."""
    far, near, fresh = autopilot(), autopilot(), autopilot()
    for _ in range(600):
        far.command(Setpoints(0.0, 30.0, 1.0))
        near.command(Setpoints(0.0, 10.2, 1.0))
    s = AutopilotSettings()
    assert far.command(Setpoints(0.0, 10.0, 1.0)) == fresh.command(Setpoints(0.0, 10.0, 1.0))
    assert near.command(Setpoints(0.0, 10.0, 1.0)).elevator == pytest.approx(
        s.pitch_gain * s.depth_integral_gain * 0.2 * 60.0
    )


@dataclass
class Sailed:
    """What the vehicle did, at every control period."""

    time: Array  # (n,) [s]
    position: Array  # (n, 3) NED [m]
    heading: Array  # (n,) unwrapped [rad]
    through_water: Array  # (n, 3) velocity relative to the water, body [m/s]
    rudder: Array  # (n,) commanded [rad]


def sail(
    duration, heading=0.0, depth=20.0, speed=1.0, current=(0.0, 0.0, 0.0), sensors=QUIET, astern_after=math.inf, seed=5
) -> Sailed:
    """The REMUS 100 under the autopilot, 20 m deep, heading north."""
    vehicle = library.vehicle("remus100")
    world = World(scenes.scene({"auv": "remus100"}, {}, WorldSettings(sea_floor=80.0), 100.0), Uniform(current))
    fitted = planar_fit.fit_planar_model("remus100", 1.0)
    made = ControllerSetup(
        settings=AutopilotSettings(),
        actuation=vehicle.actuation,
        ahead=lambda speed: vehicle.actuation.at_speed(fitted.shaft_speed_for(speed)),
        period=PERIOD,
    )
    pilot = Autopilot(made)
    compass, gauge = Compass(sensors[0], stream(seed, 0, "compass")), Depth(sensors[1], stream(seed, 0, "depth"))
    channels = vehicle.actuation.allocate(vehicle.actuation.at_speed(fitted.shaft_speed_for(speed)))
    world.place("auv", np.array([0.0, -300.0, 20.0]), 0.0, speed, channels)
    rows = []
    for _ in range(round(duration / PERIOD)):
        world.advance(10)
        truth = world.truth("auv")
        pilot.observe([compass.measure(truth, world), gauge.measure(truth, world)])
        commands = pilot.command(Setpoints(heading, depth, -0.8 if truth.time > astern_after else speed))
        world.command("auv", vehicle.actuation.allocate(commands))
        water = truth.nu[:3] - rotation(*truth.attitude).T @ truth.current
        rows.append((truth.time, *truth.position, truth.attitude[2], *water, commands.rudder))
    columns = np.array(rows).T
    return Sailed(columns[0], columns[1:4].T, np.unwrap(columns[4]), columns[5:8].T, columns[8])


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("speed", [1.0, 1.5])
def test_heading_step(sign: int, speed: float) -> None:
    """60 degrees: turned within what the turning circle takes and some seconds, little overshoot, and then held."""
    step = sign * math.radians(60.0)
    sailed = sail(60.0, heading=step, speed=speed)
    error = np.degrees(step - sailed.heading) * sign
    # At full rudder 16 m radius: 60 degrees take 16.8 m; 8 s more to get into the turn and out of it.
    settled = sailed.time > 16.8 / speed + 8.0
    assert np.abs(error[settled]).max() < 3.0
    assert -error.min() < 6.0  # overshoot of a tenth
    assert np.abs(error[-200:]).max() < 0.3


@pytest.mark.parametrize("depth", [10.0, 30.0])
def test_depth_step(depth: float) -> None:
    """10 m up or down at 1 m/s, on a straight course, and then held to less than 0.1 m."""
    sailed = sail(150.0, depth=depth)
    down = (sailed.position[:, 2] - depth) * math.copysign(1.0, depth - 20.0)
    assert down.max() < 1.0  # overshoot of a tenth
    # At the pitch limit of 20 degrees 10 m take 29 s at 1 m/s; then the error falls by e every 1 / gain, 8 s, twice as
    # slowly for the righting moment against the planes, down from 3 m: 40 s.
    assert np.sqrt(np.mean(down[sailed.time > 90.0] ** 2)) < 0.1
    assert np.degrees(np.abs(sailed.heading)).max() < 2.0


@pytest.mark.parametrize("across", [-0.5, 0.5])
def test_holds_heading_and_depth_in_a_cross_current(across: float) -> None:
    """With the sensors' noises: the current carries the vehicle sideways and changes nothing else."""
    sensors = (CompassSettings(heading_bias_deg=0.0), DepthSettings(bias=0.0))
    still = sail(80.0, sensors=sensors)
    carried = sail(80.0, current=(0.0, across, 0.0), sensors=sensors)
    held = carried.time > 20.0
    assert np.degrees(np.sqrt(np.mean(carried.heading[held] ** 2))) < 0.5  # white compass noise is 1 degree
    assert np.sqrt(np.mean((carried.position[held, 2] - 20.0) ** 2)) < 0.1
    drifted = carried.position - still.position
    # Galilean invariance, up to rounding that the loop carries on.
    np.testing.assert_allclose(drifted, carried.time[:, None] * [0.0, across, 0.0], atol=1e-6)


@pytest.mark.parametrize("speed", [0.8, 1.0, 1.5])
@pytest.mark.parametrize("along", [-0.3, 0.0, 0.3])
def test_water_speed_is_the_commanded_one(speed: float, along: float) -> None:
    """Open loop from the condensed model, ahead or with the current: 3 % of what was asked for."""
    sailed = sail(60.0, speed=speed, current=(along, 0.0, 0.0))
    assert sailed.through_water[-1, 0] == pytest.approx(speed, rel=0.03)
    over_ground = (sailed.position[-1, 0] - sailed.position[-101, 0]) / 10.0
    assert over_ground == pytest.approx(sailed.through_water[-100:, 0].mean() + along, abs=1e-3)  # level and straight


def test_backs_out() -> None:
    """20 s astern from 1 m/s ahead: stopped after a quarter, then back by some metres, still heading for the dock.

    A hull with its fins ahead turns round by itself, within 2 s by a factor of e; with 15 degrees of rudder and the
    compass's noise no gain holds it for ever. With the fins amidships or with signs by the command it is 45 to 60
    degrees off by then.
    """
    ends = []
    for seed in range(5):
        sensors = (CompassSettings(heading_bias_deg=0.0), DepthSettings(bias=0.0))
        sailed = sail(40.0, sensors=sensors, astern_after=20.0, seed=seed)
        ends.append(sailed.heading[-1])
        assert sailed.through_water[-1, 0] == pytest.approx(-0.8, rel=0.1)
        assert np.abs(sailed.position[:, 2] - 20.0).max() < 0.5
        assert sailed.position[-1, 0] < sailed.position[200, 0] - 5.0
    assert np.degrees(np.sqrt(np.mean(np.square(ends)))) < 30.0


def test_noise_moves_the_rudder_little() -> None:
    """With the compass's 1 degree of white noise on a straight course the rudder works within a third of its limit."""
    rudder = sail(60.0, sensors=(CompassSettings(), DepthSettings())).rudder[100:]
    assert 0.0 < np.sqrt(np.mean(rudder**2)) < library.vehicle("remus100").actuation.fin_limit / 3.0
