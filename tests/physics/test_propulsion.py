"""Propeller, shaft and servos: thrust, torque and its reaction, lags and rate limits."""

import mujoco
import numpy as np
import pytest
from bodies import DENSITY, RPM, body_force, command, motion, remus100, set_motion, set_water
from scipy.spatial.transform import Rotation

D, W, T, SWIRL = 0.14, 0.056, 0.1, 0.9
KT, KQ = (0.4566, -0.4174), (0.07, -0.0585)


def force_of_the_shaft(u, rpm, current=0.0):
    """Force on the hull (6,) that the turning shaft adds, and the torque on the shaft itself."""
    model = remus100()
    data = mujoco.MjData(model)
    set_water(data, (current, 0, 0))
    forces = []
    for n in (rpm, 0.0):
        command(data, rpm=n)
        set_motion(model, data, [u, 0, 0, 0, 0, 0])
        forces.append(body_force(model, data))
    command(data, rpm=rpm)
    set_motion(model, data, [u, 0, 0, 0, 0, 0])
    return forces[0] - forces[1], data.qfrc_passive[model.joint("shaft").dofadr[0]]


@pytest.mark.parametrize("rpm", [600, 1525])
@pytest.mark.parametrize("u", [0.0, 0.8, 1.5])
def test_thrust_and_torque_follow_the_open_water_curves(rpm, u):
    """T = (1 - t) rho n^2 D^4 K_T(J), Q = rho n^2 D^5 K_Q(J), J = (1 - w) u / (n D) (Fossen 2021, eq. 9.8)."""
    n = rpm / 60.0
    J = (1 - W) * u / (n * D)
    force, torque = force_of_the_shaft(u, rpm)
    Q = DENSITY * n**2 * D**5 * (KQ[0] + KQ[1] * J)
    thrust = (1 - T) * DENSITY * n**2 * D**4 * (KT[0] + KT[1] * J)
    assert force[0] == pytest.approx(thrust, rel=1e-12)  # rounding
    assert -torque == pytest.approx(Q, rel=1e-12)
    # The hull feels what the tail does not take out of the swirl, against the shaft's turn.
    assert force[3] == pytest.approx(-(1 - SWIRL) * Q, rel=1e-9)
    assert np.abs(force[[1, 2, 4, 5]]).max() < 1e-12


def test_reversed_shaft_pulls_astern_and_meets_its_wash():
    force, torque = force_of_the_shaft(0.0, -900)
    ahead, _ = force_of_the_shaft(0.0, 900)
    assert force[0] == pytest.approx(-ahead[0], rel=1e-12)
    assert torque > 0.0
    assert force[3] > 0.0
    # Backing while going ahead (J < 0) the curves hold their bollard values.
    assert force_of_the_shaft(1.0, -900)[0][0] == pytest.approx(force[0], rel=1e-12)


def test_advance_speed_is_through_the_water():
    """The published Python model takes the speed over ground: in a following current of 0.5 m/s it loses 9 per cent."""
    still, _ = force_of_the_shaft(1.0, 1000)
    for current in (0.5, -0.5):
        found, _ = force_of_the_shaft(1.0 + current, 1000, current)
        assert found == pytest.approx(still, abs=1e-11)  # rounding of 1 + 0.5 - 0.5


def test_torque_rolls_the_vehicle_against_the_shaft():
    """A right-handed propeller rolls the hull to port (negative), until the weight holds it: as Prestero's K_prop < 0.

    The published Python model has the same angle, 1.019 degrees at 1525 rpm, to the other side.
    """
    model = remus100()
    data = mujoco.MjData(model)
    command(data, rpm=1525.0)
    set_motion(model, data, [2.5, 0, 0, 0, 0, 0])
    mujoco.mj_step(model, data, 3000)
    _, rotation, nu = motion(model, data)
    roll = Rotation.from_matrix(rotation).as_euler("ZYX")[2]
    n = data.joint("shaft").qvel[0] / (2 * np.pi)
    Q = DENSITY * n**2 * D**5 * (KQ[0] + KQ[1] * (1 - W) * nu[0] / (n * D))
    weight = model.body_subtreemass[1] * 9.81
    assert np.sin(roll) == pytest.approx(-(1 - SWIRL) * Q / (weight * 0.02), rel=1e-3)  # z_g to its printed digits
    assert np.degrees(roll) == pytest.approx(-1.019, rel=0.02)


def test_a_small_step_of_a_servo_is_a_first_order_lag():
    """63 % after 0.1 s; the hinge's own inertia, armature / damping = 10 ms, comes on top."""
    model = remus100(timestep=0.001)
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6))
    command(data, rudder=0.03, at_once=False)
    angles = []
    for _ in range(500):
        mujoco.mj_step(model, data)
        angles.append(data.joint("rudder_upper").qpos[0] / 0.03)
    reached = 0.001 * (np.argmax(np.array(angles) > 1 - np.exp(-1)) + 1)
    assert reached == pytest.approx(0.1, abs=0.012)
    assert angles[-1] == pytest.approx(1.0, abs=0.02)  # exp(-4.9)
    assert max(angles) < 1.0 + 1e-9  # no overshoot


def test_a_large_step_of_a_servo_is_rate_limited():
    model = remus100(timestep=0.001)
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6))
    command(data, rudder=-0.25, at_once=False)
    mujoco.mj_step(model, data, 400)
    command(data, rudder=0.25, at_once=False)
    rates = []
    for _ in range(400):
        mujoco.mj_step(model, data)
        rates.append(data.joint("rudder_upper").qvel[0])
    assert max(rates) == pytest.approx(0.7, rel=0.01)  # forcerange / damping, approached with exp(-t / 10 ms)
    assert np.sum(np.array(rates) > 0.69) > 250  # for most of the way: 0.43 rad at 0.7 rad/s is 0.6 s
    mujoco.mj_step(model, data, 1000)
    assert data.joint("rudder_upper").qpos[0] == pytest.approx(0.25, abs=1e-3)


def test_fins_stop_at_their_limit():
    model = remus100()
    data = mujoco.MjData(model)
    set_motion(model, data, [1.5, 0, 0, 0, 0, 0])
    command(data, rudder=1.0, elevator=-1.0, at_once=False)
    mujoco.mj_step(model, data, 300)
    for name, sign in (("rudder_upper", 1), ("rudder_lower", 1), ("plane_port", -1), ("plane_starboard", -1)):
        # The limit is soft: 1 mrad, 0.06 degrees.
        assert data.joint(name).qpos[0] == pytest.approx(sign * np.radians(15.0), abs=1e-3)


def test_the_shaft_lags_one_second():
    model = remus100()
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6))
    command(data, rpm=1000.0, at_once=False)
    mujoco.mj_step(model, data, 100)
    # The water's torque, 0.3 N m of kv = 10 N m s/rad, takes up to 0.1 per cent.
    assert data.joint("shaft").qvel[0] == pytest.approx(1000 * RPM * (1 - np.exp(-1)), rel=5e-3)
