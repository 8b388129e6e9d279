"""A trial's places seen from its dock: along its axis, to starboard of it, below it."""

import math

import numpy as np

from auvsim.base.frames import Array
from auvsim.data.log import TrialLog


def nose_position(log: TrialLog) -> Array:
    """NED positions (n, 3) [m] of the nose at the times of the truth."""
    w, x, y, z = log["truth"]["quaternion"].T
    forward = np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=-1)
    return log["truth"]["position"] + log.number("vehicle_nose") * forward


def in_dock_frame(log: TrialLog, position: Array) -> Array:
    """NED positions (n, 3) as along track, cross track (to starboard) and down from the centre of the mouth [m]."""
    heading = log.number("dock_heading")
    cos, sin = math.cos(heading), math.sin(heading)
    north, east, down = position.T
    along, cross = cos * north + sin * east, cos * east - sin * north
    return np.stack([along, cross, down - log.number("dock_depth")], axis=-1)


def to_body(quaternion: Array, vector: Array) -> Array:
    """NED vectors (n, 3) in the axes of bodies with attitude quaternions (n, 4) wxyz."""
    w, axis = quaternion[:, :1], -quaternion[:, 1:]  # the conjugate turns back
    twice = 2.0 * np.cross(axis, vector)
    return vector + w * twice + np.cross(axis, twice)


def funnel_outline(log: TrialLog) -> tuple[Array, Array]:
    """Port and starboard outline (3, 2) of the funnel and throat: along and cross track [m]."""
    mouth, throat, cone = log.number("mouth_radius"), log.number("throat_radius"), log.number("cone_length")
    starboard = np.array([[0.0, mouth], [cone, throat], [cone + log.number("throat_length"), throat]])
    return starboard * np.array([1.0, -1.0]), starboard
