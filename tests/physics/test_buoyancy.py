"""Weight, buoyancy and drag at rest and in steady fall: trim, righting, terminal speeds."""

import mujoco
import numpy as np
import pytest
from bodies import DENSITY, GRAVITY, RPM, TURN6, Rigid, command, free_body, motion, remus100, set_motion
from scipy.spatial.transform import Rotation

ZG = 0.02  # the remus100's centre of gravity below its centre of buoyancy [m], as published


def angles(model, data):
    """Roll, pitch, yaw [rad]."""
    return Rotation.from_matrix(motion(model, data)[1]).as_euler("ZYX")[::-1]


def test_remus100_at_rest_stays_level_and_where_it_is():
    """Its published mass is rho V to 1e-6 and its centres are on one vertical to a tenth of a millimetre."""
    model = remus100()
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6), position=[0, 0, 20])
    mujoco.mj_step(model, data, 6000)
    roll, pitch, yaw = angles(model, data)
    assert abs(roll) < 1e-12
    assert abs(yaw) < 1e-12
    assert abs(pitch) < np.radians(0.1)  # x_g = 0.04 mm over z_g = 20 mm; measured 0.013 degrees
    position, _, nu = motion(model, data)
    assert np.abs(position - [0, 0, 20]).max() < 0.05  # in a minute
    assert np.abs(nu).max() < 1e-3


@pytest.mark.parametrize(("axis", "angle_deg"), [(0, 20.0), (1, 10.0)], ids=["roll", "pitch"])
def test_remus100_rights_itself_at_its_natural_frequency(axis, angle_deg):
    """omega^2 = W z_g / (I + A): the weight below the centre of buoyancy turns it back, the added inertia slows it."""
    model = remus100(integrator="RK4")
    data = mujoco.MjData(model)
    stiffness = model.body_subtreemass[1] * GRAVITY * ZG
    damping = (0.588, 0.0)[axis]  # linear K_p [N m s]
    # Hull about its centre, z_g, four fins' 80 g at 0.13 m radius and 0.747 m behind, propeller at 0.815 m; added
    # inertia.
    inertia = (0.111 + 30.87 * ZG**2 + 0.08 * 0.13**2 + 0.0336, 3.933 + 0.08 * (0.747**2 + 0.815**2) + 3.426)[axis]
    omega = np.sqrt(stiffness / inertia - (damping / (2 * inertia)) ** 2)

    start = np.zeros(3)
    start[axis] = np.radians(angle_deg)
    R = Rotation.from_euler("ZYX", start[::-1]).as_matrix()
    set_motion(model, data, np.zeros(6), R, [0, 0, 20])
    mujoco.mj_step(model, data)
    assert angles(model, data)[axis] < start[axis]
    history = []
    for _ in range(round(5.2 * np.pi / omega / 0.01)):
        mujoco.mj_step(model, data)
        history.append(angles(model, data)[axis])
    history = np.array(history)
    crossing = np.nonzero(np.diff(np.sign(history)))[0]
    times = 0.01 * (crossing + history[crossing] / (history[crossing] - history[crossing + 1]))
    assert len(times) == 5
    # Half periods after the first swing. Sway goes with roll through m z_g (3 per cent of stiffness over inertia);
    # quadratic damping and sin(20 deg) / 20 deg leave the rest. Without added inertia roll would be 14, pitch 37 per
    # cent faster.
    assert np.pi / np.diff(times).mean() == pytest.approx(omega, rel=0.04)
    assert np.abs(history[-100:]).max() < 0.5 * start[axis]


def test_righting_moment_has_the_closed_form():
    """-W z_g sin(roll) about x, -W z_g sin(pitch) about y (Fossen 2021, eq. 4.6, coincident in x)."""
    model = remus100()
    data = mujoco.MjData(model)
    weight = model.body_subtreemass[1] * GRAVITY
    for roll, pitch in ((0.3, 0.0), (-0.3, 0.0), (0.0, 0.2), (0.0, -0.2), (0.4, 0.3)):
        set_motion(model, data, np.zeros(6), Rotation.from_euler("ZYX", (0.5, pitch, roll)).as_matrix())
        force = data.qfrc_passive - data.qfrc_bias
        moment = TURN6[3:, 3:] @ force[3:6]
        expected = [-weight * ZG * np.sin(roll) * np.cos(pitch), -weight * ZG * np.sin(pitch), 0.0]
        assert moment == pytest.approx(expected, abs=1e-4)  # the inertial's printed digits: 1e-6 m of 304 N
        assert np.linalg.norm(force[:3]) == pytest.approx(abs(weight - DENSITY * 0.0302437 * GRAVITY), abs=1e-9)


