"""Every integrator converges to the same trajectory, at its own order, also where added mass is ten times the mass."""

import itertools

import mujoco
import numpy as np
import pytest
from bodies import Rigid, command, dense, free_body, motion, remus100, set_motion, solve_motion

RIGID = Rigid()
INTEGRATORS = ("Euler", "implicit", "implicitfast", "RK4")
DAMPING = dense(2, 10.0, 1.0)
TIMES = np.array([0.0, 2.0])


def run(integrator, timestep, added, nu, rigid=RIGID, damping=DAMPING, seconds=2.0):
    """State (18,) after some seconds."""
    fields = {"hull_linear_damping": damping}
    model = free_body(added_mass=added, rigid=rigid, fields=fields, timestep=timestep, integrator=integrator)
    data = mujoco.MjData(model)
    set_motion(model, data, nu)
    mujoco.mj_step(model, data, round(seconds / timestep))
    return np.concatenate([part.ravel() for part in motion(model, data)])


def exact(added, nu, rigid=RIGID, damping=DAMPING):
    position, rotation, nus = solve_motion(rigid.matrix + added, lambda t, x, R, nu: -damping @ nu, nu, TIMES)
    return np.concatenate([position[-1], rotation[-1].ravel(), nus[-1]])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_first_order_in_a_damped_tumble_with_ten_times_the_mass(integrator):
    """Euler and the implicit integrators are of first order, RK4 of second where rotations do not commute."""
    added = dense(1, 10.0 * RIGID.mass, 10.0)
    nu = [1.0, 0.3, -0.2, 0.5, -0.6, 0.8]
    truth = exact(added, nu)
    errors = [np.abs(run(integrator, h, added, nu) - truth).max() for h in (4e-3, 2e-3, 1e-3, 5e-4)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    # The next order shows by 3 per cent at the finest step: the body tumbles at 1 rad/s and is driven by its Munk
    # moment.
    assert orders[-1] == pytest.approx(2.0 if integrator == "RK4" else 1.0, abs=0.05)
    assert errors[-1] < (5e-7 if integrator == "RK4" else 0.05)  # measured 2.5e-7 and 0.03: all to the same answer


def test_rk4_is_of_fourth_order_in_planar_motion():
    rigid = Rigid(centre=np.array([0.03, -0.02, 0.0]), inertia=np.diag([0.4, 1.1, 1.3]))
    planar = np.zeros((6, 6))
    planar[np.ix_((0, 1, 5), (0, 1, 5))] = [[30.0, 10.0, -0.5], [10.0, 120.0, 2.0], [-0.5, 2.0, 12.0]]
    damping = np.diag([20.0, 40.0, 0.0, 0.0, 0.0, 4.0])
    nu = [0.8, 0.3, 0.0, 0.0, 0.0, 0.8]
    truth = exact(planar, nu, rigid, damping)
    errors = [np.abs(run("RK4", h, planar, nu, rigid, damping) - truth).max() for h in (0.04, 0.02, 0.01)]
    orders = np.log2([errors[0] / errors[1], errors[1] / errors[2]])
    assert orders == pytest.approx(4.0, abs=0.05)  # measured 4.01
    assert errors[-1] < 1e-8  # measured 5e-9


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("ratio", [10.0, 100.0])
def test_added_mass_does_not_destabilise(integrator, ratio):
    """At rest in gravity-free water, disturbed and damped, energy falls at 20 ms for any ratio of added mass to mass.

    A simulator that feeds M_A times a lagged acceleration back as a force blows up once added mass exceeds the mass.
    """
    added = dense(1, ratio * RIGID.mass, ratio)
    nu = 0.3 * np.array([1.0, 0.3, -0.2, 0.5, -0.6, 0.8])
    total = RIGID.matrix + added
    energies = [0.5 * nu @ total @ nu]
    for seconds in (1.0, 2.0, 4.0):
        state = run(integrator, 0.02, added, nu, seconds=seconds)
        energies.append(0.5 * state[12:] @ total @ state[12:])
    assert all(after < before for before, after in itertools.pairwise(energies))


def test_the_whole_vehicle_converges_with_every_integrator():
    """remus100 from rest with rudder and plane over, servos and shaft lagging: all integrators meet at one answer."""

    def sail(integrator, timestep):
        model = remus100(integrator=integrator, timestep=timestep)
        data = mujoco.MjData(model)
        set_motion(model, data, [1.0, 0, 0, 0, 0, 0])
        command(data, 0.15, -0.1, 1200.0, at_once=False)
        mujoco.mj_step(model, data, round(5.0 / timestep))
        return np.concatenate([part.ravel() for part in motion(model, data)])

    truth = sail("RK4", 5e-4)
    for integrator in ("Euler", "implicit", "implicitfast"):
        errors = [np.abs(sail(integrator, h) - truth).max() for h in (0.01, 0.005, 0.0025)]
        orders = np.log2([errors[0] / errors[1], errors[1] / errors[2]])
        assert orders == pytest.approx(1.0, abs=0.02), integrator  # measured 0.99 to 1.01
        assert errors[0] < 0.02  # m, after 7.4 m of a turning dive at the default rate of 100 Hz; measured 0.011
    assert np.abs(sail("RK4", 0.01) - truth).max() < 1e-5  # measured 2e-6
