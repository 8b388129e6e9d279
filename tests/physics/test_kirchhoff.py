"""Free motion of a body with a full added-mass matrix: Kirchhoff's equations, energy and impulse."""

import itertools

import mujoco
import numpy as np
import pytest
from bodies import Rigid, dense, free_body, motion, set_motion, solve_motion
from scipy.spatial.transform import Rotation

RIGID = Rigid()
ADDED = dense(1, 20.0, 2.0)
TOTAL = RIGID.matrix + ADDED
NU = np.array([1.0, 0.3, -0.2, 0.5, -0.6, 0.8])
ATTITUDE = Rotation.from_euler("ZYX", (0.5, -0.3, 0.7)).as_matrix()
MOUNTED = np.array([0.2, -0.1, 0.3]), Rotation.from_euler("ZYX", (1.0, 0.4, -0.6)).as_matrix()
TIMES = np.linspace(0.0, 5.0, 6)


def still(time, position, rotation, nu):
    return np.zeros(6)


def simulate(model, nu, rotation, times=TIMES):
    """Position, attitude and nu, stacked as (n, 18), at the times."""
    data = mujoco.MjData(model)
    set_motion(model, data, nu, rotation)
    states = [np.concatenate([part.ravel() for part in motion(model, data)])]
    for start, end in itertools.pairwise(times):
        mujoco.mj_step(model, data, round((end - start) / model.opt.timestep))
        states.append(np.concatenate([part.ravel() for part in motion(model, data)]))
    return np.array(states)


def reference(nu, rotation, total=TOTAL, times=TIMES):
    positions, rotations, nus = solve_motion(total, still, nu, times, rotation)
    return np.hstack([positions, rotations.reshape(-1, 9), nus])


@pytest.mark.parametrize("place", [None, MOUNTED], ids=["joint on the hull", "hull mounted askew"])
def test_tumbling_follows_kirchhoffs_equations(place):
    """MuJoCo's RK4 makes one rotation of four rates, which in a tumble is of second order, for any rigid body.

    Hence: the error falls by 4 with half the step, and what Richardson's extrapolation leaves is of third order.
    """
    expected = reference(NU, ATTITUDE)
    runs = [simulate(free_body(added_mass=ADDED, place=place, timestep=h), NU, ATTITUDE) for h in (4e-3, 2e-3, 1e-3)]
    errors = [np.abs(run - expected).max() for run in runs]
    assert errors[2] < 2e-6  # measured 6e-7; the dry body alone has 1e-7
    orders = np.log2([errors[0] / errors[1], errors[1] / errors[2]])
    assert orders == pytest.approx(2.0, abs=0.05)  # the third-order rest at these steps
    extrapolated = (4.0 * runs[2] - runs[1]) / 3.0
    assert np.abs(extrapolated - expected).max() < 1e-2 * errors[2]


@pytest.mark.parametrize("place", [None, MOUNTED], ids=["joint on the hull", "hull mounted askew"])
def test_planar_motion_follows_kirchhoffs_equations_to_rounding(place):
    """In the plane rotations commute, RK4 is of fourth order, and 1 ms leaves nothing but the reference's tolerance."""
    added = np.zeros((6, 6))
    added[np.ix_((0, 1, 5), (0, 1, 5))] = [[3.0, 1.0, -0.5], [1.0, 30.0, 2.0], [-0.5, 2.0, 5.0]]
    added[2, 2], added[3, 3], added[4, 4] = 30.0, 0.1, 4.0
    rigid = Rigid(centre=np.array([0.03, -0.02, 0.0]), inertia=np.diag([0.4, 1.1, 1.3]))
    nu = [1.0, 0.3, 0, 0, 0, 0.8]
    expected = reference(nu, np.eye(3), rigid.matrix + added)
    found = simulate(free_body(added_mass=added, rigid=rigid, place=place, timestep=1e-3), nu, np.eye(3))
    assert found == pytest.approx(expected, abs=5e-10)  # the reference's rtol of 1e-10; measured 7e-11


@pytest.mark.parametrize("place", [None, MOUNTED], ids=["joint on the hull", "hull mounted askew"])
def test_energy_and_impulse_are_conserved(place):
    """T = nu' (M_RB + M_A) nu / 2; the impulse P and its moment H about the fixed origin (Lamb 1932, art. 119)."""

    def invariants(state):
        position, rotation, nu = state[:3], state[3:12].reshape(3, 3), state[12:]
        momentum = TOTAL @ nu
        P = rotation @ momentum[:3]
        return np.concatenate([[0.5 * nu @ momentum], P, rotation @ momentum[3:] + np.cross(position, P)])

    drifts = []
    for step in (2e-3, 1e-3):
        states = simulate(free_body(added_mass=ADDED, place=place, timestep=step), NU, ATTITUDE)
        start = invariants(states[0])
        scale = np.array([start[0], *[np.linalg.norm(start[1:4])] * 3, *[np.linalg.norm(start[4:])] * 3])
        drifts.append(max(np.abs((invariants(state) - start) / scale).max() for state in states[1:]))
    assert drifts[1] < 2e-6  # nothing but the step's error: measured 1e-6 or less, falling by 4 with the step
    assert drifts[0] / drifts[1] == pytest.approx(4.0, rel=0.15)


def test_dry_body_energy_alone_is_not_conserved():
    """The same motion exchanges energy with the water: were added mass left out, the test above would see it."""
    states = simulate(free_body(added_mass=ADDED, timestep=2e-3), NU, ATTITUDE)
    dry = np.array([0.5 * state[12:] @ RIGID.matrix @ state[12:] for state in states])
    assert np.ptp(dry) > 0.1 * dry[0]
