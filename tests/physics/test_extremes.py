"""Motion far beyond nature: forces stay finite and against it, and what is not finite is not hidden."""

import mujoco
import numpy as np
import pytest
from bodies import command, remus100, set_motion, set_water

from auvsim.physics import water_slot

WILD = np.array([30.0, 0.0, 0.0, 60.0, 60.0, 60.0])  # [m/s, rad/s]
LIMIT = 1e6  # sum of squares of velocities beyond which a world says that it diverged


def wild(timestep=0.01, integrator="implicitfast", factor=1.0):
    model = remus100(timestep=timestep, integrator=integrator)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # as the world has it
    data = mujoco.MjData(model)
    command(data, 0.2, 0.1, 1525.0)
    set_motion(model, data, factor * WILD, position=[0, 0, 50.0])
    return model, data


@pytest.mark.parametrize("factor", [1.0, -1.0, 100.0, 1e6])
def test_forces_are_finite_and_take_energy(factor):
    _, data = wild(factor=factor)
    assert np.all(np.isfinite(data.qfrc_passive))
    assert np.all(np.isfinite(data.qacc))
    assert data.qfrc_passive[:6] @ data.qvel[:6] < 0.0


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "implicit", "RK4"])
def test_a_step_too_long_for_it_ends_beyond_the_limit_or_as_nan_and_a_short_one_slows_down(integrator):
    """At these rates drag is too stiff for 10 ms with any integrator, and not for 2 ms."""
    model, data = wild(integrator=integrator)
    seen = False
    for _ in range(10):
        mujoco.mj_step(model, data)
        seen = seen or not data.qvel @ data.qvel < LIMIT  # NaN is beyond it too
    assert seen
    model, data = wild(0.002, integrator)
    for _ in range(300):
        mujoco.mj_step(model, data)
        assert data.qvel[:6] @ data.qvel[:6] < 3.0 * WILD @ WILD
    assert np.abs(data.qvel[:3]).max() < 10.0


@pytest.mark.parametrize("place", [i for i in range(water_slot.WATER) if i != water_slot.SURFACE])
def test_water_that_is_not_finite_shows_in_the_acceleration(place):
    """Each number of the slot, with a surface in reach."""
    model, data = wild(factor=0.01)
    set_water(data)
    data.userdata[water_slot.SURFACE] = 1.0
    data.userdata[place] = np.nan
    set_motion(model, data, 0.01 * WILD, position=[0, 0, 0.02])
    assert not np.isfinite(data.qacc @ data.qacc)


def test_a_velocity_that_is_not_finite_shows_in_the_acceleration():
    model, data = wild(factor=0.01)
    for dof in range(model.nv):
        set_motion(model, data, 0.01 * WILD, position=[0, 0, 20.0])
        data.qvel[dof] = np.nan
        mujoco.mj_forward(model, data)
        assert not np.isfinite(data.qacc @ data.qacc)
