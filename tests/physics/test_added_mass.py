"""Added mass is inertia: F / (m + a) along and about every axis, for any attitude, mounting and ratio a / m."""

import mujoco
import numpy as np
import pytest
from bodies import TURN6, WHEEL, Rigid, acceleration, coriolis, dense, free_body, remus100, set_motion
from scipy.spatial.transform import Rotation

from auvsim.physics import hydrodynamics

RIGID = Rigid()
ATTITUDE = Rotation.from_euler("ZYX", (0.8, -0.4, 1.1)).as_matrix()
MOUNTED = np.array([0.2, -0.1, 0.3]), Rotation.from_euler("ZYX", (1.0, 0.4, -0.6)).as_matrix()
ROUNDING = 1e-10  # an exact solve of a 6 x 6 system of condition 1e3, in double precision


def push(model, data, force):
    """Applies a force and moment (6,) at the hull's origin, in its axes, and returns its acceleration (6,)."""
    hull = data.body("hull")
    R = hull.xmat.reshape(3, 3)
    wrench = TURN6 @ force
    data.qfrc_applied[:] = 0.0
    mujoco.mj_applyFT(model, data, R @ wrench[:3], R @ wrench[3:], hull.xpos, hull.id, data.qfrc_applied)
    mujoco.mj_forward(model, data)
    return acceleration(model, data)


@pytest.mark.parametrize("place", [None, MOUNTED], ids=["joint on the hull", "hull mounted askew"])
@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0, 100.0])
def test_a_force_along_or_about_each_axis_meets_the_summed_inertia(ratio, place):
    added = dense(1, ratio * RIGID.mass, ratio)
    model = free_body(added_mass=added, rigid=RIGID, place=place)
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6), ATTITUDE)
    for axis in range(6):
        force = 10.0 * np.eye(6)[axis]
        expected = np.linalg.solve(RIGID.matrix + added, force)
        assert push(model, data, force) == pytest.approx(expected, abs=ROUNDING)
        without = np.linalg.solve(RIGID.matrix, force)
        assert np.abs(without - expected).max() > 0.01 * np.abs(without).max()  # what is tested is no small thing


def test_diagonal_added_mass_divides_each_force_by_its_own_sum():
    mass, added = 10.0, np.diag([1.0, 20.0, 30.0, 0.5, 2.0, 3.0])
    inertia = np.array([0.5, 1.0, 1.5])
    rigid = Rigid(mass=mass, centre=np.zeros(3), inertia=np.diag(inertia))
    model = free_body(added_mass=added, rigid=rigid, inside=WHEEL)
    data = mujoco.MjData(model)
    set_motion(model, data, np.zeros(6))
    # The wheel's 0.5 kg are carried along; about its axle it is left behind, about the others it is turned.
    total = np.array([mass + 0.5] * 3 + [*(inertia[:2] + 1e-3), inertia[2]]) + added.diagonal()
    for axis in range(6):
        assert push(model, data, np.eye(6)[axis]) == pytest.approx(np.eye(6)[axis] / total[axis], abs=ROUNDING)


@pytest.mark.parametrize("place", [None, MOUNTED], ids=["joint on the hull", "hull mounted askew"])
def test_acceleration_of_any_motion_is_kirchhoffs(place):
    """All velocity terms at once: no step size, hence no tolerance but rounding."""
    random = np.random.default_rng(5)
    for seed in range(20):
        added = dense(seed, 20.0, 2.0)
        model = free_body(added_mass=added, rigid=RIGID, place=place)
        data = mujoco.MjData(model)
        nu = random.uniform(-2.0, 2.0, 6)
        set_motion(model, data, nu, Rotation.random(rng=random).as_matrix(), random.uniform(-50.0, 50.0, 3))
        total = RIGID.matrix + added
        assert acceleration(model, data) == pytest.approx(np.linalg.solve(total, -coriolis(total, nu)), abs=ROUNDING)


def test_munk_moment_turns_a_drifting_body_broadside():
    """N = -(A22 - A11) u v: bow to port when the body drifts to starboard. The published remus100 leaves it out."""
    added = np.diag([2.0, 30.0, 25.0, 0.1, 4.0, 5.0])
    model = free_body(added_mass=added, rigid=RIGID)
    data = mujoco.MjData(model)
    for u, v, w in ((1.5, 0.2, 0.0), (1.5, -0.2, 0.0), (-1.5, 0.2, 0.0), (1.5, 0.0, 0.3), (0.4, 0.5, 0.6)):
        set_motion(model, data, [u, v, w, 0, 0, 0])
        moment = TURN6[3:, 3:] @ data.qfrc_passive[3:6]
        munk = [-(25.0 - 30.0) * v * w, -(2.0 - 25.0) * w * u, -(30.0 - 2.0) * u * v]
        assert moment == pytest.approx(munk, abs=1e-12)  # a handful of products
    set_motion(model, data, [1.5, 0.2, 0, 0, 0, 0])
    assert data.qfrc_passive[5] > 0.0  # MuJoCo's z is up: the bow goes to port, the drift grows
    assert np.abs(data.qfrc_passive[:3]).max() == 0.0  # and no force: d'Alembert's paradox


@pytest.mark.parametrize("attitude", [np.eye(3), ATTITUDE], ids=["level", "tilted"])
def test_remus100_gains_just_its_added_mass(attitude):
    """The joint-space inertia of the whole tree grows by J' M_A J, and only at the base."""
    model = remus100(equip=False)
    data = mujoco.MjData(model)
    dry, wet = np.zeros((model.nv, model.nv)), np.zeros((model.nv, model.nv))
    set_motion(model, data, np.zeros(6), attitude)
    mujoco.mj_fullM(model, data, dry)
    hydrodynamics.equip(model)
    set_motion(model, data, np.zeros(6), attitude)
    mujoco.mj_fullM(model, data, wet)
    R = np.kron(np.diag([1.0, 0.0]), data.body("hull").xmat.reshape(3, 3)) + np.diag([0.0] * 3 + [1.0] * 3)
    expected = np.zeros_like(dry)
    expected[:6, :6] = R @ np.diag([0.839, 29.44, 29.44, 0.0336, 3.426, 3.426]) @ R.T
    assert wet - dry == pytest.approx(expected, abs=1e-12 * 60)  # rounding of sums of about 60 kg
