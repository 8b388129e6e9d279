"""What a follower hears of its leader: sound pulses, and packets that come later and say where the pulse left."""

import math
from typing import NamedTuple

import numpy as np

from estimators.core.loops import wrap
from estimators.core.types import Array
from estimators.path_prediction.kinematics import sight


class Noise(NamedTuple):
    """Power spectral densities of odometry; of samples, each its variance times the period."""

    speed: float  # [m^2/s]
    yaw_rate: float  # [rad^2/s]


class Pulse(NamedTuple):
    """A sound pulse that the follower has detected; a USBL adds a bearing, or has that alone."""

    number: int  # of the pulse, from 0
    emitted: float  # [s]
    detected: float  # [s]
    range: float = math.nan  # from the leader at emission to the follower at detection [m]
    range_variance: float = math.inf  # [m^2]
    bearing: float = math.nan  # of the leader's place of emission, from the follower's bow at detection [rad]
    bearing_variance: float = math.inf  # [rad^2]


class Packet(NamedTuple):
    """What a leader broadcasts of the time of a pulse: its own estimate and its motion (u_m in the paper)."""

    number: int  # of the pulse it belongs to
    stamp: float  # when it was true [s]
    received: float  # [s]
    pose: Array  # (3,) north, east [m], heading [rad]
    covariance: Array  # (3, 3) of the pose
    speed: float  # [m/s]
    yaw_rate: float  # [rad/s]


class Sight(NamedTuple):
    """What a pulse says that was not known: linearised about a follower's and a leader's place."""

    residual: Array  # (m,)
    by_follower: Array  # (m, 3) derivative by the follower's pose
    by_leader: Array  # (m, 2) derivative by the leader's position
    covariance: Array  # (m, m) of the noise
    away: Array  # (2,) from the follower to the leader [m]


def seen(pulse: Pulse, follower: Array, leader: Array) -> Sight | None:
    """A pulse as range, bearing or both, seen at the pose (3,) of a leader at a place (2,); None at no distance."""
    values, D = sight(leader[0] - follower[0], leader[1] - follower[1], follower[2])
    if values[0] == 0.0:
        return None
    rows = _rows(pulse)
    residual = np.array([pulse.range - values[0], wrap(pulse.bearing - values[1])])[rows]
    by_follower = D[rows] * np.array([-1.0, -1.0, 1.0])
    R = np.diag([pulse.range_variance, pulse.bearing_variance][rows])
    return Sight(residual, by_follower, D[rows, :2].copy(), R, leader[:2] - follower[:2])


def curved(found: Sight, pulse: Pulse, spread: Array) -> Sight:
    """Sight to second order (Bar-Shalom, Li, Kirubarajan 2001, 10.3.2), which a follower needs that is far off.

    Args:
        spread: Covariance (2, 2) of the vector from the follower to the leader.
    """
    r = math.hypot(*found.away)
    u = found.away / r
    n = np.array([-u[1], u[0]])
    across, along, skew = n @ spread @ n, u @ spread @ u, u @ spread @ n
    shift = np.array([0.5 * across / r, -skew / r**2])[_rows(pulse)]
    more = np.array([0.5 * (across / r) ** 2, (along * across + skew**2) / r**4])[_rows(pulse)]
    return found._replace(residual=found.residual - shift, covariance=found.covariance + np.diag(more))


def _rows(pulse: Pulse) -> slice:
    return slice(0 if math.isfinite(pulse.range) else 1, 2 if math.isfinite(pulse.bearing) else 1)
