"""NED and a forward-starboard-down body against ENU and a forward-port-up body, as ROS has them (REP 103)."""

import math

import numpy as np

from auvsim.base.frames import Array

_SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # from NED to ENU, and back


def enu(vector: Array) -> Array:
    """Turns vectors (..., 3) from NED to east-north-up; and back, as it is its own inverse."""
    return np.asarray(vector, dtype=float) @ _SWAP


def enu_quaternion(quaternion: Array) -> Array:
    """Turns quaternions (..., 4) wxyz of a forward-starboard-down body to NED into those of forward-port-up to ENU.

    A half turn about the body's x axis before, and one about the line between north and east after. Its own inverse.
    """
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=float), -1, 0)
    return math.sqrt(0.5) * np.stack([w + z, x + y, x - y, w - z], axis=-1)
