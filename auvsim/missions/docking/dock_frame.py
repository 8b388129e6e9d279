"""The dock's frame: positions along the dock's axis, to starboard of it and below it."""

import math

import numpy as np

from auvsim.base.frames import Array
from auvsim.data.log import StructureLog, VehicleLog


def nose_position(log: VehicleLog) -> Array:
    """NED positions (n, 3) [m] of the nose at the times of the truth."""
    w, x, y, z = log["truth"]["quaternion"].T
    forward = np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=-1)
    return log["truth"]["position"] + log.number("nose") * forward


def in_dock_frame(dock: StructureLog, position: Array) -> Array:
    """NED positions (n, 3) as along track, cross track (to starboard) and down from the centre of the mouth [m]."""
    heading, mouth = dock.heading, dock.position
    cos, sin = math.cos(heading), math.sin(heading)
    north, east, down = position.T
    north, east = north - mouth[0], east - mouth[1]
    along, cross = cos * north + sin * east, cos * east - sin * north
    return np.stack([along, cross, down - mouth[2]], axis=-1)


def to_body(quaternion: Array, vector: Array) -> Array:
    """NED vectors (n, 3) in the axes of bodies with attitude quaternions (n, 4) wxyz."""
    w, axis = quaternion[:, :1], -quaternion[:, 1:]  # the conjugate turns back
    twice = 2.0 * np.cross(axis, vector)
    return vector + w * twice + np.cross(axis, twice)


def funnel_outline(dock: StructureLog) -> tuple[Array, Array]:
    """Port and starboard outline (3, 2) of the funnel and throat: along and cross track [m]."""
    mouth, throat, cone = dock.number("mouth_radius"), dock.number("throat_radius"), dock.number("cone_length")
    starboard = np.array([[0.0, mouth], [cone, throat], [cone + dock.number("throat_length"), throat]])
    return starboard * np.array([1.0, -1.0]), starboard
