"""Ranges to a leader as measurements, and what they say of the plan view where depths differ."""

import math

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Measurement

KIND = "range"
SHARED = "shared_range"  # to one whose error may be correlated with the own, its variance as of core.fusion


def leader_range(
    distance: float,
    leader: tuple[float, float, float],
    *,
    deviation: float,
    stamp: float,
    received: float | None = None,
    depth: float | None = None,
    leader_deviation: float = 0.0,
    depth_deviation: float = 0.0,
    sequence: int | None = None,
    source: str = "",
) -> Measurement:
    """A slant range as a measurement whose covariance holds the error of the leader's place and of the depths.

    Args:
        distance: Slant range [m].
        leader: North, east, depth of the leader when it sent [m].
        deviation: Of the range [m].
        stamp: When the range was true [s].
        received: When it arrived; None: at once.
        depth: Of the own vehicle [m]; None: the leader's.
        leader_deviation: Of the leader's place along each horizontal axis [m].
        depth_deviation: Of the difference of depths [m].
        sequence: Counts the leader's packets.
        source: Name of the leader.
    """
    own = leader[2] if depth is None else depth
    steep = min(1.0, abs(leader[2] - own) / distance) if distance > 0.0 else 1.0
    variance = deviation**2 + (1.0 - steep**2) * leader_deviation**2 + steep**2 * depth_deviation**2
    return Measurement(
        kind=KIND, source=source, value=np.array([distance]), covariance=np.array([[variance]]), stamp=stamp,
        received=stamp if received is None else received, sequence=sequence,
        parameters=(*leader, own, leader_deviation**2),
    )  # fmt: skip


def flattened(
    distance: float, height: float, deviation: float, height_deviation: float = 0.0
) -> tuple[float, float] | None:
    """Range in the plan view and its variance: sigma_2d^2 = (r / r_2d)^2 sigma_r^2 + (dz / r_2d)^2 sigma_dz^2.

    None where no range in the plan view explains the slant range, as right above the leader.

    Raises:
        ParameterError: A deviation is below 0.
    """
    if deviation < 0.0 or height_deviation < 0.0:
        raise ParameterError(f"deviations {deviation} m and {height_deviation} m must not be below 0")
    square = distance**2 - height**2
    if square <= 0.0:
        return None
    return math.sqrt(square), ((distance * deviation) ** 2 + (height * height_deviation) ** 2) / square
