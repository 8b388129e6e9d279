"""What ranges to a leader tell of a follower: the rank of their information about pose and mean yaw rate."""

from typing import NamedTuple

import numpy as np

from estimators.core.types import Array
from estimators.path_prediction.kinematics import sight


class Observability(NamedTuple):
    """Of initial north, east [m], heading [rad] and mean yaw rate [rad/s], from ranges alone, motion without noise."""

    rank: int
    deviations: Array  # (4,) what the states are known to; infinite where they are not observable
    heading_observable: bool


def observability(
    leader: Array, follower: Array, step: float, times: Array, variance: float, tolerance: float = 1e-6
) -> Observability:
    """Of the ranges at some times between a leader and a follower on tracks (k + 1, 3), one pose each step [s].

    Args:
        variance: Of a range [m^2].
        tolerance: Of the singular values, relative to the largest, with all states scaled to what moves a place alike.
    """
    rows = []
    for k in np.rint(np.asarray(times) / step).astype(int):
        away = leader[k, :2] - follower[k, :2]
        u = -sight(away[0], away[1], 0.0)[1][0, :2]
        gone = follower[k, :2] - follower[0, :2]
        turned = step * sum((follower[k, :2] - follower[1 : k + 1, :2]), np.zeros(2))  # by a yaw rate held
        rows.append([u[0], u[1], -u[0] * gone[1] + u[1] * gone[0], -u[0] * turned[1] + u[1] * turned[0]])
    H = np.array(rows)
    length, duration = np.abs(H[:, 2]).max() + 1.0, float(times[-1])
    scale = np.array([1.0, 1.0, 1.0 / length, 1.0 / (length * duration)])
    _, values, V = np.linalg.svd(H * scale / np.sqrt(variance), full_matrices=True)
    values = np.concatenate((values, np.zeros(4 - len(values))))
    seen = values > tolerance * values[0]
    blind = (V[~seen] ** 2).sum(axis=0) > 1e-6  # states with a part in a direction that nothing shows
    with np.errstate(divide="ignore"):
        spread = np.sqrt((V[seen] ** 2 / values[seen, None] ** 2).sum(axis=0)) * scale
    deviations = np.where(blind, np.inf, spread)
    return Observability(int(seen.sum()), deviations, bool(np.isfinite(deviations[2])))
