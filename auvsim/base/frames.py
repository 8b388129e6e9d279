"""Frames and angles, and the only conversions between the user's axes and MuJoCo's.

The user sees NED (north, east, down) and a forward-starboard-down body. MuJoCo's world is z-up with x north and
y west, its bodies are forward-port-up. Both are turned by half a turn about x, so one matrix serves world and body.
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FLIP = np.array([1.0, -1.0, -1.0])  # diagonal of the half turn about x
FLIP6 = np.concatenate([FLIP, FLIP])  # the same for [linear, angular] pairs
FLIP_QUATERNION = np.array([1.0, 1.0, -1.0, -1.0])  # the same for quaternions wxyz
_HALF_TURN, _TURN = math.pi, 2 * math.pi


def flip(vector: Array) -> Array:
    """Turns vectors (..., 3) between NED and MuJoCo's world; also between the two kinds of body axes."""
    return np.asarray(vector, dtype=float) * FLIP


def flip_matrix(matrix: Array) -> Array:
    """Turns a (3, 3) or (6, 6) matrix (inertia, damping, gradient) between the two frames."""
    matrix = np.asarray(matrix, dtype=float)
    signs = FLIP if matrix.shape[-1] == 3 else FLIP6
    return matrix * np.outer(signs, signs)


def flip_quaternion(quaternion: Array) -> Array:
    """Turns attitude quaternions (..., 4) wxyz between body-to-NED and MuJoCo's body-to-world."""
    return np.asarray(quaternion, dtype=float) * FLIP_QUATERNION


def euler_to_quaternion(roll: float, pitch: float, yaw: float) -> Array:
    """Quaternion (4,) wxyz of the ZYX Euler angles [rad] (Fossen 2021, eq. 2.79)."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def quaternion_to_euler(quaternion: Array) -> Array:
    """Roll, pitch, yaw (..., 3) [rad] of quaternions (..., 4) wxyz, ZYX order."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=float), -1, 0)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=-1)


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation matrix (3, 3) from body to NED of the ZYX Euler angles [rad] (Fossen 2021, eq. 2.31)."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, -sy * cr + cy * sp * sr, sy * sr + cy * cr * sp],
            [sy * cp, cy * cr + sr * sp * sy, -cy * sr + sp * sy * cr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def wrap(angle: float) -> float:
    """The angle [rad] in (-pi, pi]."""
    return _HALF_TURN - (_HALF_TURN - angle) % _TURN
