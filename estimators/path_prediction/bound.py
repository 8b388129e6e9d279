"""The posterior Cramér-Rao bound of a follower's position, in the coordinates of the noise (Van Trees 1968, 2.4.3).

The process noise of a pose is singular: two inputs move three states. The bound is therefore that of the initial poses
and of each step's noise of speed and yaw rate of both vehicles, and of the position as a function of them,
E[G] J^-1 E[G]' with J = P0^-1 + E[H' R^-1 H], expectations over sampled truths.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators.core.types import Array
from estimators.path_prediction.kinematics import sight
from estimators.path_prediction.messages import Noise


class Sighting(NamedTuple):
    """A pulse: when, and how exactly its range and bearing are measured."""

    emitted: float  # [s]
    detected: float  # [s]
    range_variance: float = math.inf  # [m^2]
    bearing_variance: float = math.inf  # [rad^2]


def position_bounds(
    leaders: Array,
    followers: Array,
    step: float,
    noises: tuple[Noise, Noise],
    start: tuple[Array, Array],
    sightings: Sequence[Sequence[Sighting]],
    times: Sequence[float],
) -> Array:
    """Bounds (t, 2, 2) of the covariance of the follower's position at some times, given the pulses detected by then.

    Args:
        leaders: Sampled true poses (m, k + 1, 3), one each step.
        followers: Likewise.
        step: [s].
        noises: Of the leader and the follower.
        start: Covariances (3, 3) of the initial poses of both.
        sightings: Of each sampled truth.
        times: [s].
    """
    rows, ends = [], []
    for leader, follower, seen in zip(leaders, followers, sightings, strict=True):
        for sighting in seen:
            block = _row(leader, follower, sighting, step, noises, start)
            rows.append(block)
            ends.append(np.full(len(block), sighting.detected))
    H, detected = np.concatenate(rows), np.concatenate(ends)
    H /= math.sqrt(len(leaders))
    gram = H @ H.T
    zeros, bounds = np.zeros((2, H.shape[1] // 2)), []
    for time in times:
        sensitivity = np.mean([_derivative(f, time, step, noises[1], start[1])[:2] for f in followers], axis=0)
        G = np.hstack((zeros, sensitivity))
        heard = detected <= time
        HG = H[heard] @ G.T
        inner = np.eye(int(heard.sum())) + gram[np.ix_(heard, heard)]
        bounds.append(G @ G.T - HG.T @ np.linalg.solve(inner, HG))
    return np.array(bounds)


def _row(
    leader: Array, follower: Array, s: Sighting, step: float, noises: tuple[Noise, Noise], start: tuple[Array, Array]
) -> Array:
    """Derivatives (m, p) of what is measured by the whitened parameters, in standard deviations of its noise."""
    ours = _derivative(follower, s.detected, step, noises[1], start[1])
    theirs = _derivative(leader, s.emitted, step, noises[0], start[0])
    away = _at(leader, s.emitted, step) - _at(follower, s.detected, step)
    _, D = sight(away[0], away[1], 0.0)
    both = np.hstack((D[:, :2] @ theirs[:2], D @ (ours * np.array([[-1.0], [-1.0], [1.0]]))))
    deviations = np.sqrt([s.range_variance, s.bearing_variance])
    return (both / deviations[:, None])[np.isfinite(deviations)]


def _at(poses: Array, time: float, step: float) -> Array:
    k = min(int(time / step), len(poses) - 2)
    return poses[k] + (time / step - k) * (poses[k + 1] - poses[k])


def _derivative(poses: Array, time: float, step: float, noise: Noise, start: Array) -> Array:
    """Of the pose (3,) at a time by the whitened parameters (3, 3 + 2 k): initial pose, noise of each step."""
    now, steps = _at(poses, time, step), len(poses) - 1
    share = np.clip(time / step - np.arange(steps), 0.0, 1.0)  # of each step that is over
    D = np.zeros((3, 3 + 2 * steps))
    whole = np.eye(3)
    whole[0, 2], whole[1, 2] = -(now[1] - poses[0, 1]), now[0] - poses[0, 0]
    D[:, :3] = whole @ np.linalg.cholesky(start)
    speed = share * math.sqrt(noise.speed * step)
    D[0, 3 : 3 + steps] = np.cos(poses[:-1, 2]) * speed
    D[1, 3 : 3 + steps] = np.sin(poses[:-1, 2]) * speed
    turn = share * math.sqrt(noise.yaw_rate * step)
    turned = np.where(share == 1.0, turn, 0.0)  # a step's own yaw rate does not move it
    D[0, 3 + steps :] = -(now[1] - poses[1:, 1]) * turned
    D[1, 3 + steps :] = (now[0] - poses[1:, 0]) * turned
    D[2, 3 + steps :] = turn
    return D
