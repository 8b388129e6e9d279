"""Rays against what is drawn of docks and vehicles: where sound meets them, and how squarely."""

import mujoco
import numpy as np

from auvsim.base.frames import Array, flip

DRAWN = np.array([0, 1, 0, 0, 0, 0], dtype=np.uint8)  # group of the geoms that show vehicles and structures


def cast(
    model: mujoco.MjModel, data: mujoco.MjData, place: Array, directions: Array, reach: float
) -> tuple[Array, Array]:
    """Distances at which rays meet something drawn, and how squarely.

    Args:
        model: of the scene.
        data: its state.
        place: (3,) where they begin, NED [m].
        directions: (n, 3) unit vectors, NED.
        reach: nothing is looked for beyond [m].

    Returns:
        Distances (n,) [m], infinite where there is nothing; and cosines (n,) of the angle to the surface's normal.
    """
    count = len(directions)
    rays = flip(directions)
    geom, distance, normal = np.zeros(count, dtype=np.int32), np.zeros(count), np.zeros(3 * count)
    mujoco.mj_multiRay(
        model,
        data,
        flip(place),
        np.ascontiguousarray(rays).ravel(),
        DRAWN,
        True,
        -1,
        geom,
        distance,
        normal,
        count,
        reach,
    )
    met = (geom >= 0) & (distance <= reach)
    facing = np.abs(np.einsum("ij,ij->i", normal.reshape(-1, 3), rays))
    return np.where(met, distance, np.inf), np.where(met, facing, 0.0)
