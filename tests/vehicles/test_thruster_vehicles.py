"""Vehicles that thrusters drive: how a wrench is shared, the BlueROV2 in MuJoCo, holding station, what is refused."""

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.base.frames import FLIP6
from auvsim.cli import main
from auvsim.control.hovering import Hovering, HoveringSettings
from auvsim.physics import planar_fit, scenes, soundness
from auvsim.physics.scenes import WorldSettings
from auvsim.physics.world import World
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Thrusters
from auvsim.water.currents import Uniform

ROV = "bluerov2_heavy"
ACTUATION = library.vehicle(ROV).actuation
# Thrusters as the paper has them: place from the centre of gravity, 0.01 m below the origin, and direction.
HORIZONTAL = [((1, 1), (1, -1)), ((1, -1), (1, 1)), ((-1, 1), (-1, -1)), ((-1, -1), (-1, 1))]
VERTICAL = [(1, 1), (1, -1), (-1, 1), (-1, -1)]


def world(current=(0.0, 0.0, 0.0)):
    return World(scenes.scene({"rov": ROV}, {}, WorldSettings(), 100.0), Uniform(current))


def wrench_of(commands):
    """Force and moment (6,) of thrusters at their commands, as MuJoCo has them on a vehicle at rest."""
    found = world()
    forces = []
    for channels in (commands, [0.0] * 8):
        found.place("rov", np.array([0.0, 0.0, 15.0]), 0.0, 0.0, channels)
        mujoco.mj_forward(found.model, found.data)
        forces.append((found.data.qfrc_passive - found.data.qfrc_bias)[:6] * FLIP6)
    return forces[0] - forces[1]


def test_matrix_is_that_of_the_papers_places_and_directions():
    columns = []
    for (x, y), (a, b) in HORIZONTAL:
        direction = np.array([a, b, 0.0]) / np.sqrt(2.0)
        columns.append([*direction, *np.cross([0.156 * x, 0.111 * y, 0.095], direction)])
    for x, y in VERTICAL:
        columns.append([0.0, 0.0, -1.0, *np.cross([0.12 * x, 0.218 * y, 0.01], [0.0, 0.0, -1.0])])
    assert ACTUATION.matrix == pytest.approx(np.array(columns).T, abs=1e-12)


@pytest.mark.parametrize(
    "demand", [(20.0, -7.0, 9.0, 1.0, -0.6, 2.0), (-11.0, 5.0, -14.0, -0.5, 1.2, -1.5), (0.0, 0.0, 0.0, 0.0, 0.0, 3.0)]
)
def test_what_is_demanded_is_what_mujoco_gets(demand):
    """Through the dead band and the square of the command; and measured commands amount to it."""
    commands = ACTUATION.allocate(demand)
    assert wrench_of(commands) == pytest.approx(demand, abs=1e-8)
    assert ACTUATION.effective(commands) == pytest.approx(demand, abs=1e-9)


def test_a_demand_beyond_the_limits_keeps_its_direction():
    demand = np.array([300.0, -80.0, 150.0, 10.0, -4.0, 20.0])
    commands = ACTUATION.allocate(demand)
    assert np.abs(commands).max() == pytest.approx(1.0, abs=1e-12)
    given = np.array(ACTUATION.effective(commands))
    assert given / np.linalg.norm(given) == pytest.approx(demand / np.linalg.norm(demand), abs=1e-9)
    assert ACTUATION.allocate(np.zeros(6)) == [0.0] * 8


def test_it_floats_and_rights_itself_as_its_numbers_say():
    """Buoyant by 1026 x 0.0134 - 13.5 kg; stable, and its step is short enough."""
    soundness.check(ROV, 1026.0)
    soundness.check_step(ROV, "implicitfast", 100.0, 1026.0)
    found = world()
    found.place("rov", np.array([0.0, 0.0, 15.0]), 0.0, 0.0, [0.0] * 8)
    mujoco.mj_forward(found.model, found.data)
    force = (found.data.qfrc_passive - found.data.qfrc_bias)[:6] * FLIP6
    assert force == pytest.approx([0, 0, -9.81 * (1026.0 * 0.0134 - 13.5), 0, 0, 0], abs=1e-9)