AREA, CROSS_FLOW = 0.04, 1.1
STRIPS = {
    "hull_cross_flow_drag": CROSS_FLOW,
    "hull_strip_x": [-0.3, -0.1, 0.1, 0.3],
    "hull_strip_area": [AREA] * 4,
}


@pytest.mark.parametrize("excess", [0.5, -0.5], ids=["heavy", "light"])
@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_a_heavy_body_sinks_and_a_light_one_rises_at_terminal_speed(excess, integrator):
    """(m - rho V) g = rho C_d A w^2 / 2, approached as tanh(t / tau) with tau = (m + a) / (k w)."""
    mass, added = 12.0, 20.0
    fields = STRIPS
    model = free_body(
        added_mass=np.diag([1.0, added, added, 0.1, 3.0, 3.0]),
        rigid=Rigid(mass=mass, centre=np.array([0.0, 0.0, 0.03])),
        volume=(mass - excess) / DENSITY,
        fields=fields,
        gravity=GRAVITY,
        integrator=integrator,
    )
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6), position=[0, 0, 50])
    drag = 0.5 * DENSITY * CROSS_FLOW * 4 * AREA
    terminal = np.sqrt(abs(excess) * GRAVITY / drag)
    tau = (mass + added) / (drag * terminal)
    mujoco.mj_step(model, data, round(tau / 0.01))
    speed = np.sign(excess) * motion(model, data)[2][2]
    # First-order integrators are half a step, 0.005 s of tau = 1.5 s, early.
    assert speed == pytest.approx(terminal * np.tanh(data.time / tau), rel=1e-8 if integrator == "RK4" else 3e-3)
    mujoco.mj_step(model, data, round(15 * tau / 0.01))
    position, rotation, nu = motion(model, data)
    assert nu[2] == pytest.approx(np.sign(excess) * terminal, rel=1e-10)  # the fixed point knows no step
    assert np.sign(position[2] - 50.0) == np.sign(excess)
    assert rotation == pytest.approx(np.eye(3), abs=1e-12)  # symmetric: it falls level


def test_remus100_sinks_in_light_water_and_rises_in_dense_water():
    rises = []
    for density in (1015.0, 1037.0):
        model = remus100(density=density)
        data = mujoco.MjData(model)
        set_motion(model, data, np.zeros(6), position=[0, 0, 20])
        mujoco.mj_step(model, data, 1000)
        rises.append(20.0 - motion(model, data)[0][2])
    assert rises[0] < -0.5
    assert rises[1] > 0.5


@pytest.mark.parametrize("rpm", [500, 1000, 1525])
def test_terminal_surge_speed_is_where_thrust_meets_drag(rpm):
    """(1 - t) rho D^4 (K_0 n^2 + K_1 (1 - w) n u / D) = X_uu u^2 + 8 fins of C_D rho A u^2 / 2."""
    n, D, w, t = rpm / 60.0, 0.14, 0.056, 0.1
    drag = 5.84 + 8 * 0.5 * DENSITY * 0.00665 * 0.01
    scale = (1 - t) * DENSITY * D**4
    positive = np.roots([drag, scale * 0.4174 * (1 - w) * n / D, -scale * 0.4566 * n**2])
    speed = positive[positive > 0][0]

    model = remus100()
    data = mujoco.MjData(model)
    command(data, rpm=rpm)
    set_motion(model, data, [1.0, 0, 0, 0, 0, 0], position=[0, 0, 20])
    mujoco.mj_step(model, data, 6000)
    # The propeller's torque slows its velocity servo by Q / kv: n is what the shaft does, not what was asked.
    assert data.joint("shaft").qvel[0] == pytest.approx(rpm * RPM, rel=2e-3)
    assert motion(model, data)[2][0] == pytest.approx(speed, rel=2e-3)
