"""Whether a compiled vehicle does what its MJCF says it is for: floats level, obeys its controls, bears the time step.

What is checked are forces and steps of the very model that is run, not the numbers of the file.
"""

import math
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.physics.planar_fit import Level
from auvsim.vehicles import model_files
from auvsim.vehicles.actuation import FinsAndShaft

TRIM = 0.1  # largest relative difference of buoyancy and weight; vehicles are trimmed to a few per cent
SPEED = 2.5  # through the water, at which controls and steps are tried: about the top speed of a torpedo AUV [m/s]
FASTER = 0.5  # growth that the step may add to that of the motion itself [1/s]
FINE = 20  # steps of the reference in one of those that are judged
FASTEST = 100_000.0  # rate up to which a sufficient one is looked for [Hz]


def check(vehicle: str, density: float) -> None:
    """Sees that a vehicle is trimmed and that its controls act to the side which their names say.

    Args:
        vehicle: name in models/, or the path of an MJCF file.
        density: of the water [kg/m3].

    Raises:
        InputError: it is not, or cannot be used at all.
    """
    _check(vehicle, *model_files.source("vehicle", vehicle), density)


def check_step(vehicle: str, integrator: str, rate: float, density: float) -> None:
    """Sees that a step is short enough for the stiffest servo and the fastest damping of a vehicle at speed.

    The step is linearised, at rest and at speed. It is too long where a disturbance grows faster than in much shorter
    steps; how fast it grows there is the vehicle's own.

    Args:
        vehicle: name in models/, or the path of an MJCF file.
        integrator: MuJoCo's.
        rate: steps a second [Hz].
        density: of the water [kg/m3].

    Raises:
        InputError: it is too long; the text says which rate would do.
    """
    level = _level(vehicle, *model_files.source("vehicle", vehicle), density)
    if not _too_long(level, integrator, rate):
        return
    enough = rate
    while _too_long(level, integrator, enough) and enough < FASTEST:
        enough *= 2.0
    raise InputError(
        f"rates.physics: {rate:g} Hz is too slow for the servos or the damping of '{vehicle}' with {integrator}, whose "
        f"errors grow from step to step; {enough:g} Hz is fast enough"
    )


@lru_cache(maxsize=16)
def _level(vehicle: str, path: Path, text: str, density: float) -> Level:
    """The vehicle alone; file and text are the cache's keys."""
    return Level(vehicle, density)


@lru_cache(maxsize=16)
def _check(vehicle: str, path: Path, text: str, density: float) -> None:
    level = _level(vehicle, path, text, density)
    buoyancy = density * level.volume / level.mass
    if not abs(buoyancy - 1.0) <= TRIM:
        raise InputError(
            f"model {vehicle}: it displaces {density * level.volume:.4g} kg of water and has a mass of "
            f"{level.mass:.4g} kg; correct hull_displaced_volume or the masses, they must agree to {TRIM:.0%}"
        )
    if not isinstance(level.actuation, FinsAndShaft):
        return
    straight = level.forces(SPEED)
    small = 0.1 * level.actuation.fin_limit
    for name, axis, says in (("rudder", 5, "turns to starboard"), ("elevator", 4, "dives")):
        moment = (level.forces(SPEED, **{name: small}) - straight)[axis] * (1.0 if axis == 5 else -1.0)
        if not moment > 0.0:
            raise InputError(
                f"model {vehicle}: a positive {name} must be one that {says}, but gives a moment of {moment:.3g} N m; "
                f"correct the signs of 'allocation_{name}' or the axes of the fins"
            )
    thrust = (level.forces(0.0, shaft_speed=level.actuation.shaft_limit) - level.forces(0.0))[0]
    if not thrust > 0.0:
        raise InputError(
            f"model {vehicle}: a positive shaft speed must drive ahead, but gives {thrust:.3g} N; correct "
            "'thrust_coefficients' or the axis of the propeller"
        )


@lru_cache(maxsize=64)
def _too_long(level: Level, integrator: str, rate: float) -> bool:
    return any(
        not _growth(level.model, integrator, rate, speed)
        <= _growth(level.model, integrator, FINE * rate, speed) + FASTER
        for speed in (0.0, SPEED)
    )


def _growth(model: mujoco.MjModel, integrator: str, rate: float, speed: float) -> float:
    """Rate at which the fastest growing small disturbance of a step does so [1/s]; infinite where it is not finite."""
    step = _linear_step(model, integrator, rate, speed)
    if not np.isfinite(step).all():
        return math.inf
    return rate * math.log(float(np.abs(np.linalg.eigvals(step)).max()))


def _linear_step(model: mujoco.MjModel, integrator: str, rate: float, speed: float, size: float = 1e-6) -> Array:
    """Derivative (2 nv, 2 nv) of a step from straight and level motion by forward differences.

    Args:
        model: of a vehicle alone; its options are put back.
        integrator: MuJoCo's.
        rate: steps a second [Hz].
        speed: ahead [m/s].
        size: of the differences [m, rad, m/s, rad/s].
    """
    before = model.opt.integrator, model.opt.timestep
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.timestep = 1.0 / rate
    data, count = mujoco.MjData(model), model.nv

    def step(change: Array) -> tuple[Array, Array]:
        mujoco.mj_resetData(model, data)
        data.qvel[0] = speed
        mujoco.mj_integratePos(model, data.qpos, change[:count], 1.0)
        data.qvel[:] += change[count:]
        mujoco.mj_step(model, data)
        return data.qpos.copy(), data.qvel.copy()

    position, velocity = step(np.zeros(2 * count))
    derivative, moved = np.zeros((2 * count, 2 * count)), np.zeros(count)
    for column, change in enumerate(size * np.eye(2 * count)):
        there, fast = step(change)
        mujoco.mj_differentiatePos(model, moved, size, position, there)
        derivative[:, column] = np.concatenate([moved, (fast - velocity) / size])
    model.opt.integrator, model.opt.timestep = before
    return derivative