def test_it_drags_as_the_paper_says():
    """At 40 N ahead it settles where 13.7 u + 141 u^2 is 40 N."""
    found = world()
    found.place("rov", np.array([0.0, 0.0, 15.0]), 0.0, 0.4, [0.0] * 8)
    hover = Hovering(HoveringSettings(), 0.1)
    for _ in range(300):
        truth = found.truth("rov")
        held = hover.command(np.array([0.0, 0.0, 15.0 - truth.position[2]]), truth.attitude, truth.nu, 0.0)
        found.command("rov", ACTUATION.allocate(held._replace(surge=40.0)))
        found.advance(10)
    speed = (-13.7 + np.sqrt(13.7**2 + 4.0 * 141.0 * 40.0)) / (2.0 * 141.0)
    assert found.truth("rov").nu[0] == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize("towards", [0.0, 1.0, 2.5])
def test_it_holds_station_in_a_current(towards):
    """0.3 m/s, from 2.4 m away, by its true state: within a centimetre after half a minute, level, on its heading."""
    found = world((0.3 * np.cos(towards), 0.3 * np.sin(towards), 0.0))
    goal, hover, errors = np.array([1.0, -2.0, 10.0]), Hovering(HoveringSettings(), 0.1), []
    found.place("rov", np.array([0.0, 0.0, 9.0]), 0.5, 0.0, [0.0] * 8)
    for _ in range(600):
        truth = found.truth("rov")
        error = goal - truth.position
        found.command("rov", ACTUATION.allocate(hover.command(error, truth.attitude, truth.nu, 2.0)))
        found.advance(10)
        errors.append([*error, *truth.attitude[:2], truth.attitude[2] - 2.0])
    late = np.abs(errors[300:])
    assert late[:, :3].max() < 0.01  # [m]; measured 0.002
    assert late[:, 3:5].max() < 0.005
    assert late[:, 5].max() < 0.02  # no integral in yaw: 0.005 is left
    assert np.abs(truth.actuators).max() < 0.7  # what is left for waves


def test_without_its_integral_it_is_carried_off():
    """By drag over gain, (13.7 + 141 x 0.3) x 0.3 / 60 m in a current from ahead."""
    found, hover = world((-0.3, 0.0, 0.0)), Hovering(HoveringSettings(integral=(0.0, 0.0, 0.0)), 0.1)
    found.place("rov", np.array([0.0, 0.0, 9.0]), 0.0, 0.0, [0.0] * 8)
    for _ in range(600):
        truth = found.truth("rov")
        found.command(
            "rov", ACTUATION.allocate(hover.command(-truth.position + [0, 0, 9], truth.attitude, truth.nu, 0.0))
        )
        found.advance(10)
    assert found.truth("rov").position[0] == pytest.approx(-(13.7 + 141.0 * 0.3) * 0.3 / 60.0, rel=0.02)


def test_thrusters_that_cannot_do_everything_are_refused():
    """Seven of the eight can; the four in the plane alone cannot lift."""
    few = {"thrust": ACTUATION.thrust[:4], "dead_band": ACTUATION.dead_band[:4], "lags": ACTUATION.lags[:4]}
    with pytest.raises(InputError, match="the 4 thrusters do not push and turn in all six directions"):
        Thrusters(channels=ACTUATION.channels[:4], matrix=ACTUATION.matrix[:, :4], **few)


def test_planar_models_and_dockings_do_not_apply(tmp_path, capsys):
    with pytest.raises(InputError, match="no planar model of 'bluerov2_heavy', which is driven by thrusters"):
        planar_fit.fit_planar_model(ROV, 1.0)
    assert main(["dock", "--no-video", "--out", str(tmp_path), "--vehicle.model", ROV]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert "is driven by thrusters" in lines[0]
