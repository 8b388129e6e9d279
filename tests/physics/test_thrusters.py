"""Thrusters, fixed and steerable: curve, dead band, inflow, lag, place, and what is refused."""

import mujoco
import numpy as np
import pytest
from bodies import TURN, WHEEL, Rigid, body_force, free_body, set_motion, set_water
from scipy.spatial.transform import Rotation

from auvsim.base.errors import InputError
from auvsim.physics import water_slot

# Blue Robotics' T200 at 16 V by its data sheet: 5.25 and 4.1 kgf; 76 mm; no thrust within some 28 us of 400 us.
T200 = {"thrust": [51.5, 40.2], "size": 0.076, "dead_band": 0.07, "free_speed": [4.0, 3.0], "reaction": 0.02}
PLACE, TURNED = np.array([0.2, -0.15, 0.05]), Rotation.from_euler("ZYX", [0.6, -0.3, 0.2])
LAG = 0.15


def boat(numbers=None, *, joint="", dynamics='dyntype="filterexact" dynprm="0.15"', actuator=None, geom="", **more):
    """A hull with one thruster at a place and attitude (forward-starboard-down)."""
    x, y, z, w = Rotation.from_matrix(TURN @ TURNED.as_matrix() @ TURN).as_quat()
    place = " ".join(map(repr, (TURN @ PLACE).tolist()))
    inside = WHEEL + (
        f'<body name="jet" pos="{place}" quat="{w} {x} {y} {z}">{joint}<site name="jet"/>'
        '<inertial pos="0 0 0" mass="1e-4" diaginertia="1e-7 1e-7 1e-7"/></body>' + geom
    )
    drive = f'<general name="jet" site="jet" gear="1 0 0 0 0 0" ctrlrange="-1 1" gainprm="0" {dynamics}/>'
    return free_body(
        added_mass=np.diag([10.0, 20.0, 20.0, 1.0, 2.0, 2.0]),
        rigid=Rigid(),
        volume=0.01,
        fields={f"jet_{name}": value for name, value in (T200 if numbers is None else numbers).items()},
        inside=inside,
        outside=f"<actuator>{drive if actuator is None else actuator}</actuator>",
        **more,
    )


def push(command, velocity=(0, 0, 0), model=None, **changes):
    """Force and moment (6,) of the thruster on the hull, which moves at `velocity` in the thruster's axes."""
    model = boat(T200 | changes) if model is None else model
    forces = []
    for c in (command, 0.0):
        data = mujoco.MjData(model)
        data.act[:] = c
        set_motion(model, data, [*TURNED.apply(velocity), 0, 0, 0])
        forces.append(body_force(model, data))
    return forces[0] - forces[1]


def thrust(command, velocity=(0, 0, 0), **changes):
    """Thrust along the thruster's axis [N]."""
    return TURNED.inv().apply(push(command, velocity, **changes)[:3])[0]


def test_bollard_curve():
    """Squares of what is beyond the dead band, to the data sheet's thrust ahead and astern; beyond full no more."""
    assert thrust(1.0) == pytest.approx(51.5)
    assert thrust(-1.0) == pytest.approx(-40.2)
    assert thrust(1.3) == pytest.approx(51.5)
    for command in (0.2, 0.6):
        rate = (command - 0.07) / 0.93
        assert thrust(command) == pytest.approx(51.5 * rate**2)
        assert thrust(-command) == pytest.approx(-40.2 * rate**2)
    for command in (0.07, 0.03, -0.05, -0.07, 0.0):
        assert thrust(command) == 0.0
    assert thrust(0.03, dead_band=0.0) == pytest.approx(51.5 * 0.03**2)


def test_it_acts_where_and_whither_it_points_and_twists_back():
    found = push(1.0)
    force = TURNED.apply([51.5, 0.0, 0.0])
    assert found[:3] == pytest.approx(force, abs=1e-9)
    assert found[3:] == pytest.approx(np.cross(PLACE, force) - 0.02 * force, abs=1e-9)
    assert push(1.0, reaction=-0.02)[3:] == pytest.approx(np.cross(PLACE, force) + 0.02 * force, abs=1e-9)


def test_inflow_takes_thrust_and_flow_from_behind_none():
    """Bilinear: rate^2 - rate v / v_0, astern with a v_0 of its own; v is through the water, not over ground."""
    rate = 0.53 / 0.93
    assert thrust(1.0, (4.0, 0, 0)) == pytest.approx(0.0, abs=1e-9)
    assert thrust(0.6, (1.0, 0, 0)) == pytest.approx(51.5 * (rate**2 - rate / 4.0))
    assert thrust(0.6, (-1.0, 0, 0)) == pytest.approx(51.5 * rate**2)
    assert thrust(-0.6, (-1.0, 0, 0)) == pytest.approx(-40.2 * (rate**2 - rate / 3.0))
    assert thrust(-0.6, (1.0, 0, 0)) == pytest.approx(-40.2 * rate**2)
    assert thrust(1.0, (2.0, 0, 0), free_speed=[0.0, 0.0]) == pytest.approx(51.5)
    model, forces = boat(), []
    for current, speed in ((np.zeros(3), 1.0), (TURNED.apply([0.7, 0.0, 0.0]), 1.7)):
        for command in (0.6, 0.0):
            data = mujoco.MjData(model)
            set_water(data, current)
            data.act[:] = command
            set_motion(model, data, [*TURNED.apply([speed, 0, 0]), 0, 0, 0])
            forces.append(body_force(model, data))
    assert forces[0] - forces[1] == pytest.approx(forces[2] - forces[3], abs=1e-9)


