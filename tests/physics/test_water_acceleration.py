"""Water that accelerates pushes: the undisturbed pressure gradient and added mass (Auton, Hunt & Prud'homme 1988)."""

import mujoco
import numpy as np
import pytest
from bodies import DENSITY, WHEEL, Rigid, acceleration, body_force, free_body, motion, set_motion, set_water
from scipy.spatial.transform import Rotation

MASS, ADDED = 12.5, 20.0  # with the wheel
SPHERE = np.diag([ADDED, ADDED, ADDED, 0.5, 0.5, 0.5])


def ball(volume, integrator="RK4", timestep=0.01, added=SPHERE):
    return free_body(
        added_mass=added,
        rigid=Rigid(mass=MASS - 0.5, centre=np.zeros(3)),
        volume=volume,
        inside=WHEEL,
        integrator=integrator,
        timestep=timestep,
    )


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0], ids=["heavy", "neutral", "light"])
def test_force_of_accelerating_water_on_a_body_at_rest(ratio):
    """(m + a) dv/dt = (rho V + a) dv_c/dt: a light body runs ahead of the water, a heavy one falls behind."""
    model = ball(ratio * MASS / DENSITY)
    data = mujoco.MjData(model)
    a = np.array([0.3, -0.2, 0.1])
    set_water(data, derivative=a)
    set_motion(model, data, np.zeros(6))
    expected = (ratio * MASS + ADDED) / (MASS + ADDED) * a
    assert acceleration(model, data)[:3] == pytest.approx(expected, abs=1e-14)  # rounding


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0], ids=["heavy", "neutral", "light"])
def test_straining_flow_pushes_a_body_by_its_convective_acceleration(ratio):
    """In the steady flow v_c = G x, G = diag(g, -g, 0), the water at x accelerates by G^2 x though dv_c/dt is zero.

    Released at rest, x'' = k g^2 x with k = (rho V + a) / (m + a), so x = x0 cosh(sqrt(k) g t), and the same across it.
    A peer that takes only dv_c/dt finds no force at all here.
    """
    g, seconds = 0.4, 5.0
    model = ball(ratio * MASS / DENSITY)
    data = mujoco.MjData(model)
    set_water(data, gradient=np.diag([g, -g, 0.0]))
    start = np.array([2.0, -3.0, 1.0])
    set_motion(model, data, np.zeros(6), position=start)
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    growth = np.cosh(np.sqrt((ratio * MASS + ADDED) / (MASS + ADDED)) * g * seconds)
    # RK4 at (g h)^4 = 3e-10 over the whole stretch of 4 to 9 times.
    assert motion(model, data)[0] == pytest.approx(start * [growth, growth, 1.0], abs=1e-8)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
def test_a_neutral_body_follows_its_streamline(integrator):
    """Released with the water's velocity it stays a particle of the water: x = exp(G t) x0, here a hyperbola."""
    g, seconds = 0.4, 5.0
    errors = []
    for step in (0.01, 0.005):
        model = ball(MASS / DENSITY, integrator, step)
        data = mujoco.MjData(model)
        set_water(data, gradient=np.diag([g, -g, 0.0]))
        start = np.array([2.0, -3.0, 1.0])
        set_motion(model, data, [g * start[0], -g * start[1], 0, 0, 0, 0], position=start)
        mujoco.mj_step(model, data, round(seconds / step))
        expected = start * np.exp([g * seconds, -g * seconds, 0.0])
        errors.append(np.abs(motion(model, data)[0] - expected).max())
    if integrator == "RK4":
        assert errors[1] < 1e-8  # fourth order: (g h)^4
    else:
        assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.05)  # first order, and to the same answer


def test_rotating_water_holds_a_neutral_body_on_its_circle():
    """In a vortex v_c = Omega x r the pressure gradient pushes inwards, rho V Omega^2 r, and so does added mass."""
    rate = 0.3
    model = ball(MASS / DENSITY)
    data = mujoco.MjData(model)
    set_water(data, gradient=np.array([[0.0, -rate, 0.0], [rate, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    set_motion(model, data, [0.0, rate * 2.0, 0, 0, 0, 0], position=[2.0, 0.0, 5.0])
    seconds = 2.0 * np.pi / rate
    steps = round(seconds / model.opt.timestep)
    mujoco.mj_step(model, data, steps)
    angle = rate * steps * model.opt.timestep
    expected = [2.0 * np.cos(angle), 2.0 * np.sin(angle), 5.0]
    assert motion(model, data)[0] == pytest.approx(expected, abs=1e-8)  # RK4 at (rate h)^4 over one turn


def test_shear_turns_a_hull_by_its_cross_flow():
    """East flow that grows northward, v_c = s x: a hull that turns with it has no transverse flow anywhere."""
    s = 0.2
    fields = {"hull_cross_flow_drag": 1.2, "hull_strip_x": [-0.6, -0.2, 0.2, 0.6], "hull_strip_area": [0.04] * 4}
    model = free_body(added_mass=np.diag([1.0, 20.0, 20.0, 0.1, 3.0, 3.0]), fields=fields)
    data = mujoco.MjData(model)
    gradient = np.zeros((3, 3))
    gradient[1, 0] = s
    set_water(data, gradient=gradient)
    set_motion(model, data, [0, 0, 0, 0, 0, s])
    # The pitching, rolling and Coriolis terms of the added mass are zero at v_r = 0, so nothing is left of yaw and
    # sway.
    assert data.qfrc_passive[5] == pytest.approx(0.0, abs=1e-14)
    set_motion(model, data, np.zeros(6))
    strips = np.array([-0.6, -0.2, 0.2, 0.6])
    moment = 0.5 * 1026.0 * 1.2 * 0.04 * np.sum(strips * np.abs(s * strips) * s * strips)
    assert -data.qfrc_passive[5] == pytest.approx(moment, rel=1e-12)  # to starboard, with the water


def test_cross_flow_in_any_gradient_is_the_strip_sum_of_local_velocities():
    """Each strip sees its own water, v_c(x) = G R x along a hull of any attitude, and drags by the resultant there."""
    random = np.random.default_rng(4)
    xs, area = np.array([-0.6, -0.2, 0.2, 0.6]), 0.04
    fields = {"hull_cross_flow_drag": 1.2, "hull_strip_x": xs, "hull_strip_area": [area] * 4}
    model = free_body(added_mass=np.zeros((6, 6)), fields=fields)
    data = mujoco.MjData(model)
    for _ in range(10):
        G, nu = random.uniform(-0.3, 0.3, (3, 3)), random.uniform(-0.5, 0.5, 6)
        R = Rotation.random(rng=random).as_matrix()
        set_water(data, gradient=G)
        set_motion(model, data, nu, R)
        along = xs[:, None] * np.array([1.0, 0.0, 0.0])
        local = nu[:3] + np.cross(nu[3:], along) - along @ (R.T @ G @ R).T
        drag = -0.5 * DENSITY * 1.2 * area * np.hypot(local[:, 1], local[:, 2])[:, None] * local * [0, 1, 1]
        expected = np.concatenate([drag.sum(axis=0), np.cross(along, drag).sum(axis=0)])
        assert body_force(model, data) == pytest.approx(expected, abs=1e-11)  # rounding
