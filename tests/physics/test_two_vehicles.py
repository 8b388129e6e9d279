"""Two vehicles in one model: each has its own coefficients and feels its own water."""

import mujoco
import numpy as np
import pytest
from dm_control import mjcf

from auvsim.physics import hydrodynamics
from auvsim.physics.fluid import WATER
from auvsim.physics.forces import RECORD
from auvsim.vehicles import library


def fleet() -> tuple[mujoco.MjModel, dict[str, int]]:
    """Two REMUS-100 200 m apart in one scene, and their water slots."""
    root = mjcf.RootElement(model="fleet")
    root.compiler.angle = "radian"
    root.size.nuser_body, root.size.nuserdata = RECORD, 2 * WATER
    root.option.timestep, root.option.integrator = 0.01, "implicitfast"
    for name, east in (("first", 0.0), ("second", 200.0)):
        vehicle = library.vehicle("remus100").root
        vehicle.model, vehicle.size.nuserdata = name, None
        frame = root.worldbody.attach(vehicle)
        frame.add("freejoint")
        frame.pos = (0.0, -east, -20.0)
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    return model, hydrodynamics.equip(model)


def test_each_drifts_with_its_own_current_as_if_alone():
    model, slots = fleet()
    assert sorted(slots.values()) == [0, WATER]
    currents = {"first/": np.array([0.3, 0.0, 0.0]), "second/": np.array([-0.1, 0.2, 0.0])}
    data = mujoco.MjData(model)
    for name, velocity in currents.items():
        data.userdata[slots[name] + 4 : slots[name] + 7] = velocity
    alone = mujoco.MjData(model)
    for name, velocity in currents.items():
        data.joint(name).qvel[:3] = velocity  # at rest in its own water
    mujoco.mj_step(model, data, 500)
    mujoco.mj_step(model, alone, 500)
    for name, velocity in currents.items():
        drift = data.joint(name).qpos[:3] - alone.joint(name).qpos[:3]
        # Galilean invariance: what a steady current adds is its own drift, to rounding over 500 steps.
        np.testing.assert_allclose(drift, 5.0 * velocity, atol=1e-9)
        np.testing.assert_allclose(data.joint(name).qpos[3:7], alone.joint(name).qpos[3:7], atol=1e-9)


def test_too_little_user_data_is_refused():
    root = mjcf.RootElement(model="crowd")
    root.size.nuser_body, root.size.nuserdata = RECORD, WATER
    for name in ("first", "second"):
        vehicle = library.vehicle("remus100").root
        vehicle.model = name
        root.worldbody.attach(vehicle).add("freejoint")
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    with pytest.raises(hydrodynamics.InputError, match=f"nuserdata='{2 * WATER}'"):
        hydrodynamics.equip(model)
