"""The LAUV: its forces against the published equations, written down anew; how it turns and dives by them."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from auvsim.control.controller import ControllerSetup
from auvsim.control.torpedo import Autopilot, AutopilotSettings
from auvsim.physics import scenes, soundness
from auvsim.physics.planar_fit import Level, fit_planar_model
from auvsim.physics.propulsion import propulsion
from auvsim.physics.scenes import WorldSettings
from auvsim.physics.world import World
from auvsim.simulation import controllers
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands
from auvsim.water.currents import Uniform

NAME, FRESH = "lauv", 1000.0
# da Silva et al. 2007: mass with added mass, damping, lift of hull and fins, force and moment of a pair of fins.
M_X, M_Y, I_Z = 19.0, 34.0, 2.1
Y_V, Y_R, N_V, N_R, Y_VV, Y_RR, N_VV, N_RR = -23.0, 11.5, -3.1, -9.7, -80.0, 0.3, -1.5, -9.1
Y_UV, Y_UR, N_UV, N_UR, Y_D, N_D = -20.6, 3.84, 6.0, -1.53, 9.6, 3.84


def published(u, v, r, rudder):
    """Sway force and yaw moment of the published model, on accelerations in the body's axes; rudder to starboard."""
    Y = Y_V * v + Y_R * r + Y_VV * v * abs(v) + Y_RR * r * abs(r) + u * (Y_UV * v + Y_UR * r) - Y_D * u * u * rudder
    N = N_V * v + N_R * r + N_VV * v * abs(v) + N_RR * r * abs(r) + u * (N_UV * v + N_UR * r) + N_D * u * u * rudder
    return Y - M_X * u * r, N - (M_Y - M_X) * u * v


@pytest.mark.parametrize("state", [(1.43, 0.05, -0.04, 0.03), (0.9, -0.08, 0.1, -0.1), (1.8, 0.0, 0.0, 0.1)])
def test_forces_are_the_published_ones(state):
    """To 3 %: fins there act at the hull's own speed, here at theirs, with drag; and at 1000 kg/m3 as published."""
    found = Level(NAME, FRESH).evaluate(*state, 0.0)
    Y, N = published(*state)
    scale_y, scale_n = abs(Y_D) * 0.3 * state[0] ** 2, N_D * 0.3 * state[0] ** 2
    assert found[1] == pytest.approx(Y, abs=0.03 * scale_y + 0.02 * abs(Y))
    assert found[2] == pytest.approx(N, abs=0.03 * scale_n + 0.02 * abs(N))


def test_drag_is_that_of_the_published_trim():
    """8.34 N at 1.43 m/s; here besides the fins' own, 4 x 0.0032 m2 at a profile drag of 0.01: 0.13 N."""
    level = Level(NAME, FRESH)
    # at the shaft speed at which the screw gives no thrust: J = 0.4566 / 0.4174
    idle = 2.0 * math.pi * 1.43 * (1.0 - 0.056) / (0.11 * 0.4566 / 0.4174)
    fins = 0.5 * FRESH * 4 * 0.0032 * 0.01 * 1.43**2
    assert level.forces(1.43, shaft_speed=idle)[0] == pytest.approx(-8.34 - fins, rel=0.01)


def test_mass_and_trim():
    level = Level(NAME, 1026.0)
    assert level.mass == pytest.approx(18.0)
    assert level.x_g == pytest.approx(0.0, abs=1e-5)
    assert level.inertia[2, 2] == pytest.approx(2.1, rel=2e-3)
    assert 9.81 * (1026.0 * level.volume - level.mass) == pytest.approx(1.0, abs=0.01)
    soundness.check(NAME, 1026.0)
    soundness.check_step(NAME, "implicitfast", 100.0, 1026.0)


