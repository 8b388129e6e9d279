"""Speed of the physics: steps of the remus100 in MuJoCo, with and without hydrodynamics, beside a NumPy model of it.

Run with `pytest tests/benchmarks/test_physics_speed.py --benchmark-enable`: every entry of a group takes the same
number of steps of one vehicle, so the ratios that are printed in brackets are those of the speeds; `extra_info` has
steps per second.
"""

import mujoco
import mujoco.batch
import numpy as np
import pytest

from auvsim.base.frames import Array, flip_matrix
from auvsim.physics import hydrodynamics
from auvsim.vehicles import library

STEPS = 2000
TIMESTEP = 0.01
ROWS = 64  # simulations in a batch
DENSITY, GRAVITY = 1026.0, 9.81
RUDDER, PLANE, SHAFT = 0.05, 0.02, 120.0  # [rad, rad, rad/s]


def vehicle(integrator: str, equip: bool = True) -> mujoco.MjModel:
    root = library.vehicle("remus100").root
    root.find("body", "hull").add("freejoint")
    root.option.timestep, root.option.integrator = TIMESTEP, integrator
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    if equip:
        hydrodynamics.equip(model)
    else:
        model.opt.gravity[:] = 0.0  # it would fall, ever faster
    return model


def under_way(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qvel[0] = 1.5
    data.qvel[model.joint("shaft").dofadr[0]] = SHAFT
    data.ctrl[:] = RUDDER, RUDDER, PLANE, PLANE, SHAFT
    return data


def report(benchmark, steps: int) -> None:
    if benchmark.stats:  # none with --benchmark-disable
        benchmark.extra_info["steps_per_second"] = round(steps / benchmark.stats["min"])


@pytest.mark.parametrize("callback", [True, False], ids=["hydrodynamics", "dry"])
@pytest.mark.parametrize("integrator", ["implicitfast", "Euler", "RK4"])
@pytest.mark.benchmark(group=f"{STEPS} steps of one remus100")
def test_one_vehicle(benchmark, integrator, callback):
    model = vehicle(integrator, callback)
    data = under_way(model)
    benchmark(mujoco.mj_step, model, data, STEPS)
    report(benchmark, STEPS)
    assert np.all(np.isfinite(data.qvel))


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
@pytest.mark.benchmark(group=f"{ROWS} x {STEPS // 10} steps on two threads")
def test_a_batch_on_two_threads(benchmark, integrator):
    model = vehicle(integrator)
    batch = mujoco.batch.Batch(model, nsim=ROWS, nthread=2)
    data = under_way(model)
    for field in ("qvel", "ctrl"):
        batch.bind(field)[:] = getattr(data, field)

    benchmark(batch.step, nstep=STEPS // 10)
    report(benchmark, ROWS * (STEPS // 10))
    assert np.all(np.isfinite(batch.bind("qvel")))


class NumpyRemus100:
    """The same vehicle as one writes it in NumPy, in the style of the public Python port: Euler angles, Euler steps.

    Fossen (2021), eq. 2.31, 3.49, 3.57, 6.43, 9.8; attached fin flow only; the coefficients are read from the shipped
    model.
    """

    def __init__(self) -> None:
        model = vehicle("Euler")
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        bodies = hydrodynamics.bodies(model)
        self.hull = next(body.fields for body in bodies if body.kind == "hull")
        self.M = flip_matrix(full[:6, :6])
        self.M_inverse = np.linalg.inv(self.M)
        fins = [body for body in bodies if body.kind == "fin"]
        turn = np.diag([1.0, -1.0, -1.0])
        self.place = np.array([data.body(fin.name).xpos for fin in fins]) @ turn
        self.normal = -np.array([data.body(fin.name).xmat.reshape(3, 3)[:, 1] for fin in fins]) @ turn
        self.rudder = np.array(["rudder" in fin.name for fin in fins], dtype=float)
        self.plane = np.array(["plane" in fin.name for fin in fins], dtype=float)
        self.q = np.array([0.5 * DENSITY * fin.fields["area"][0] for fin in fins])
        self.slope = np.array([fin.fields["lift_slope"][0] for fin in fins])
        self.weight = float(model.body_subtreemass[1]) * GRAVITY
        self.buoyancy = DENSITY * float(self.hull["displaced_volume"][0]) * GRAVITY
        self.centre = data.subtree_com[1] @ turn
        self.eta, self.nu = np.zeros(6), np.array([1.5, 0, 0, 0, 0, 0])
        self.actuators = np.array([0.0, 0.0, SHAFT])

    def forces(self, R: Array) -> Array:
        u, v, w, _, q, r = self.nu
        velocity, omega = self.nu[:3], self.nu[3:]
        momentum = self.M @ self.nu
        tau = -np.concatenate(
            [np.cross(omega, momentum[:3]), np.cross(omega, momentum[3:]) + np.cross(velocity, momentum[:3])]
        )
        tau -= self.hull["linear_damping"] @ self.nu + self.hull["quadratic_damping"] @ (np.abs(self.nu) * self.nu)
        down = R[2]
        tau[:3] += (self.weight - self.buoyancy) * down
        tau[3:] += np.cross(self.centre, self.weight * down)

        x = self.hull["strip_x"]
        across, below = v + x * r, w - x * q
        drag = 0.5 * DENSITY * self.hull["cross_flow_drag"] * self.hull["strip_area"] * np.hypot(across, below)
        Y, Z = -drag * across, -drag * below
        tau += np.array([0.0, Y.sum(), Z.sum(), 0.0, -(x * Z).sum(), (x * Y).sum()])
        lift, at = self.hull["body_lift"][0] * abs(u), self.hull["body_lift_x"][0]
        tau += np.array([0.0, -lift * v, -lift * w, 0.0, at * lift * w, -at * lift * v])

        local = velocity + np.cross(omega, self.place)
        side = (local * self.normal).sum(axis=1)
        deflection = self.actuators[0] * self.rudder + self.actuators[1] * self.plane
        # Positive rudders push the stern to port, positive planes push it up.
        angle = side / max(u, 1e-3) + deflection * (self.normal[:, 1] + self.normal[:, 2])
        fins = -(self.q * u * u * self.slope * angle)[:, None] * self.normal
        fins[:, 0] -= self.q * u * u * 0.01
        tau[:3] += fins.sum(axis=0)
        tau[3:] += np.cross(self.place, fins).sum(axis=0)

        n, D = self.actuators[2] / (2 * np.pi), 0.14
        J = 0.944 * u / (n * D)
        tau[0] += 0.9 * DENSITY * n * n * D**4 * (0.4566 - 0.4174 * J)
        tau[3] -= 0.1 * DENSITY * n * n * D**5 * (0.07 - 0.0585 * J)
        return tau

    def step(self) -> None:
        roll, pitch, yaw = self.eta[3:]
        cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
        R = np.array(
            [
                [cy * cp, -sy * cr + cy * sp * sr, sy * sr + cy * cr * sp],
                [sy * cp, cy * cr + sr * sp * sy, -cy * sr + sp * sy * cr],
                [-sp, cp * sr, cp * cr],
            ]
        )
        T = np.array([[1, sr * sp / cp, cr * sp / cp], [0, cr, -sr], [0, sr / cp, cr / cp]])
        rate = np.concatenate([R @ self.nu[:3], T @ self.nu[3:]])
        self.nu = self.nu + TIMESTEP * (self.M_inverse @ self.forces(R))
        self.eta = self.eta + TIMESTEP * rate
        error = np.array([RUDDER, PLANE, SHAFT]) - self.actuators
        self.actuators = self.actuators + TIMESTEP * error / np.array([0.1, 0.1, 1.0])


@pytest.mark.benchmark(group=f"{STEPS} steps of one remus100")
def test_numpy_model_of_the_same_vehicle(benchmark):
    remus = NumpyRemus100()

    def run():
        for _ in range(STEPS):
            remus.step()

    benchmark(run)
    report(benchmark, STEPS)
    # It is the same vehicle: the same steady turning dive, to what attached fins and Euler angles differ at small
    # angles.
    for _ in range(max(0, 6000 - STEPS)):
        remus.step()
    model = vehicle("Euler")
    data = under_way(model)
    mujoco.mj_step(model, data, 6000)
    R = data.body("hull").xmat.reshape(3, 3)
    expected = np.concatenate([R.T @ data.qvel[:3], data.qvel[3:6]]) * [1, -1, -1, 1, -1, -1]
    assert remus.nu == pytest.approx(expected, abs=2e-3)
    assert np.sin(remus.eta[4]) == pytest.approx(R[2, 0], abs=1e-3)  # the dive
    assert expected[5] > 0.02  # and it does turn
