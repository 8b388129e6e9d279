"""The follower of paper 2 as a physical vehicle: a REMUS-100 that MuJoCo carries through the weave in the current."""

import math

import numpy as np

from auvsim.base.frames import rotation
from auvsim.physics.truth import Truth
from auvsim.reproduce.paper2.runs import (
    BEGIN,
    CURRENT,
    CYCLE,
    CYCLES,
    DEPTH,
    SPEED,
    TRACKS,
    Conditions,
    Motion,
    planar_motion,
)
from auvsim.reproduce.steered import steered

TRACK = "weave"


def motion(seed: int, seconds: int = CYCLES * CYCLE) -> Motion:
    """True motion of the vehicle, whose autopilot steers the weave by its own compass and depth gauge.

    Args:
        seed: Of the sensors' noise.
        seconds: How long.
    """
    truths, rate = steered(
        TRACKS[TRACK].follower_heading, start=(float(BEGIN[0]), float(BEGIN[1])), depth=DEPTH, speed=SPEED,
        current=CURRENT.tolist(), seconds=seconds, seed=seed, duration=CYCLES * CYCLE,
    )  # fmt: skip
    positions = np.array([truth.position for truth in truths])
    # The mean over each second, of what a speed log and a compass show that are read faster.
    mean = np.array([_through_water(truth) for truth in truths])
    mean[:, 2] = np.unwrap(mean[:, 2])
    mean = 0.5 * (mean[1:] + mean[:-1])
    planar = planar_motion(Conditions(tracks=TRACK))
    shift = BEGIN - positions[0, :2]
    return Motion(
        follower=positions[::rate, :2] + shift,
        current=planar.current[: seconds + 1],
        through_water=mean.reshape(seconds, rate, 3).mean(axis=1),
        leader=planar.leader[: seconds + 1],
        depth=positions[::rate, 2],
    )


def _through_water(truth: Truth) -> tuple[float, float, float]:
    """Level speed ahead and to starboard of the heading [m/s], and the heading [rad]."""
    over_ground = rotation(*truth.attitude.tolist()) @ truth.nu[:3]
    north, east, _ = (over_ground - truth.current).tolist()
    heading = float(truth.attitude[2])
    c, s = math.cos(heading), math.sin(heading)
    return c * north + s * east, c * east - s * north, heading
