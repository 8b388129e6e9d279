"""Propeller, shaft and servos: thrust, torque and its reaction, lags and rate limits."""

import mujoco
import numpy as np
import pytest
from bodies import DENSITY, RPM, body_force, command, motion, remus100, set_motion, set_water
from scipy.spatial.transform import Rotation

from auvsim.physics.forces import FIN, HULL, PROPELLER

D, W, T, SWIRL = 0.14, 0.056, 0.1, 0.9
KT, KQ = (0.4566, -0.4174), (0.07, -0.0585)


def with_numerics(**numbers):
    """The remus100 with optional numbers of its propeller or hull, as `equip` would have put them."""
    model = remus100()
    for name, value in numbers.items():
        body = "propeller" if name in PROPELLER else "hull"
        model.body_user[model.body(body).id, (PROPELLER | HULL)[name][0]] = value
    return model


def force_of_the_shaft(u, rpm, current=0.0, **numbers):
    """Force on the hull (6,) that the turning shaft adds, and the torque on the shaft itself."""
    model = with_numerics(**numbers)
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


def axial(u, rpm, **numbers):
    """Axial force [N] on the whole vehicle and torque on the shaft [N m], standing servos."""
    model = with_numerics(**numbers)
    data = mujoco.MjData(model)
    command(data, rpm=rpm)
    set_motion(model, data, [u, 0, 0, 0, 0, 0])
    return body_force(model, data)[0], data.qfrc_passive[model.joint("shaft").dofadr[0]]


def test_astern_it_loses_a_share_of_thrust_and_torque_and_ahead_nothing():
    for u in (-1.0, 0.0, 1.5):
        whole, lossy = (force_of_the_shaft(u, -900, astern_loss=loss) for loss in (0.0, 0.3))
        assert lossy[0][0] == pytest.approx(0.7 * whole[0][0], rel=1e-12)
        assert lossy[1] == pytest.approx(0.7 * whole[1], rel=1e-12)
        assert axial(u, 900, astern_loss=0.3) == axial(u, 900)


@pytest.mark.parametrize("u", [1.5, -0.8])
def test_a_locked_shaft_drags_as_a_disc(u):
    """C rho A / 2 |v| v on the inflow at rest, nothing from the rate of no thrust on, a smooth joint between."""
    inflow = (1 - W) * u

    def drag(rpm):
        return axial(u, rpm)[0] - axial(u, rpm, locked_drag=0.8)[0]

    assert drag(0.0) == pytest.approx(0.5 * DENSITY * np.pi * D**2 / 4 * 0.8 * abs(inflow) * inflow, rel=1e-9)
    free = 60.0 * abs(inflow) / (D * KT[0] / -KT[1])  # J = J_0
    assert drag(1.001 * free) == drag(-1.001 * free) == 0.0
    assert drag(0.5 * free) == pytest.approx(0.25 * drag(0.0), rel=1e-9)
    assert drag(0.99 * free) == pytest.approx(1e-4 * drag(0.0), rel=1e-6)


def steady_rate(u, rpm, seconds=6.0, **numbers):
    """Rate of the shaft [1/s] that its servo reaches on a vehicle held at a speed, and the water's torque then."""
    model = with_numerics(**numbers)
    data = mujoco.MjData(model)
    command(data, rpm=rpm)
    for _ in range(round(seconds / 0.01)):
        rate = data.joint("shaft").qvel[0]
        set_motion(model, data, [u, 0, 0, 0, 0, 0])
        data.joint("shaft").qvel[0] = rate
        mujoco.mj_step(model, data)
    n = abs(data.joint("shaft").qvel[0]) / (2 * np.pi)
    J = (1 - W) * abs(u) / (n * D) if u * rpm > 0 else 0.0
    return n, DENSITY * n**2 * D**5 * (KQ[0] + KQ[1] * J)


