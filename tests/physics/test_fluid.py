"""The callback itself: which bodies it touches, in which tree, from which water; a strange MuJoCo is refused."""

import os
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import AuvsimError
from auvsim.physics import fluid, hydrodynamics, mujoco_structs
from auvsim.physics.forces import RECORD
from auvsim.physics.water_slot import SURFACE

FACTOR = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 6)) + 3.0 * np.eye(6)
FIELDS = {
    "added_mass": FACTOR @ FACTOR.T,
    "linear_damping": 0.3 * FACTOR @ FACTOR.T,
    "quadratic_damping": np.diag([5.0, 50, 50, 1, 3, 3]),
    "displaced_volume": 0.009,
    "body_lift": 10.0,
    "body_lift_x": -0.2,
    "cross_flow_drag": 1.1,
    "strip_x": [-0.5, 0.0, 0.5],
    "strip_area": [0.03, 0.04, 0.03],
}
TAIL = {"area": 0.01, "lift_slope": 3.0, "stall_angle": 0.3, "drag": 0.01, "normal_drag": 1.2, "astern_lift": 0.7}
SCREW = {"diameter": 0.14, "thrust_coefficients": [0.45, -0.4], "torque_coefficients": [0.07, -0.06]}


def numerics(name):
    tables = {name: FIELDS, f"{name}_tail": TAIL, f"{name}_screw": SCREW}
    return "".join(
        f'<numeric name="{body}_{field}" data="{" ".join(map(repr, np.ravel(value).astype(float).tolist()))}"/>'
        for body, table in tables.items()
        for field, value in table.items()
    )


def boat(name):
    return (
        f'<body name="{name}"><freejoint/><inertial pos="0.01 0 -0.03" mass="10" diaginertia="0.2 1 1"/>'
        f'<body name="{name}_tail" pos="-0.6 0 0.1"><joint axis="0 0 1" damping="1" armature="0.01"/>'
        '<inertial pos="-0.01 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/></body>'
        f'<body name="{name}_screw" pos="-0.8 0 0"><joint axis="1 0 0" damping="0.1"/>'
        '<inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/></body></body>'
    )


def scene(*parts, boats=()):
    """A model of the parts, equipped if there are boats; the boats have no geoms, so nothing touches them."""
    custom = "".join(numerics(name) for name in boats)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><size nuser_body="{RECORD}" nuserdata="{2 * fluid.WATER}"/>'
        '<option integrator="implicitfast" timestep="0.005"/>'
        f"<worldbody>{''.join(parts)}</worldbody><custom>{custom}</custom></mujoco>"
    )
    slots = hydrodynamics.equip(model)
    return model, mujoco.MjData(model), slots


def start(model, data, name, slots, seed):
    """Sets one boat going in its own water."""
    random = np.random.default_rng(seed)
    joint = model.body(name).jntadr[0]
    q, v = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    quaternion = random.normal(size=4)
    data.qpos[q : q + 9] = [
        *random.normal(size=3),
        *(quaternion / np.linalg.norm(quaternion)),
        *random.uniform(-0.2, 0.2, 2),
    ]
    data.qvel[v : v + 8] = random.normal(size=8) * 0.5
    data.userdata[slots[name] : slots[name] + SURFACE] = 0.1 * random.normal(size=fluid.WATER)[:SURFACE]
    return slice(q, q + 9), slice(v, v + 8)


def test_a_boats_motion_does_not_depend_on_what_else_is_in_the_model():
    """Alone; and as second of two boats behind a swinging door and a falling ball, each with its own water."""
    model, data, slots = scene(boat("alpha"), boats=["alpha"])
    q, v = start(model, data, "alpha", slots, seed=1)
    mujoco.mj_step(model, data, 200)
    expected = data.qpos[q].copy(), data.qvel[v].copy()

    door = (
        '<body name="door" pos="9 0 0"><joint type="hinge" axis="0 1 0"/><geom size="1" mass="3" pos="0 0 -1"/></body>'
        '<body name="ball" pos="-9 0 0"><freejoint/><geom size="0.1"/></body>'
    )
    crowd, crowd_data, slots = scene(door, boat("beta"), boat("alpha"), boats=["alpha", "beta"])
    assert sorted(slots.values()) == [0, fluid.WATER]
    start(crowd, crowd_data, "beta", slots, seed=2)
    q, v = start(crowd, crowd_data, "alpha", slots, seed=1)
    mujoco.mj_step(crowd, crowd_data, 200)
    # MuJoCo sums each tree for itself, so even the order of operations is the same; 1e-12 leaves room for its solvers.
    assert crowd_data.qpos[q] == pytest.approx(expected[0], abs=1e-12)
    assert crowd_data.qvel[v] == pytest.approx(expected[1], abs=1e-12)
    # And the door and the ball know nothing of the water.
    dry, dry_data, _ = scene(door)
    mujoco.mj_step(dry, dry_data, 200)
    assert np.array_equal(crowd_data.qpos[:8], dry_data.qpos[:8])


