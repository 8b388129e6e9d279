"""Where a thruster gets its command, and whether it is on its vehicle."""

import mujoco
import numpy as np

from auvsim.base.errors import InputError


def channel(model: mujoco.MjModel, name: str) -> int:
    """Where the command of a thruster is, as its record holds it.

    Raises:
        InputError: it has no actuator of its name, or its actuator exerts a force of its own.
    """
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name)
    if index < 0:
        raise InputError(f"thruster '{name}' needs an actuator of its name, which takes its command")
    if model.actuator_gainprm[index].any() or model.actuator_biasprm[index].any():
        raise InputError(f"actuator '{name}' must have gainprm and biasprm 0: the water gives the thruster's force")
    return int(model.actuator_actadr[index]) if model.actuator_actnum[index] else -1 - index


def check_place(model: mujoco.MjModel, data: mujoco.MjData, body: int, size: float) -> None:
    """Refuses a thruster that is off its vehicle: outside the box round the vehicle's geoms by more than its size.

    Args:
        model: compiled.
        data: with its kinematics done.
        body: index of the thruster's body.
        size: of the thruster [m].

    Raises:
        InputError: it is.
    """
    root = model.body_rootid[body]
    geoms = [
        i
        for i in range(model.ngeom)
        if model.body_rootid[model.geom_bodyid[i]] == root and model.geom_bodyid[i] != body
    ]
    if not geoms:
        return
    R = data.xmat[root].reshape(3, 3)
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    points = [
        data.geom_xpos[i]
        + (model.geom_aabb[i, :3] + corners * model.geom_aabb[i, 3:]) @ data.geom_xmat[i].reshape(3, 3).T
        for i in geoms
    ]
    box, place = np.concatenate(points) @ R, data.xpos[body] @ R
    over = np.maximum(box.min(axis=0) - place, place - box.max(axis=0)).max()
    if over > size:
        raise InputError(
            f"thruster '{model.body(body).name}' is {over:.3g} m outside the hull; at most its size is allowed"
        )
