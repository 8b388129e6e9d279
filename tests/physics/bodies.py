"""Small hydrodynamic bodies for the tests, and the textbook equations that they must obey.

All in NED and forward-starboard-down. The flip to MuJoCo's axes and the equations of motion are written here a second
time, on purpose: what the tests compare with must not come from the code under test.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from auvsim.physics import hydrodynamics
from auvsim.physics.forces import RECORD
from auvsim.physics.water_slot import WATER
from auvsim.vehicles import library

Array = NDArray[Any]

DENSITY = 1026.0  # of the water [kg/m3]
GRAVITY = 9.81
RPM = np.pi / 30.0  # [rad/s]
TURN = np.diag([1.0, -1.0, -1.0])  # NED to MuJoCo's world, and forward-starboard-down to forward-port-up
TURN6 = np.kron(np.eye(2), TURN)

# A hinged wheel, balanced on the hull's origin: with a child MuJoCo does not find the hull "simple".
WHEEL = (
    '<body name="wheel"><joint name="wheel" axis="0 0 1"/>'
    '<inertial pos="0 0 0" mass="0.5" diaginertia="1e-3 1e-3 1e-3"/></body>'
)


def cross(vector: Array) -> Array:
    """The matrix S(a) with S(a) b = a x b."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def dense(seed: int, linear: float, angular: float) -> Array:
    """A symmetric positive definite (6, 6) matrix without a zero, like the added mass of a body without symmetry."""
    factor = np.random.default_rng(seed).uniform(-0.5, 0.5, (6, 6)) + np.eye(6)
    scale = np.sqrt(np.array([linear] * 3 + [angular] * 3))
    return scale[:, None] * (factor @ factor.T) * scale


@dataclass(frozen=True, kw_only=True)
class Rigid:
    """A rigid body's mass, centre of mass and inertia about it."""

    mass: float = 12.0
    centre: Array = field(default_factory=lambda: np.array([0.03, -0.02, 0.05]))
    inertia: Array = field(
        default_factory=lambda: np.array([[0.4, 0.02, -0.05], [0.02, 1.1, 0.03], [-0.05, 0.03, 1.3]])
    )

    @property
    def matrix(self) -> Array:
        """M_RB (6, 6) about the origin (Fossen 2021, eq. 3.49)."""
        S = self.mass * cross(self.centre)
        about_origin = self.inertia - self.mass * cross(self.centre) @ cross(self.centre)
        return np.block([[self.mass * np.eye(3), -S], [S, about_origin]])

    @property
    def xml(self) -> str:
        """Its `<inertial>` in MuJoCo's axes."""
        I = TURN @ self.inertia @ TURN
        full = I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]
        return f'<inertial pos="{_text(TURN @ self.centre)}" mass="{self.mass!r}" fullinertia="{_text(full)}"/>'


def _text(numbers: object) -> str:
    return " ".join(repr(float(number)) for number in np.ravel(np.asarray(numbers)))


def numerics(fields: Mapping[str, object]) -> str:
    """The `<custom>` section of hydrodynamic fields."""
    return "".join(f'<numeric name="{name}" data="{_text(value)}"/>' for name, value in fields.items())


def free_body(
    *,
    added_mass: Array,
    rigid: Rigid | None = None,
    volume: float = 0.0,
    fields: Mapping[str, object] | None = None,
    place: tuple[Array, Array] | None = None,
    inside: str = "",
    world: str = "",
    outside: str = "",
    option: str = "",
    timestep: float = 0.01,
    integrator: str = "RK4",
    gravity: float = 0.0,
    equip: bool = True,
) -> mujoco.MjModel:
    """A free hull, equipped with hydrodynamics.

    Args:
        added_mass: (6, 6).
        rigid: its dry mass; without it, 12 kg off the origin.
        volume: displaced [m3].
        fields: further numerics, by full name.
        place: position (3,) and rotation (3, 3) of the hull in the body that carries the free joint, forward-port-up;
            without it the hull carries the joint itself.
        inside: more MJCF inside the hull.
        world: more MJCF in the world body.
        outside: more MJCF sections.
        option: more attributes of `<option>`.
        timestep: [s].
        integrator: MuJoCo's name.
        gravity: [m/s2].
        equip: False leaves MuJoCo's model as it is.
    """
    body = (rigid or Rigid()).xml + inside
    if place is None:
        tree = f'<body name="hull"><freejoint/>{body}</body>'
    else:
        x, y, z, w = Rotation.from_matrix(place[1]).as_quat()
        hull = f'<body name="hull" pos="{_text(place[0])}" quat="{_text((w, x, y, z))}">{body}</body>'
        tree = f'<body name="frame"><freejoint/>{hull}</body>'
    hull_fields = {"hull_added_mass": added_mass, "hull_displaced_volume": volume} | dict(fields or {})
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><size nuser_body="{RECORD}" nuserdata="{WATER}"/>'
        f'<option timestep="{timestep}" integrator="{integrator}" gravity="0 0 {-gravity}" {option}/>'
        f"<worldbody>{world}{tree}</worldbody>{outside}"
        f"<custom>{numerics(hull_fields) if equip else ''}</custom></mujoco>"
    )
    if equip:
        hydrodynamics.equip(model, DENSITY)
    return model


def remus100(
    *, timestep: float = 0.01, integrator: str = "implicitfast", density: float = DENSITY, equip: bool = True
) -> mujoco.MjModel:
    """The shipped vehicle, free in open water."""
    root = library.vehicle("remus100").root
    root.find("body", "hull").add("freejoint")
    root.option.timestep, root.option.integrator = timestep, integrator
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    if equip:
        hydrodynamics.equip(model, density)
    return model


