"""Only velocity relative to the water matters: currents carry a vehicle along and change nothing else."""

import mujoco
import numpy as np
import pytest
from bodies import (
    DENSITY,
    WHEEL,
    Rigid,
    body_force,
    command,
    dense,
    free_body,
    motion,
    remus100,
    set_motion,
    set_water,
)
from scipy.spatial.transform import Rotation

CURRENTS = {"following": (0.5, 0.0, 0.0), "across": (0.0, -0.7, 0.0), "vertical": (0.0, 0.0, 0.2), "all": (1, 2, -0.4)}
START = np.array([1.2, 0.05, -0.03, 0.02, 0.01, -0.04])
ATTITUDE = Rotation.from_euler("ZYX", (2.0, 0.1, -0.1)).as_matrix()


def relative(model, data, water):
    """Attitude and velocity through the water, (15,), and the NED position."""
    position, rotation, nu = motion(model, data)
    nu[:3] -= rotation.T @ water
    return np.concatenate([rotation.ravel(), nu]), position


def sail(velocity, integrator):
    """A remus100 under changing commands for 30 s; its states every 5 s."""
    velocity = np.array(velocity, dtype=float)
    model = remus100(integrator=integrator)
    data = mujoco.MjData(model)
    command(data, rpm=900.0)
    set_water(data, velocity)
    nu = START.copy()
    nu[:3] += ATTITUDE.T @ velocity
    set_motion(model, data, nu, ATTITUDE)
    states, positions = [], []
    for rudder, elevator, rpm in ((0.1, 0.0, 1200), (-0.2, 0.05, 1525), (0.0, -0.1, 700), (0.25, 0.2, -300)) * 2:
        command(data, rudder, elevator, rpm, at_once=False)
        mujoco.mj_step(model, data, 375)
        state, position = relative(model, data, velocity)
        states.append(np.concatenate([state, data.qpos[7:11], data.qvel[6:]]))
        positions.append(position - velocity * data.time)
    return np.array(states), np.array(positions)


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
@pytest.mark.parametrize("name", CURRENTS)
def test_a_steady_uniform_current_only_shifts_the_track(name, integrator):
    states, positions = sail(CURRENTS[name], integrator)
    still_states, still_positions = sail((0, 0, 0), integrator)
    assert np.ptp(still_positions, axis=0).max() > 10.0  # it does go somewhere
    # Rounding of 1e-16 in velocities of 3 m/s, grown over 3000 steps of a stable motion; measured below 1e-12.
    assert states == pytest.approx(still_states, abs=1e-9)
    assert positions == pytest.approx(still_positions, abs=1e-9)


def coincident(integrator, timestep=0.01):
    """A neutral body, its centre of mass in its centre of buoyancy: accelerating water does not turn it."""
    mass = 12.0
    fields = {
        "hull_linear_damping": dense(2, 3.0, 0.5),
        "hull_quadratic_damping": np.diag([5.0, 60.0, 60.0, 0.1, 2.0, 2.0]),
        "hull_body_lift": 20.0,
        "hull_body_lift_x": -0.15,
    }
    return free_body(
        added_mass=dense(1, 20.0, 2.0),
        rigid=Rigid(mass=mass, centre=np.zeros(3)),
        volume=(mass + 0.5) / DENSITY,  # with the wheel
        fields=fields,
        inside=WHEEL,
        gravity=9.81,
        integrator=integrator,
        timestep=timestep,
    )


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize("nu", [np.zeros(6), np.array([1.0, 0.3, -0.2, 0.5, -0.6, 0.8])], ids=["at rest", "tumbling"])
def test_an_accelerating_current_carries_a_neutral_body_along(nu, integrator):
    """The water at time t is v + a t, in one expansion that is never refreshed.

    Every step and RK4 stage must read it at its own time. Velocity through the water is then that in still water.
    """
    velocity, derivative = np.array([0.3, -0.4, 0.1]), np.array([0.05, 0.08, -0.02])
    states = []
    for v, a in ((np.zeros(3), np.zeros(3)), (velocity, derivative)):
        model = coincident(integrator)
        data = mujoco.MjData(model)
        set_water(data, v, a)
        start = nu.copy()
        start[:3] += ATTITUDE.T @ v
        set_motion(model, data, start, ATTITUDE)
        mujoco.mj_step(model, data, 1000)
        states.append(relative(model, data, v + a * data.time)[0])
    # Accelerations are the same to rounding and a t is integrated without error; measured below 1e-12.
    assert states[1] == pytest.approx(states[0], abs=1e-10)
    if not nu.any():
        assert np.abs(states[1][9:]).max() < 1e-10  # it never moves in the water at all


def turning(time):
    """Velocity and its derivative of a current of 0.5 m/s that turns at 9 degrees a second."""
    speed, rate = 0.5, np.radians(9.0)
    north, east = np.cos(rate * time), np.sin(rate * time)
    return speed * np.array([north, east, 0.0]), speed * rate * np.array([-east, north, 0.0])


def test_a_turning_current_carries_a_neutral_body_along():
    """The expansion is refreshed at every step.

    What is left is the water's change of acceleration within a step, a'' h / 2 summed up: first order in the step.
    """
    errors = []
    for step in (0.02, 0.01, 0.005):
        model = coincident("RK4", step)
        data = mujoco.MjData(model)
        set_motion(model, data, [0.5, 0, 0, 0, 0, 0])
        for _ in range(round(10.0 / step)):
            set_water(data, *turning(data.time))
            data.userdata[0] = data.time
            mujoco.mj_step(model, data)
        state, _ = relative(model, data, turning(data.time)[0])
        errors.append(np.abs(state[9:]).max())
    assert errors[1] < 5e-4  # of a current of 0.5 m/s; a'' h / 2 x 10 s is 6e-4, less what drag takes out
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(1.0, abs=0.1)


def test_water_of_another_place_and_time_is_the_expansions():
    """Force at rest at (t, x) in water v + a t + G x is that of a motion at -(v + a t + G x), plus what a and G push.

    At rest over ground the hull meets no other water: its added mass feels dv/dt alone, and G' p (Galper & Miloh 1995).
    """
    random = np.random.default_rng(1)
    added = dense(1, 20.0, 2.0)
    fields = {"hull_linear_damping": np.diag([3.0, 4.0, 5.0, 0.0, 0.0, 0.0])}
    model = free_body(added_mass=added, fields=fields, volume=0.01)
    data = mujoco.MjData(model)
    for _ in range(10):
        v, a, place = (random.uniform(-1.0, 1.0, 3) for _ in range(3))
        G = random.uniform(-0.3, 0.3, (3, 3))
        time = random.uniform(0.0, 5.0)
        here = v + a * time + G @ place
        set_water(data, v, a, G)
        data.time = time
        set_motion(model, data, np.zeros(6), position=place)
        found = body_force(model, data)
        set_water(data)
        set_motion(model, data, [*-here, 0, 0, 0])
        none = np.zeros(3)
        expected = body_force(model, data) + added @ np.concatenate([a, none])
        expected += DENSITY * 0.01 * np.concatenate([a + G @ here, none])
        expected[:3] -= G.T @ (added @ np.concatenate([-here, none]))[:3]
        assert found == pytest.approx(expected, abs=1e-11)  # rounding of a sum of about 50 N
