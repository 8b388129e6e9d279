"""Fits the planar rudder-driven model that estimators assume to a vehicle's hydrodynamics; gives the fit's error."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import FLIP6, Array
from auvsim.physics import hydrodynamics
from auvsim.vehicles import library, model_files
from auvsim.vehicles.actuation import Commands, FinsAndShaft
from estimators.planar.model import PlanarParameters

_SAMPLES = 600


@dataclass(frozen=True, kw_only=True)
class PlanarFit:
    """A planar model of a vehicle near one speed, with its error relative to the vehicle to which it was fitted."""

    vehicle: str
    speed: float  # [m/s]
    parameters: PlanarParameters
    shaft_speed: float  # that keeps `speed` on a straight course [rad/s]
    acceleration_rms: Array  # (3,) residual in surge, sway, yaw over the fitted states [m/s2, m/s2, rad/s2]
    acceleration_scale: Array  # (3,) rms of the accelerations themselves over the same states

    def shaft_speed_for(self, speed: float) -> float:
        """Shaft speed [rad/s] that holds a speed through the water [m/s] ahead, by the model's thrust and drag.

        Solves `X_nn n^2 + X_nu n u + X_uu u^2 + X_u u + X_prop = 0` for n >= 0; 0 at rest.
        """
        if speed == 0.0:
            return 0.0
        p = self.parameters
        b = p.X_nu * speed
        c = p.X_uu * speed * abs(speed) + p.X_u * speed + p.X_prop
        return (-b + math.sqrt(max(b * b - 4 * p.X_nn * c, 0.0))) / (2 * p.X_nn)


class Level:
    """Forces and inertia of a vehicle that is level, in still water, straight from MuJoCo.

    Raises:
        InputError: the vehicle cannot be used; the text says why.
    """

    def __init__(self, name: str, density: float) -> None:
        vehicle = library.vehicle(name)
        body = vehicle.root.find("body", "hull")
        body.add("freejoint")
        try:
            self.model = mujoco.MjModel.from_xml_string(vehicle.root.to_xml_string(), vehicle.root.get_assets())
            hydrodynamics.equip(self.model, density)
        except (ValueError, InputError) as error:
            raise InputError(f"model {name}: {' '.join(str(error).split())[:300]}") from None
        self.data = mujoco.MjData(self.model)
        if isinstance(vehicle.actuation, FinsAndShaft):
            fins = [self.model.actuator(fin).trnid[0] for fin in vehicle.actuation.fins]
            self._fins = [int(self.model.jnt_qposadr[joint]) for joint in fins]
            self._shaft = int(self.model.jnt_dofadr[self.model.actuator("shaft").trnid[0]])
        self.actuation = vehicle.actuation
        hull = next((b for b in hydrodynamics.bodies(self.model) if b.kind == "hull"), None)
        if hull is None:
            raise InputError(f"model {name}: the body 'hull' has no numerics such as 'hull_added_mass'")
        self.added_mass = hull.fields["added_mass"]
        self.linear_damping = hull.fields.get("linear_damping", np.zeros((6, 6)))
        self.volume = float(hull.fields["displaced_volume"][0])  # [m3]
        mujoco.mj_forward(self.model, self.data)
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        self.inertia = full[np.ix_((0, 1, 5), (0, 1, 5))]  # the flip leaves the planar block as it is
        self.mass = float(self.model.body_subtreemass[1])
        self.x_g = float(self.data.subtree_com[1, 0])

    def evaluate(self, u: float, v: float, r: float, rudder: float, shaft_speed: float) -> Array:
        """X, Y, N (3,) [N, N, N m] that act on the accelerations of a planar motion, SNAME signs."""
        force = self._forward(u, v, r, Commands(rudder, 0.0, shaft_speed))
        # MuJoCo's linear accelerations are the world's; the body's components turn with it.
        return np.array([force[0], -force[1], -force[5]]) - self.inertia @ (-v * r, u * r, 0.0)

    def forces(self, u: float, *, rudder: float = 0.0, elevator: float = 0.0, shaft_speed: float = 0.0) -> Array:
        """Force and moment (6,) on a vehicle that moves straight ahead [N, N m], forward-starboard-down."""
        return FLIP6 * self._forward(u, 0.0, 0.0, Commands(rudder, elevator, shaft_speed))[:6]

    def resistance(self, nu: Sequence[float] | Array) -> Array:
        """Force and moment (6,) on a vehicle of body velocity `nu` (6,), all actuators at rest; SNAME [N, N m]."""
        data = self.data
        mujoco.mj_resetData(self.model, data)
        data.qvel[:6] = FLIP6 * np.asarray(nu)  # level: the axes of the body are those of the world
        mujoco.mj_forward(self.model, data)
        return FLIP6 * (data.qfrc_passive - data.qfrc_bias)[:6]

    def _forward(self, u: float, v: float, r: float, demand: Commands) -> Array:
        """Generalised force (nv,), gravity included, in MuJoCo's axes."""
        data = self.data
        data.qpos[: self.model.nq] = self.model.qpos0
        for at, angle in zip(self._fins, self.actuation.allocate(demand)[:-1], strict=True):
            data.qpos[at] = angle
        data.qvel[:] = 0.0
        data.qvel[0], data.qvel[1], data.qvel[5] = u, -v, -r
        data.qvel[self._shaft] = demand.shaft_speed
        mujoco.mj_forward(self.model, data)
        return data.qfrc_passive - data.qfrc_bias