def command(data: mujoco.MjData, rudder: float = 0.0, elevator: float = 0.0, rpm: float = 0.0, *, at_once=True) -> None:
    """Sets the remus100's actuators; `at_once` puts fins and shaft there too, without their lags."""
    angles = {"rudder_upper": rudder, "rudder_lower": rudder, "plane_port": elevator, "plane_starboard": elevator}
    for name, angle in angles.items():
        data.actuator(name).ctrl[0] = angle
        if at_once:
            data.joint(name).qpos[0] = angle
    data.actuator("shaft").ctrl[0] = rpm * RPM
    if at_once:
        data.joint("shaft").qvel[0] = rpm * RPM


def set_motion(
    model: mujoco.MjModel, data: mujoco.MjData, nu: object, rotation: Array | None = None, position: object = (0, 0, 0)
) -> None:
    """Puts the hull at a NED position and attitude (3, 3) with velocity nu (6,) over ground; calls mj_forward."""
    hull = model.body("hull").id
    base = model.body_weldid[hull]
    W, p = np.eye(3), np.zeros(3)
    if base != hull:
        turned = np.empty(9)
        mujoco.mju_quat2Mat(turned, model.body_quat[hull])
        W, p = turned.reshape(3, 3), model.body_pos[hull]
    R = TURN @ (np.eye(3) if rotation is None else rotation) @ TURN  # hull to world
    nu = TURN6 @ np.asarray(nu, dtype=float)
    omega = R @ nu[3:]
    arm = R @ W.T @ p
    x, y, z, w = Rotation.from_matrix(R @ W.T).as_quat()
    data.qpos[:3] = TURN @ np.asarray(position, dtype=float) - arm
    data.qpos[3:7] = w, x, y, z
    data.qvel[:3] = R @ nu[:3] - np.cross(omega, arm)
    data.qvel[3:6] = W @ nu[3:]
    mujoco.mj_forward(model, data)


def motion(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array, Array]:
    """Position (3,) NED, attitude (3, 3) body to NED, and nu (6,) over ground, of the hull now."""
    mujoco.mj_forward(model, data)
    hull = data.body("hull")
    twist = np.empty(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, hull.id, twist, 1)
    nu = TURN6 @ np.concatenate([twist[3:], twist[:3]])
    return TURN @ hull.xpos, TURN @ hull.xmat.reshape(3, 3) @ TURN, nu


def acceleration(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """d(nu)/dt (6,) of the hull in its own turning axes, from qacc after mj_forward."""
    hull = data.body("hull")
    jacobian, change = np.zeros((6, model.nv)), np.zeros((6, model.nv))
    mujoco.mj_jacBody(model, data, jacobian[:3], jacobian[3:], hull.id)
    mujoco.mj_jacDot(model, data, change[:3], change[3:], hull.xpos, hull.id)
    world, velocity = jacobian @ data.qacc + change @ data.qvel, jacobian @ data.qvel
    R = hull.xmat.reshape(3, 3)
    linear = world[:3] - np.cross(velocity[3:], velocity[:3])
    return TURN6 @ np.concatenate([R.T @ linear, R.T @ world[3:]])


def coriolis(inertia: Array, nu: Array) -> Array:
    """C(nu) nu (6,) of an inertia matrix (6, 6) in body axes (Fossen 2021, eq. 3.57)."""
    momentum = inertia @ nu
    v, omega = nu[:3], nu[3:]
    return np.concatenate([np.cross(omega, momentum[:3]), np.cross(omega, momentum[3:]) + np.cross(v, momentum[:3])])


def set_water(data: mujoco.MjData, velocity: object = (0, 0, 0), derivative: object = (0, 0, 0), gradient=None) -> None:
    """Writes a current that is linear in time and place, `v + a t + G x` (NED), as its expansion about zero."""
    data.userdata[:4] = 0.0
    data.userdata[4:7] = TURN @ np.asarray(velocity, dtype=float)
    data.userdata[7:10] = TURN @ np.asarray(derivative, dtype=float)
    data.userdata[10:19] = (TURN @ (np.zeros((3, 3)) if gradient is None else gradient) @ TURN).ravel()


def body_force(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """The passive force and moment (6,) on a hull that carries the free joint itself, in its axes."""
    R = data.body("hull").xmat.reshape(3, 3)
    return TURN6 @ np.concatenate([R.T @ data.qfrc_passive[:3], data.qfrc_passive[3:6]])


def solve_motion(
    inertia: Array,
    force: Callable[[float, Array, Array, Array], Array],
    nu: object,
    times: Array,
    rotation: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Kirchhoff's equations in body axes (Fossen 2021, eq. 6.42 and 6.43) by an independent integrator.

    Args:
        inertia: M_RB + M_A (6, 6).
        force: of (time, position, rotation, nu), (6,) in body axes.
        nu: at the start (6,).
        times: (n,) at which the answer is wanted; the first is the start.
        rotation: at the start.

    Returns:
        Positions (n, 3), attitudes (n, 3, 3), nu (n, 6).
    """

    def derivative(time: float, state: Array) -> Array:
        R, nu = state[3:12].reshape(3, 3), state[12:]
        v, omega = nu[:3], nu[3:]
        nu_dot = np.linalg.solve(inertia, force(time, state[:3], R, nu) - coriolis(inertia, nu))
        return np.concatenate([R @ v, (R @ cross(omega)).ravel(), nu_dot])

    R = np.eye(3) if rotation is None else rotation
    start = np.concatenate([np.zeros(3), R.ravel(), np.asarray(nu, dtype=float)])
    answer = solve_ivp(derivative, times[[0, -1]], start, "DOP853", t_eval=times, rtol=1e-10, atol=1e-12)
    states = answer.y.T
    return states[:, :3], states[:, 3:12].reshape(-1, 3, 3), states[:, 12:]
