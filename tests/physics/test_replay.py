"""One state, one future: identical arrays alone, in a batch on threads, after restoring, and when entered twice."""

from typing import Any

import mujoco
import mujoco.batch
import numpy as np
import pytest
from bodies import command, dense, free_body, motion, remus100, set_motion, set_water
from scipy.spatial.transform import Rotation

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
SIMULATIONS, STEPS = 5, 300


def prepare(model, data, number):
    """A state, a current and commands that differ from simulation to simulation."""
    random = np.random.default_rng(number)
    set_water(data, random.uniform(-0.5, 0.5, 3), random.uniform(-0.02, 0.02, 3), random.uniform(-0.02, 0.02, (3, 3)))
    rudder, elevator = random.uniform(-0.2, 0.2, 2)
    command(data, rudder, elevator, random.uniform(300, 1500), at_once=False)
    attitude = Rotation.from_euler("ZYX", random.uniform(-0.5, 0.5, 3)).as_matrix()
    set_motion(model, data, random.uniform(-0.5, 0.5, 6), attitude, random.uniform(-10, 10, 3))


def saved(model, data):
    state: Any = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state


def alone(model, number, steps=STEPS):
    data = mujoco.MjData(model)
    prepare(model, data, number)
    mujoco.mj_step(model, data, steps)
    return saved(model, data)


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_a_batch_on_two_threads_gives_the_arrays_of_each_alone(integrator):
    """The water is userdata, so it is part of each row's state; equal to the last bit, hence no tolerance."""
    model = remus100(integrator=integrator)
    batch = mujoco.batch.Batch(model, nsim=SIMULATIONS, nthread=2)
    rows = {field: batch.bind(field) for field in ("qpos", "qvel", "ctrl", "userdata", "qacc_warmstart")}
    for number in range(SIMULATIONS):
        data = mujoco.MjData(model)
        prepare(model, data, number)
        for field, row in rows.items():
            row[number] = getattr(data, field)
    for _ in range(STEPS):
        batch.step()
    for number in range(SIMULATIONS):
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, alone(model, number), STATE)
        for field, row in rows.items():
            assert np.array_equal(row[number], getattr(data, field)), field
    assert np.ptp(rows["qpos"][:, 0]) > 0.1  # they are not all the same


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_save_and_restore_continues_to_the_last_bit(integrator):
    model = remus100(integrator=integrator)
    whole = alone(model, 3)
    half = alone(model, 3, STEPS // 2)
    other = mujoco.MjData(model)
    prepare(model, other, 4)  # something else was in it before
    mujoco.mj_step(model, other, 17)
    mujoco.mj_setState(model, other, half, STATE)
    mujoco.mj_step(model, other, STEPS - STEPS // 2)
    assert np.array_equal(saved(model, other), whole)
    assert np.array_equal(alone(model, 3), whole)


def test_full_physics_alone_would_lose_the_water():
    """Why INTEGRATION is the state to save: FULLPHYSICS leaves userdata out."""
    model = remus100()
    data, other = mujoco.MjData(model), mujoco.MjData(model)
    prepare(model, data, 3)
    physics = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, physics))
    mujoco.mj_getState(model, data, state, physics)
    mujoco.mj_setState(model, other, state, physics)
    assert data.userdata.any()
    assert not other.userdata.any()


def snapshot(data):
    return [np.array(getattr(data, field)) for field in ("M", "qLD", "qfrc_passive", "qacc_smooth", "qacc")]


def test_entering_twice_adds_nothing_twice():
    model = remus100()
    data = mujoco.MjData(model)
    prepare(model, data, 1)
    once = snapshot(data)
    calls = [lambda: mujoco.mj_forward(model, data)]
    for stage in (mujoco.mjtStage.mjSTAGE_NONE, mujoco.mjtStage.mjSTAGE_POS, mujoco.mjtStage.mjSTAGE_VEL):
        calls.append(lambda stage=stage: mujoco.mj_forwardSkip(model, data, stage, 0))
    for call in calls:
        call()
        assert all(np.array_equal(a, b) for a, b in zip(once, snapshot(data), strict=True))


def test_finite_differences_of_mujoco_see_the_summed_inertia():
    """mjd_transitionFD skips stages as it perturbs; its A matrix is that of steps taken one by one."""
    model = free_body(added_mass=dense(1, 20.0, 2.0), fields={"hull_linear_damping": dense(2, 10.0, 1.0)})
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    data = mujoco.MjData(model)
    set_motion(model, data, [1.0, 0.3, -0.2, 0.5, -0.6, 0.8])
    start = saved(model, data)
    A, step = np.zeros((12, 12)), 1e-6
    mujoco.mjd_transitionFD(model, data, step, True, A, None, None, None)
    for column in range(6):
        ends = []
        for sign in (1, -1):
            mujoco.mj_setState(model, data, start, STATE)
            data.qvel[column] += sign * step
            mujoco.mj_step(model, data)
            ends.append(data.qvel.copy())
        # Differences of 1e-16 rounding over 2e-6.
        assert A[6:, 6 + column] == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=1e-8)


def test_a_model_without_coefficients_is_untouched():
    """Bit for bit the same with the callback installed and without, also where it has user data of its own."""
    settings = {"added_mass": np.zeros((6, 6)), "equip": False, "gravity": 9.81}
    floor = '<geom type="plane" size="5 5 1" pos="0 0 -0.5"/>'
    box = '<geom type="box" size="0.3 0.1 0.1" mass="0"/>'

    def fall():
        model = free_body(**settings, world=floor, inside=box, integrator="implicitfast")
        data = mujoco.MjData(model)
        set_motion(model, data, [1.0, 0.3, -0.2, 0.5, -0.6, 0.8])
        mujoco.mj_step(model, data, 300)
        assert data.ncon > 0
        return saved(model, data)

    remus100()  # installs it
    callback = mujoco.get_mjcb_passive()
    assert callback is not None
    with_callback = fall()
    mujoco.set_mjcb_passive(None)
    try:
        without = fall()
    finally:
        mujoco.set_mjcb_passive(callback)
    assert np.array_equal(with_callback, without)


def test_two_models_serve_one_process():
    """Interleaved steps of two vehicles in two models, against each alone."""
    first, second = (
        remus100(),
        free_body(added_mass=dense(1, 20.0, 2.0), fields={"hull_linear_damping": dense(2, 9, 1)}),
    )
    expected = []
    for turns in ([0], [1], [0, 1]):
        pair = [mujoco.MjData(first), mujoco.MjData(second)]
        prepare(first, pair[0], 2)
        set_motion(second, pair[1], [1.0, 0.3, -0.2, 0.5, -0.6, 0.8])
        for _ in range(100):
            for index in turns:
                mujoco.mj_step((first, second)[index], pair[index])
        expected.append([saved(model, data) for model, data in zip((first, second), pair, strict=True)])
    assert np.array_equal(expected[2][0], expected[0][0])
    assert np.array_equal(expected[2][1], expected[1][1])
    assert motion(first, pair[0])[2].any()