def fit_planar_model(vehicle: str, speed: float, density: float = hydrodynamics.SEA_WATER) -> PlanarFit:
    """Fits the planar model to the forces of a level vehicle near a speed (linear least squares, no trajectories).

    The states are drawn round the steady turns of a first fit, so that the cross-flow terms are right where a vehicle
    really is: turning, its drift angle tied to its yaw rate.

    Args:
        vehicle: name in models/, or the path of an MJCF file.
        speed: speed through the water [m/s].
        density: density of the water [kg/m3].

    Raises:
        InputError: the speed is not positive, or the vehicle cannot reach it.
    """
    if not 0.0 < speed < 20.0:
        raise InputError(f"no planar model of '{vehicle}' at {speed:g} m/s; give a positive speed through the water")
    return _fit_model(vehicle, *model_files.source("vehicle", vehicle), speed, density)


@lru_cache(maxsize=64)
def _fit_model(vehicle: str, path: Path, text: str, speed: float, density: float) -> PlanarFit:
    """The fit of a vehicle; its file and text are keys of the cache."""
    level = Level(vehicle, density)
    if not isinstance(level.actuation, FinsAndShaft):
        raise InputError(
            f"no planar model of '{vehicle}', which is driven by thrusters: docking, tracks, manoeuvres and filters "
            "need fins and a shaft"
        )
    shaft = _steady_shaft(level, vehicle, speed)
    generator = np.random.default_rng(0)
    draws = generator.uniform(-1.0, 1.0, (_SAMPLES, 5))
    u = speed * (1.0 + 0.35 * draws[:, 0])
    rudder = level.actuation.fin_limit * draws[:, 1]
    n = shaft * (1.0 + 0.35 * draws[:, 2])
    v, r = 0.1 * u * draws[:, 3], 0.1 * u * draws[:, 4]
    try:
        parameters, _, _ = _fit(level, speed, u, v, r, rudder, n)
        for _ in range(2):
            drift, rate = _steady_turn(parameters, rudder, speed)
            v = u * (drift + 0.03 * draws[:, 3])
            r = u * (rate + 0.05 * draws[:, 4])
            parameters, residual, scale = _fit(level, speed, u, v, r, rudder, n)
    except np.linalg.LinAlgError as error:
        raise InputError(f"model {vehicle}: no planar model fits it ({error}); check its coefficients") from None
    return PlanarFit(
        vehicle=vehicle,
        speed=speed,
        parameters=parameters,
        shaft_speed=shaft,
        acceleration_rms=residual,
        acceleration_scale=scale,
    )


def _steady_shaft(level: Level, vehicle: str, speed: float) -> float:
    """Shaft speed [rad/s] at which thrust equals drag straight ahead (bisection: thrust grows with shaft speed)."""
    low, high = 0.0, 1000.0
    if level.evaluate(speed, 0.0, 0.0, 0.0, high)[0] < 0.0:
        raise InputError(f"'{vehicle}' cannot hold {speed:g} m/s with its propeller")
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if level.evaluate(speed, 0.0, 0.0, 0.0, middle)[0] < 0.0 else (low, middle)
    return 0.5 * (low + high)


def _steady_turn(p: PlanarParameters, rudder: Array, speed: float) -> tuple[Array, Array]:
    """Drift v/u and rate r/u (n,) of steady turns: fixed-point iteration on the terms quadratic in v and r."""
    drift, rate = np.zeros_like(rudder), np.zeros_like(rudder)
    for _ in range(60):
        if not (np.isfinite(drift).all() and np.isfinite(rate).all()):
            raise np.linalg.LinAlgError("no steady turn")
        v, r = np.abs(drift), np.abs(rate)
        a, b = p.Y_uv + p.Y_vv * v + p.Y_v / speed, p.Y_ur - p.m + p.Y_rr * r + p.Y_r / speed
        c, d = p.N_uv + p.N_vv * v + p.N_v / speed, p.N_ur - p.m * p.x_g + p.N_rr * r + p.N_r / speed
        determinant = a * d - b * c
        if not determinant.all():
            raise np.linalg.LinAlgError("no steady turn")
        new_drift = -(d * p.Y_dd - b * p.N_dd) * rudder / determinant
        new_rate = -(a * p.N_dd - c * p.Y_dd) * rudder / determinant
        drift, rate = 0.5 * (drift + new_drift), 0.5 * (rate + new_rate)
    return np.clip(drift, -0.3, 0.3), np.clip(rate, -0.3, 0.3)


