"""Contact and constraints act on the summed inertia: a wall bounce is that of the rigid body which has it.

Isotropic added mass (a along, b about every axis, as a sphere's) is one that a dry rigid body can have as well: mass m
+ a and inertia I + b. Its Kirchhoff terms are then that body's gyroscopic terms, so the two must move alike in every
respect.
"""

import mujoco
import numpy as np
import pytest
from bodies import DENSITY, WHEEL, Rigid, free_body, motion, set_motion
from scipy.spatial.transform import Rotation

from auvsim.physics import hydrodynamics

MASS, ADDED, TURNING = 12.0, 30.0, 0.4
INERTIA = np.diag([0.3, 0.5, 0.6])
ISOTROPIC = np.diag([ADDED] * 3 + [TURNING] * 3)
ATTITUDE = Rotation.from_euler("ZYX", (0.3, -0.2, 0.4)).as_matrix()
NU = [0.8, -0.4, 1.0, 0.5, 1.0, -0.7]  # towards the floor 0.4 m below
BOX = '<geom type="box" size="0.3 0.1 0.12" mass="0"/>'
FLOOR = '<geom type="plane" size="5 5 1" pos="0 0 -0.4"/>'


def pair(*, option="", geom=BOX, world=FLOOR, outside="", centre=(0.0, 0.0, 0.0), inside=WHEEL, **settings):
    """The hydrodynamic body and the dry one with the summed inertia."""
    centre = np.array(centre)
    wet = Rigid(mass=MASS, centre=centre, inertia=INERTIA)
    total = wet.matrix + ISOTROPIC
    mass = MASS + ADDED
    middle = MASS / mass * centre
    shifted = np.eye(3) * (middle @ middle) - np.outer(middle, middle)
    dry = Rigid(mass=mass, centre=middle, inertia=total[3:, 3:] - mass * shifted)
    common = {
        "added_mass": ISOTROPIC,
        "inside": inside + geom,
        "world": world,
        "outside": outside,
        "option": f'tolerance="0" {option}',
        "timestep": 0.002,
    } | settings
    return free_body(rigid=wet, **common), free_body(rigid=dry, equip=False, **common)


def bounce(model, seconds=2.0):
    """States (n, 18) every 0.1 s, and in how many steps there was contact."""
    data = mujoco.MjData(model)
    set_motion(model, data, NU, ATTITUDE)
    states, touched = [], 0
    for _ in range(round(seconds / 0.1)):
        for _ in range(round(0.1 / model.opt.timestep)):
            mujoco.mj_step(model, data)
            touched += data.ncon > 0
        states.append(np.concatenate([part.ravel() for part in motion(model, data)]))
    return np.array(states), touched


def rise(state):
    """Upward velocity [m/s] of a state (18,)."""
    return -(state[3:12].reshape(3, 3) @ state[12:15])[2]


# Equal up to rounding of 1e-16, which the stiffness of contact amplifies over a hundred steps: measured 5e-13. PGS
# converges linearly and with elliptic cones stops at its iteration limit, up to which it amplifies rounding more:
# measured 5e-10.
TOLERANCE = {"Newton": 1e-11, "CG": 1e-11, "PGS": 1e-8}


@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("solver", ["Newton", "CG", "PGS"])
def test_a_bounce_with_friction_is_that_of_the_summed_inertia(solver, cone, integrator):
    for condim in (1, 3, 6):
        contact = f' condim="{condim}" friction="0.4 0.01 0.001"/>'
        wet, dry = pair(
            option=f'solver="{solver}" cone="{cone}" iterations="100"',
            geom=BOX.replace("/>", contact),
            world=FLOOR.replace("/>", contact),
            integrator=integrator,
        )
        (found, touched), (expected, _) = bounce(wet), bounce(dry)
        assert touched > 10
        assert rise(found[0]) < -0.3
        assert rise(found[-1]) > 0.05
        assert found == pytest.approx(expected, abs=TOLERANCE[solver])


def test_noslip_iterations_use_the_summed_inertia_too():
    wet, dry = pair(option='noslip_iterations="5"', geom=BOX.replace("/>", ' friction="0.4 0.01 0.001"/>'))
    assert bounce(wet)[0] == pytest.approx(bounce(dry)[0], abs=TOLERANCE["Newton"])


def test_an_offset_centre_of_mass_bounces_alike_with_exact_constraint_weights():
    """Approximate constraint weights are taken at the centre of mass, where the two differ: use exact ones."""
    option = "<option><flag diagexact='enable'/></option>"
    wet, dry = pair(centre=(0.04, -0.02, 0.05), inside="", outside=option)
    (found, touched), (expected, _) = bounce(wet), bounce(dry)
    assert touched > 10
    assert found == pytest.approx(expected, abs=TOLERANCE["Newton"])


@pytest.mark.parametrize("solver", ["Newton", "CG", "PGS"])
def test_a_weld_holds_the_summed_inertia(solver):
    """Drawn to its place by a soft weld: the spring's frequency is that of m + a."""
    weld = '<equality><weld body1="hull" solref="0.2 0.3" solimp="0.5 0.9 0.01"/></equality>'
    wet, dry = pair(option=f'solver="{solver}" iterations="100"', outside=weld, world="")
    found, expected = bounce(wet)[0], bounce(dry)[0]
    assert np.ptp(found[:, :3]) > 0.04  # it swings
    assert np.abs(found[-1, 12:]).max() < 0.5 * np.abs(NU).max()  # and settles
    assert found == pytest.approx(expected, abs=TOLERANCE[solver])


def test_constraint_weights_are_those_of_the_summed_inertia_until_mj_setConst_undoes_them():
    wet, dry = pair()
    for model in (wet, dry):
        hull = model.body("hull").id
        weights = [1 / (MASS + ADDED + 0.5), np.trace(np.linalg.inv(INERTIA + np.eye(3) * (TURNING + 1e-3))) / 3]
        assert model.body_invweight0[hull, 0] == pytest.approx(weights[0], rel=1e-12)  # rounding
        # About the wheel's axle its inertia of 1e-3 stays behind: 0.1 per cent of one of three.
        assert model.body_invweight0[hull, 1] == pytest.approx(weights[1], rel=1e-3)
    assert wet.body_invweight0 == pytest.approx(dry.body_invweight0, rel=1e-12)
    assert wet.dof_invweight0 == pytest.approx(dry.dof_invweight0, rel=1e-12)

    expected = bounce(dry)[0]
    mujoco.mj_setConst(wet, mujoco.MjData(wet))
    assert np.abs(bounce(wet)[0] - expected).max() > 1e-4  # what would be wrong without them
    hydrodynamics.equip(wet, DENSITY)
    assert bounce(wet)[0] == pytest.approx(expected, abs=TOLERANCE["Newton"])
