"""Ballast and trim of one vehicle: its net buoyancy and where its centres of gravity and buoyancy are."""

from itertools import product
from typing import Annotated

import mujoco
import numpy as np
from pydantic import Field

from auvsim.base.errors import InputError
from auvsim.base.frames import Array, flip
from auvsim.base.settings import Settings

MOST = 0.1  # largest net buoyancy, as a share of the weight
TINY = 1e-6  # mass of each of the two bodies that carry the moment of a shifted centre of buoyancy [kg]

Shift = Annotated[tuple[float, float, float], Field(description="forward, starboard, down [m]")]


class BallastSettings(Settings):
    """Ballast and trim of the vehicle, on top of what its model has; filters and autopilot are not told.

    Net buoyancy is weight that is left out at the centre of gravity. Centres are those of the whole vehicle.
    """

    net_buoyancy: float = Field(default=0.0, description="buoyancy less weight, positive floats [N]")
    cg_shift: Shift = Field(
        default=(0.0, 0.0, 0.0), description="of the centre of gravity: forward, starboard, down [m]"
    )
    cb_shift: Shift = Field(default=(0.0, 0.0, 0.0), description="of the centre of buoyancy, likewise [m]")

    @property
    def is_zero(self) -> bool:
        """Whether the vehicle is as its model has it."""
        return self.net_buoyancy == 0.0 and not any((*self.cg_shift, *self.cb_shift))


def shift_buoyancy(spec: mujoco.MjSpec, vehicle: str, ballast: BallastSettings, buoyancy: float) -> None:
    """Gives a vehicle the moment of its shifted centre of buoyancy: two bodies on the hull, one lifted, one pulled.

    Args:
        spec: a scene, to be compiled.
        vehicle: instance name.
        ballast: of it.
        buoyancy: of the vehicle under water [N].
    """
    if not any(ballast.cb_shift):
        return
    hull, weight = spec.body(f"{vehicle}/hull"), TINY * -float(spec.option.gravity[2])
    shift = flip(np.array(ballast.cb_shift))
    for name, place, lift in (("cb", shift, buoyancy), ("cb_before", np.zeros(3), -buoyancy)):
        body = hull.add_body(name=f"{vehicle}/{name}", pos=place, gravcomp=1.0 + lift / weight)
        body.mass, body.ipos, body.inertia, body.explicitinertial = TINY, np.zeros(3), np.full(3, 1e-9), True


def load(model: mujoco.MjModel, vehicle: str, ballast: BallastSettings) -> None:
    """Gives a vehicle of a compiled scene its weight and centre of gravity, before its hydrodynamics.

    Raises:
        InputError: the net buoyancy is more than a tenth of the weight, or a centre is shifted out of the hull.
    """
    if ballast.is_zero:
        return
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    base, hull = model.body(f"{vehicle}/").id, model.body(f"{vehicle}/hull").id
    _check_shifts(vehicle, ballast, _half_size(model, hull))
    whole, gravity = float(model.body_subtreemass[base]), -float(model.opt.gravity[2])
    if abs(ballast.net_buoyancy) > MOST * whole * gravity:
        raise InputError(
            f"vehicles.{vehicle}.ballast.net_buoyancy: {ballast.net_buoyancy:g} N is more than {MOST:.0%} of the "
            f"weight of '{vehicle}', {whole * gravity:.4g} N"
        )
    change = -ballast.net_buoyancy / gravity
    centre = _in_body(data, hull, data.subtree_com[base])
    mass = float(model.body_mass[hull])
    moment = mass * model.body_ipos[hull] + change * centre + (whole + change) * flip(np.array(ballast.cg_shift))
    model.body_mass[hull] = mass + change
    model.body_ipos[hull] = moment / (mass + change)
    mujoco.mj_setConst(model, data)


def _half_size(model: mujoco.MjModel, hull: int) -> Array:
    """Half the length, breadth and height (3,) of a hull [m], from its geoms."""
    boxes = [model.geom_aabb[geom] for geom in range(model.ngeom) if model.geom_bodyid[geom] == hull]
    places = [model.geom_pos[geom] for geom in range(model.ngeom) if model.geom_bodyid[geom] == hull]
    turned = [model.geom_quat[geom] for geom in range(model.ngeom) if model.geom_bodyid[geom] == hull]
    corners = [
        place + _rotation(quaternion) @ (box[:3] + box[3:] * signs)
        for box, place, quaternion in zip(boxes, places, turned, strict=True)
        for signs in product((-1.0, 1.0), repeat=3)
    ]
    return 0.5 * np.ptp(corners, axis=0) if corners else np.full(3, np.inf)


def _rotation(quaternion: Array) -> Array:
    """Rotation matrix (3, 3) of a quaternion (4,)."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _check_shifts(vehicle: str, ballast: BallastSettings, most: Array) -> None:
    """Sees that no centre is shifted by more than half the size (3,) of the hull [m]."""
    for key in ("cg_shift", "cb_shift"):
        shift = getattr(ballast, key)
        if np.any(np.abs(shift) > most):
            sizes = ", ".join(f"{size:.3g}" for size in most)
            raise InputError(
                f"vehicles.{vehicle}.ballast.{key}: {[*shift]} m is out of the hull of '{vehicle}'; give at most "
                f"[{sizes}] m in size"
            )


def _in_body(data: mujoco.MjData, body: int, place: Array) -> Array:
    return data.xmat[body].reshape(3, 3).T @ (place - data.xpos[body])