def test_a_tunnel_loses_thrust_to_the_flow_across_it():
    for across in ((0, 1.2, 0), (0, 0, -1.2), (0.0, 0.72, 0.96)):
        assert thrust(1.0, across, cross_flow_loss=0.35) == pytest.approx(51.5 * np.exp(-0.35 * 1.44))
    assert thrust(1.0, (0, 1.2, 0)) == pytest.approx(51.5)


def test_command_lags_by_the_actuators_filter():
    """63 % of the step after the time constant, exactly; without a filter the command acts at once."""
    model = boat(integrator="implicitfast")
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6))
    data.ctrl[:] = 0.8
    mujoco.mj_step(model, data, round(LAG / model.opt.timestep))
    assert data.act[0] == pytest.approx(0.8 * (1.0 - np.exp(-1.0)), rel=1e-9)
    direct = boat(dynamics="")
    data = mujoco.MjData(direct)
    assert direct.na == 0
    forces = []
    for command in (0.8, 0.0):
        data.ctrl[:] = command
        set_motion(direct, data, np.zeros(6))
        forces.append(body_force(direct, data))
    assert np.linalg.norm((forces[0] - forces[1])[:3]) == pytest.approx(51.5 * (0.73 / 0.93) ** 2)


def test_a_steerable_thruster_pushes_where_it_is_turned():
    """A hinge about its z axis (down), 0.5 rad to starboard."""
    model = boat(joint='<joint name="azimuth" axis="0 0 -1" damping="1"/>')
    forces = []
    for command in (1.0, 0.0):
        data = mujoco.MjData(model)
        data.act[:] = command
        data.joint("azimuth").qpos[0] = 0.5
        set_motion(model, data, np.zeros(6))
        forces.append(body_force(model, data))
    expected = TURNED.apply(51.5 * np.array([np.cos(0.5), np.sin(0.5), 0.0]))
    assert (forces[0] - forces[1])[:3] == pytest.approx(expected, abs=1e-9)


def test_half_out_of_the_water_it_pushes_half():
    """Its middle in the surface, which the hull's own strips do not care for here."""
    model = boat()
    forces = []
    for command in (1.0, 0.0):
        data = mujoco.MjData(model)
        data.userdata[water_slot.SURFACE] = 1.0
        data.act[:] = command
        set_motion(model, data, np.zeros(6), position=[0, 0, -PLACE[2]])
        forces.append(body_force(model, data))
    assert np.linalg.norm((forces[0] - forces[1])[:3]) == pytest.approx(0.5 * 51.5)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
def test_impulse_of_a_thruster_is_momentum_won(integrator):
    """A lone thruster through the middle drives a hull without drag: (m + a) u is the integral of its thrust."""
    model = boat(T200 | {"free_speed": [0.0, 0.0], "reaction": 0.0}, integrator=integrator, timestep=0.002)
    jet = model.body("jet").id
    model.body_pos[jet], model.body_quat[jet] = 0.0, [1, 0, 0, 0]
    model.body_ipos[model.body("hull").id] = 0.0
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6))
    data.ctrl[:] = 0.5
    mujoco.mj_step(model, data, 1000)
    times = np.linspace(0.0, 2.0, 100001)
    rate = np.maximum(0.5 * (1.0 - np.exp(-times / LAG)) - 0.07, 0.0) / 0.93
    impulse = np.trapezoid(51.5 * rate**2, times)
    mass = model.body_subtreemass[model.body("hull").id] + 10.0
    # First order in the step of 2 ms, 1 % of the lag; the lag itself delays it by 0.15 s of 2 s.
    assert data.qvel[0] == pytest.approx(impulse / mass, rel=3e-3)
    assert np.abs(data.qvel[1:6]).max() < 1e-12


def refusal(*arguments, **keywords):
    with pytest.raises(InputError) as caught:
        boat(*arguments, **keywords)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_is_refused():
    assert refusal({**T200, "thrust": [50.0]}) == "'jet_thrust' has 1 numbers instead of 2"
    assert refusal({**T200, "thrust": [50.0, -40.0]}).startswith("'jet_thrust' is negative: -40")
    assert refusal({**T200, "dead_band": 1.0}) == "'jet_dead_band' is 1; full command is 1"
    assert refusal({"thrust": [1.0, 1.0]}) == "thruster 'jet' lacks the numeric 'jet_size'"
    assert refusal(actuator="").startswith("thruster 'jet' needs an actuator of its name")
    strong = '<general name="jet" site="jet" gear="1 0 0 0 0 0" gainprm="3"/>'
    assert refusal(actuator=strong).startswith("actuator 'jet' must have gainprm and biasprm 0")
    geom = '<geom type="box" size="0.3 0.02 0.3" pos="0 0 0" mass="0"/>'
    assert refusal(geom=geom).startswith("thruster 'jet' is 0.13 m outside the hull")
    boat(geom=geom.replace("0.02", "0.1"))
