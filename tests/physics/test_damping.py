"""Damping of the hull: closed forms, and still water never gives energy to a body."""

import mujoco
import numpy as np
import pytest
from bodies import DENSITY, body_force, command, dense, free_body, remus100, set_motion, set_water

NONE = np.zeros((6, 6))
SPEEDS = np.array([3.0, 1.5, 1.5, 2.0, 1.5, 1.5])  # more than the vehicle ever does


def hull(**fields):
    model = free_body(added_mass=NONE, fields={f"hull_{name}": value for name, value in fields.items()})
    return model, mujoco.MjData(model)


def test_linear_and_quadratic_damping_are_sname():
    """tau = -D nu - D_n |nu| nu, off-diagonals too (N_v, N_vv), in forward-starboard-down."""
    random = np.random.default_rng(0)
    linear, quadratic = dense(3, 10.0, 2.0), random.uniform(-1.0, 1.0, (6, 6)) + 5.0 * np.eye(6)
    model, data = hull(linear_damping=linear, quadratic_damping=quadratic)
    for _ in range(20):
        nu = random.uniform(-1.0, 1.0, 6) * SPEEDS
        set_motion(model, data, nu)
        expected = -linear @ nu - quadratic @ (np.abs(nu) * nu)
        assert body_force(model, data) == pytest.approx(expected, abs=1e-11)  # rounding


def test_cross_flow_drag_is_the_strip_sum():
    """Faltinsen (1990), sec. 6: Y = -rho C_d / 2 sum A U v, both transverse velocities in one resultant U."""
    xs, areas = np.array([-0.7, -0.2, 0.3, 0.6]), np.array([0.02, 0.04, 0.03, 0.01])
    model, data = hull(cross_flow_drag=1.1, strip_x=xs, strip_area=areas)
    random = np.random.default_rng(1)
    for _ in range(20):
        nu = random.uniform(-1.0, 1.0, 6)
        set_motion(model, data, nu)
        v, w = nu[1] + xs * nu[5], nu[2] - xs * nu[4]
        k = 0.5 * DENSITY * 1.1 * areas * np.hypot(v, w)
        expected = [0, -np.sum(k * v), -np.sum(k * w), 0, np.sum(xs * k * w), -np.sum(xs * k * v)]
        assert body_force(model, data) == pytest.approx(expected, abs=1e-11)  # rounding


@pytest.mark.parametrize("u", [1.5, -1.5])
def test_body_lift_acts_behind_the_middle_whichever_way_the_flow_comes(u):
    """Y = -L |u| v at x_L, N = x_L Y; astern the separating end is the bow."""
    model, data = hull(body_lift=28.6, body_lift_x=-0.156)
    set_motion(model, data, [u, 0.2, -0.1, 0, 0, 0])
    Y, Z, x = -28.6 * abs(u) * 0.2, 28.6 * abs(u) * 0.1, -0.156 * np.sign(u)
    assert body_force(model, data) == pytest.approx([0, Y, Z, 0, -x * Z, x * Y], abs=1e-12)
    set_motion(model, data, [u, 0.2, 0, 0, 0, 0])
    assert np.sign(body_force(model, data)[5]) == np.sign(u)  # weathercock: the bow turns into the drift when ahead


def test_still_water_takes_energy_from_a_hull():
    model = remus100()
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0.0
    random = np.random.default_rng(2)
    powers = []
    for _ in range(2000):
        command(data, *random.uniform(-0.26, 0.26, 2))
        set_motion(model, data, random.uniform(-1.0, 1.0, 6) * SPEEDS * 10.0 ** random.uniform(-2, 0))
        # Fins at rest in their hinges and the shaft locked: all the power is the hull's. The Coriolis part has none.
        powers.append(data.qfrc_passive @ data.qvel)
    assert max(powers) < 0.0


def test_still_water_takes_energy_through_each_damping_term():
    terms = {
        "linear": {"linear_damping": dense(3, 10.0, 2.0)},
        "quadratic": {"quadratic_damping": np.diag([5.0, 80.0, 80.0, 0.1, 5.0, 5.0])},
        "strips": {"cross_flow_drag": 1.1, "strip_x": [-0.6, -0.1, 0.5], "strip_area": [0.03, 0.05, 0.02]},
    }
    random = np.random.default_rng(3)
    for name, fields in terms.items():
        model, data = hull(**fields)
        for _ in range(300):
            nu = random.uniform(-1.0, 1.0, 6) * SPEEDS
            set_motion(model, data, nu)
            assert body_force(model, data) @ nu < 0.0, name


def test_all_forces_vanish_when_the_hull_moves_with_the_water():
    fields = {"linear_damping": dense(3, 10.0, 2.0), "quadratic_damping": np.diag([5.0, 80, 80, 0.1, 5, 5])}
    model, data = hull(**fields, body_lift=28.6, body_lift_x=-0.156)
    set_water(data, velocity=(0.4, -0.3, 0.2))
    set_motion(model, data, [0.4, -0.3, 0.2, 0, 0, 0])
    assert np.abs(body_force(model, data)).max() < 1e-14  # rounding