@pytest.mark.parametrize(("u", "rpm"), [(0.0, 1525), (1.5, 1525), (0.5, -1525)])
def test_torque_and_power_limits_hold_the_shaft_back(u, rpm):
    """The rate settles where the water takes what the motor has, within 2 per cent: a servo of 1 s against 20 ms."""
    n, Q = steady_rate(u, rpm)
    assert n == pytest.approx(1525 / 60, rel=0.01)
    held, torque = steady_rate(u, rpm, torque_limit=0.6 * Q)
    assert held < 0.9 * n
    assert torque == pytest.approx(0.6 * Q, rel=0.03)
    held, torque = steady_rate(u, rpm, power_limit=0.5 * 2 * np.pi * n * Q)
    assert 2 * np.pi * held * torque == pytest.approx(0.5 * 2 * np.pi * n * Q, rel=0.06)  # to the third power of n
    assert steady_rate(u, rpm, torque_limit=1.2 * Q) == (n, Q)


def test_induced_drag_of_the_hull_is_prandtls():
    """D = k L^2 / (rho U^2 / 2) against the motion, beside a body lift L of 28.6 |u| v."""
    nu = np.array([1.5, 0.2, -0.1, 0.0, 0.0, 0.0])
    forces = []
    for k in (0.0, 10.0):
        model = with_numerics(body_induced_drag=k)
        data = mujoco.MjData(model)
        set_motion(model, data, nu)
        forces.append(body_force(model, data))
    speed = np.linalg.norm(nu[:3])
    lift = 28.6 * 1.5 * np.hypot(0.2, 0.1)
    drag = 10.0 * lift**2 / (0.5 * DENSITY * speed**2)
    assert forces[1] - forces[0] == pytest.approx([*(-drag * nu[:3] / speed), 0, 0, 0], abs=1e-9)


def crash_stop(**numbers):
    """Way [m] from 1.5 m/s to rest, shaft full astern."""
    model = with_numerics(**numbers)
    data = mujoco.MjData(model)
    command(data, rpm=900.0)
    set_motion(model, data, [1.5, 0, 0, 0, 0, 0], position=[0, 0, 20])
    mujoco.mj_step(model, data, 3000)
    start, _, nu = motion(model, data)
    assert nu[0] == pytest.approx(1.5, abs=0.01)
    command(data, rpm=-1525.0, at_once=False)
    while motion(model, data)[2][0] > 0.0:
        mujoco.mj_step(model, data)
    return np.linalg.norm(motion(model, data)[0] - start)


def test_crash_stop_is_as_long_as_the_readme_says():
    assert crash_stop() == pytest.approx(1.81, abs=0.02)
    assert crash_stop(astern_loss=0.3) == pytest.approx(1.97, abs=0.02)
    assert crash_stop(astern_loss=0.3, power_limit=40.0) == pytest.approx(2.15, abs=0.02)


def speed_lost(model):
    """Share of the speed that a steady turn at 15 degrees of rudder and 1525 rpm takes."""
    data = mujoco.MjData(model)
    speeds = []
    set_motion(model, data, [2.5, 0, 0, 0, 0, 0], position=[0, 0, 20])
    for angle in (0.0, np.radians(15.0)):
        command(data, angle, 0.0, 1525.0)
        mujoco.mj_step(model, data, 5000)
        speeds.append(np.linalg.norm(motion(model, data)[2][:3]))
    return 1.0 - speeds[1] / speeds[0]


def test_speed_lost_in_a_turn_is_as_the_readme_says():
    assert speed_lost(with_numerics()) == pytest.approx(0.0046, abs=2e-4)
    model = with_numerics(body_induced_drag=12.6)
    for fin in ("rudder_upper", "rudder_lower", "plane_port", "plane_starboard"):
        model.body_user[model.body(fin).id, FIN["induced_drag"][0]] = 2.0
    assert speed_lost(model) == pytest.approx(0.0099, abs=2e-4)
