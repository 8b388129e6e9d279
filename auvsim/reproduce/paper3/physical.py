"""Leader and follower of paper 3 as physical vehicles: two REMUS-100 that MuJoCo carries through a scene."""

import math
from functools import lru_cache

import numpy as np

from auvsim.reproduce.paper3.truths import STEP, Scene, commands
from auvsim.reproduce.steered import steered
from estimators.core.types import Array

SPEED = 2.0  # the paper's 6 kn are more than the vehicle makes [m/s]
DEPTH = 10.0  # [m]
WAYS = 4  # of each vehicle in a scene, among which the runs are shared out


def carried(scene: Scene, steps: int, seed: int, number: int) -> tuple[Array, Array, Array, Array]:
    """First pose (3,) and motion (k, 2) over ground of the leader, then of the follower, as `commands` gives them.

    The motion of each step is the vehicle's mean speed over it, and the turn of its course to the next: by the paper's
    kinematics it leads through the vehicle's true places.

    Raises:
        InputError: There is no such scene.
    """
    first_l, motion_l, first_f, motion_f = commands(scene, steps)
    found = []
    for vehicle, first, motion in ((0, first_l, motion_l), (1, first_f, motion_f)):
        headings = first[2] + STEP * np.concatenate(([0.0], np.cumsum(motion[:, 1])))
        places = _places(tuple(headings.tolist()), WAYS * (2 * seed + vehicle) + number % WAYS)
        found += _motion(places + first[:2], steps)
    return found[0], found[1], found[2], found[3]


@lru_cache(maxsize=64)
def _places(headings: tuple[float, ...], seed: int) -> Array:
    """Places (k + 2, 2) at each step and one more, from the start of a vehicle that is to head there."""
    known, times = np.array(headings), STEP * np.arange(len(headings))
    truths, rate = steered(
        lambda t: np.interp(t, times, known), start=(0.0, 0.0), depth=DEPTH, speed=SPEED, current=(0.0, 0.0),
        seconds=math.ceil(times[-1] + STEP), seed=seed,
    )  # fmt: skip
    places = np.array([truth.position[:2] for truth in truths[:: round(rate * STEP)]])
    return places - places[0]


def _motion(places: Array, steps: int) -> tuple[Array, Array]:
    """First pose (3,) and motion (steps, 2) through places (steps + 2, 2)."""
    moves = np.diff(places, axis=0)
    course = np.unwrap(np.arctan2(moves[:, 1], moves[:, 0]))
    motion = np.column_stack((np.hypot(*moves[:steps].T) / STEP, np.diff(course)[:steps] / STEP))
    return np.array([*places[0], course[0]]), motion