def test_it_is_stable_as_published():
    """Straight-line stable, and the eigenvalues of sway and yaw are the published equations'."""
    u = 1.43
    p = fit_planar_model(NAME, u, FRESH).parameters
    inertia = np.diag([p.m - p.Y_vd, p.I_z - p.N_rd])
    damping = np.array([[p.Y_v + p.Y_uv * u, p.Y_r + (p.Y_ur - p.m) * u], [p.N_v + p.N_uv * u, p.N_r + p.N_ur * u]])
    ours = np.linalg.eigvals(np.linalg.inv(inertia) @ damping)
    theirs = np.array([[Y_V + Y_UV * u, Y_R + Y_UR * u - M_X * u], [N_V + (N_UV - M_Y + M_X) * u, N_R + N_UR * u]])
    published_eigenvalues = np.linalg.eigvals(np.diag([1 / M_Y, 1 / I_Z]) @ theirs)
    assert ours.real.max() < 0.0
    assert np.sort(ours) == pytest.approx(np.sort(published_eigenvalues), rel=0.03)


def sailed(commands, seconds, depth=15.0):
    """Truths at 10 Hz of the vehicle from 1.43 m/s on, with commands of the time and truth."""
    world = World(scenes.scene({"auv": NAME}, {}, WorldSettings(), 100.0), Uniform((0.0, 0.0, 0.0)))
    actuation = library.vehicle(NAME).actuation
    ahead = propulsion(NAME, 1.0, 1026.0).ahead(1.43)
    world.place("auv", np.array([0.0, 0.0, depth]), 0.0, 1.43, actuation.allocate(ahead))
    found = []
    for k in range(round(10 * seconds)):
        world.command("auv", actuation.allocate(commands(k / 10.0, world.truth("auv"), ahead.shaft_speed)))
        world.advance(10)
        found.append(world.truth("auv"))
    return found


def held(truth, rudder, shaft):
    """A rudder, at a depth held by pitch and stern planes."""
    pitch = max(-0.3, min(0.3, 0.12 * (truth.position[2] - 15.0)))
    elevator = 2.5 * (truth.attitude[1] - pitch) + 1.0 * truth.nu[4]
    return Commands(rudder, max(-0.35, min(0.35, elevator)), shaft)


def test_it_turns_as_the_published_equations_say():
    """Steady rate and drift at 8.6 degrees of rudder and the speed that is left in the turn, within 6 %."""
    rudder = 0.15
    truths = sailed(lambda _, truth, shaft: held(truth, rudder, shaft), 60.0)
    u, v, r = np.mean([t.nu[[0, 1, 5]] for t in truths[-100:]], axis=0).tolist()

    def rates(_, state):
        Y, N = published(u, *state, rudder)
        return [Y / M_Y, N / I_Z]

    steady = solve_ivp(rates, (0.0, 60.0), [0.0, 0.0], rtol=1e-8).y[:, -1]
    assert r > 0.1
    assert (v, r) == pytest.approx(tuple(steady), rel=0.06)  # roll of a degree or two, and fins at 1026 kg/m3


def test_it_dives_with_a_positive_stern_plane_and_levels_off():
    truths = sailed(lambda _, truth, shaft: Commands(0.0, 0.1, shaft), 10.0)
    assert truths[-1].attitude[1] < -0.1
    assert truths[-1].position[2] > 16.0


def test_its_autopilot_holds_it():
    """20 degrees to starboard and 2 m down with its own gains; the default ones overshoot by 7.6 degrees."""
    vehicle = library.vehicle(NAME)
    pilot = Autopilot(
        ControllerSetup(
            settings=AutopilotSettings(**controllers.of_model(NAME)),
            actuation=vehicle.actuation,
            ahead=propulsion(NAME, 1.0, 1026.0).ahead,
            period=0.1,
        )
    )
    from auvsim.base.reading import Reading
    from auvsim.control.controller import Setpoints

    def command(time, truth, _):
        roll, pitch, heading = truth.attitude.tolist()
        pilot.observe(
            [
                Reading("compass", time, time, np.array([heading, pitch, roll])),
                Reading("depth", time, time, truth.position[2:]),
            ]
        )
        return pilot.command(Setpoints(math.radians(20.0), 17.0, 1.43))

    truths = sailed(command, 60.0)
    headings, depths = [t.attitude[2] for t in truths], [t.position[2] for t in truths]
    assert max(headings) < math.radians(20.5)
    assert headings[-1] == pytest.approx(math.radians(20.0), abs=0.01)
    assert max(depths) < 17.4
    assert depths[-1] == pytest.approx(17.0, abs=0.15)
