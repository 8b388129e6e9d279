"""Poses in the plane as arrays (..., 3): north, east [m], heading [rad]; composition, and what odometry makes of them.

A relative pose is forward, starboard [m] and turn [rad], seen from the earlier pose.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators.core.types import Array


class Input(NamedTuple):
    """What odometry says of an interval."""

    speed: float  # forward [m/s]
    turn_rate: float  # [rad/s]
    duration: float  # [s]


def compose(first: Array, relative: Array) -> Array:
    """The pose (..., 3) that is `relative` (..., 3) to the `first` (..., 3)."""
    first, relative = np.asarray(first, dtype=float), np.asarray(relative, dtype=float)
    c, s = np.cos(first[..., 2]), np.sin(first[..., 2])
    north = first[..., 0] + c * relative[..., 0] - s * relative[..., 1]
    east = first[..., 1] + s * relative[..., 0] + c * relative[..., 1]
    return np.stack((north, east, wrapped(first[..., 2] + relative[..., 2])), axis=-1)


def between(first: Array, second: Array) -> Array:
    """The `second` pose (..., 3) relative to the `first`: compose(first, between(first, second)) is the second."""
    first, second = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    c, s = np.cos(first[..., 2]), np.sin(first[..., 2])
    north, east = second[..., 0] - first[..., 0], second[..., 1] - first[..., 1]
    return np.stack((c * north + s * east, -s * north + c * east, wrapped(second[..., 2] - first[..., 2])), axis=-1)


def between_jacobians(first: Array, second: Array) -> tuple[Array, Array]:
    """Derivatives (3, 3) of `between` by the first and by the second pose (3,)."""
    c, s = np.cos(first[2]), np.sin(first[2])
    forward, starboard, _ = between(first, second)
    by_second = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    by_first = -by_second
    by_first[0, 2], by_first[1, 2] = starboard, -forward
    return by_first, by_second


def increments(inputs: Sequence[Input], errors: Array) -> Array:
    """Relative poses (k, 3) over some intervals if odometry shows too much by `errors` (k, 2) [m/s, rad/s].

    By the midpoint rule, ds = (V - e_V) T along the heading of the interval's middle (paper 5, sec. 2).
    """
    pose = np.zeros((len(errors), 3))
    for speed, turn_rate, duration in inputs:
        turn = (turn_rate - errors[:, 1]) * duration
        step = (speed - errors[:, 0]) * duration
        middle = pose[:, 2] + 0.5 * turn
        pose += np.stack((step * np.cos(middle), step * np.sin(middle), turn), axis=1)
    return pose


def wrapped(angle: Array) -> Array:
    """Angles in [-pi, pi)."""
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi


def rotation_to(path: Array, other: Array) -> float:
    """The angle [rad] by which a path (n, 2) is turned clockwise about the origin to come closest to another (n, 2)."""
    across = path[:, 0] * other[:, 1] - path[:, 1] * other[:, 0]
    return float(np.arctan2(across.sum(), (path * other).sum()))


def turned(path: Array, angle: float) -> Array:
    """A path (n, 2) of north, east turned clockwise about the origin by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return path @ np.array(((c, s), (-s, c)))