def _slopes(level: Level, speed: float, shaft_speed: float) -> Array:
    """Derivatives (2, 3) of Y and N by u v, u r and u^2 rudder on a straight course: lift, Munk moment, fins."""
    step = 1e-3
    slopes = []
    for v, r, rudder in ((step * speed, 0.0, 0.0), (0.0, step * speed, 0.0), (0.0, 0.0, step)):
        ahead = level.evaluate(speed, v, r, rudder, shaft_speed)
        back = level.evaluate(speed, -v, -r, -rudder, shaft_speed)
        slopes.append((ahead - back)[1:] / (2 * step * speed**2))
    # Damping that does not grow with the speed is no lift.
    return np.array(slopes).T + _linear(level)[1:, 1:] @ ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)) / speed


def _linear(level: Level) -> Array:
    """Linear damping (3, 3) of surge, sway and yaw."""
    return level.linear_damping[np.ix_((0, 1, 5), (0, 1, 5))]


def _fit(
    level: Level, speed: float, u: Array, v: Array, r: Array, rudder: Array, n: Array
) -> tuple[PlanarParameters, Array, Array]:
    """Fits the model's terms to X, Y, N; residual and scale as accelerations (3,).

    In turns v and r go together, so lift terms (u v, u r) are taken from derivatives at a straight course, Coriolis
    terms (v r, r^2) from the inertia, and only drag, thrust and cross-flow terms are regressed.
    """
    forces = np.array([level.evaluate(*state) for state in zip(u, v, r, rudder, n, strict=True)])
    m, x_g, added = level.mass, level.x_g, level.added_mass
    damped = _linear(level) @ (u, v, r)
    known_x = (added[1, 1] + m) * v * r + (added[1, 5] + m * x_g) * r * r - damped[0]
    terms_x = np.stack([u * np.abs(u), u**2 * rudder**2, n * np.abs(n), np.abs(n) * u], axis=-1)
    linear = np.stack([u * v, u * r, u**2 * rudder])
    slopes = _slopes(level, speed, float(n.mean()))
    known_y, known_n = slopes @ linear - damped[1:]
    terms_yn = np.stack([v * np.abs(v), r * np.abs(r)], axis=-1)
    X, Y, N = (
        np.linalg.lstsq(terms, force - known, rcond=None)[0].tolist()
        for terms, force, known in zip(
            (terms_x, terms_yn, terms_yn), forces.T, (known_x, known_y, known_n), strict=True
        )
    )
    (Y_uv, Y_ur, Y_dd), (N_uv, N_ur, N_dd) = slopes.tolist()
    (X_u, _, _), (_, Y_v, Y_r), (_, N_v, N_r) = (0.0 - _linear(level)).tolist()
    X_ud, Y_vd, Y_rd, N_rd = (-float(added[i, j]) for i, j in ((0, 0), (1, 1), (1, 5), (5, 5)))
    parameters = PlanarParameters(
        m=m, x_g=x_g, I_z=float(level.inertia[2, 2]) + N_rd,
        X_ud=X_ud, Y_vd=Y_vd, Y_rd=Y_rd, N_vd=Y_rd, N_rd=N_rd,
        X_uu=X[0], X_vr=-Y_vd, X_rr=-Y_rd, X_dd=X[1], X_nn=X[2], X_nu=X[3],
        Y_vv=Y[0], Y_rr=Y[1], Y_uv=Y_uv, Y_ur=Y_ur + m, Y_dd=Y_dd,
        N_vv=N[0], N_rr=N[1], N_uv=N_uv, N_ur=N_ur + m * x_g, N_dd=N_dd,
        X_u=X_u, Y_v=Y_v, Y_r=Y_r, N_v=N_v, N_r=N_r,
    )  # fmt: skip
    fitted = np.stack([known_x + terms_x @ X, known_y + terms_yn @ Y, known_n + terms_yn @ N], axis=-1)
    inverse = np.linalg.inv(level.inertia)
    residual = np.sqrt(np.mean(((forces - fitted) @ inverse.T) ** 2, axis=0))
    scale = np.sqrt(np.mean((forces @ inverse.T) ** 2, axis=0))
    return parameters, residual, scale