def test_only_the_boats_own_joints_get_forces_and_inertia():
    model, data, slots = scene(boat("beta"), boat("alpha"), boats=["alpha", "beta"])
    _, alpha = start(model, data, "alpha", slots, seed=1)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    beta = np.setdiff1d(np.arange(model.nv), np.arange(model.nv)[alpha])
    assert not full[alpha][:, beta].any()
    weightless = data.qfrc_passive[beta] - [0, 0, 1026.0 * 0.009 * 9.81, 0, 0, 0, 0, 0]
    assert weightless == pytest.approx(np.zeros(8), abs=1e-12)  # beta rests: buoyancy alone, through its origin


def test_a_reset_stills_the_water():
    """mj_resetData zeroes userdata: whoever resets writes the water again."""
    model, data, slots = scene(boat("alpha"), boats=["alpha"])
    start(model, data, "alpha", slots, seed=1)
    assert data.userdata.any()
    mujoco.mj_resetData(model, data)
    assert not data.userdata.any()


def test_threads_share_the_callback_without_a_lock():
    """Plain MjData on Python threads: mj_step lets go of the GIL and the callback never asks for it."""
    model, _, slots = scene(boat("alpha"), boats=["alpha"])

    def run(seed):
        data = mujoco.MjData(model)
        start(model, data, "alpha", slots, seed)
        mujoco.mj_step(model, data, 400)
        return np.concatenate([data.qpos, data.qvel])

    serial = [run(seed) for seed in range(6)]
    with ThreadPoolExecutor(3) as pool:
        parallel = list(pool.map(run, range(6)))
    assert np.array_equal(serial, parallel)
    assert np.all(np.isfinite(serial))


def test_installing_again_changes_nothing():
    fluid.install()
    assert fluid.is_warm()
    first = mujoco.get_mjcb_passive()
    fluid.install()
    assert mujoco.get_mjcb_passive() == first


def test_a_strange_mujoco_is_refused_before_anything_is_installed(monkeypatch):
    callback = mujoco.get_mjcb_passive()
    right = mujoco_structs.offsets

    def shifted(name):
        return {field: at + 16 if name == "mjData" else at for field, at in right(name).items()}

    mujoco.set_mjcb_passive(None)
    try:
        monkeypatch.setattr(fluid, "_callback", None)
        monkeypatch.setattr(mujoco_structs, "offsets", shifted)
        with pytest.raises(AuvsimError, match=r"mjData\.M is not where its introspection says"):
            fluid.install()
        assert mujoco.get_mjcb_passive() is None
    finally:
        mujoco.set_mjcb_passive(callback)


@pytest.mark.parametrize("changed", fluid.INSIDE)
def test_compiled_code_older_than_what_it_holds_is_forgotten(monkeypatch, tmp_path, changed):
    """Numba's cache would go on with yesterday's forces: it looks only at the file of the function that it keeps."""
    folder = tmp_path / "cache"
    folder.mkdir()
    for name in fluid.INSIDE:
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (0.0, 0.0))
    for name in ("fluid._hull-1.nbi", "fluid._build.passive-1.nbi", "forces.hull_force-1.nbi"):
        (folder / name).touch()
    monkeypatch.setattr(fluid, "__file__", str(tmp_path / "fluid.py"))
    monkeypatch.setattr(fluid, "FunctionCache", lambda function: SimpleNamespace(cache_path=str(folder)))
    monkeypatch.setattr(fluid, "_callback", None)
    assert fluid.is_warm()
    assert len(list(folder.iterdir())) == 3
    later = max(path.stat().st_mtime for path in folder.iterdir()) + 100.0
    os.utime(tmp_path / changed, (later, later))
    assert not fluid.is_warm()
    assert [path.name for path in folder.iterdir()] == ["forces.hull_force-1.nbi"]
