"""What a vehicle tells others about itself: its estimate, moved on to the time of sending."""

import math
from collections.abc import Sequence

from auvsim.acoustics.payload import StateReport
from auvsim.navigation.estimate import Estimate


def state_report(estimate: Estimate, states: Sequence[str], time: float, stamp: float) -> StateReport:
    """The report of an estimate, moved on at constant velocity and yaw rate.

    Args:
        estimate: initialised.
        states: names of its states, the first two of which are north and east; `heading` is the one whose
            covariance is told. Without it the covariance of heading is zero.
        time: to which the estimate is moved [s].
        stamp: of the report, by the vehicle's own clock [s].
    """
    e, dt = estimate, time - estimate.time
    surge, sway, yaw_rate = e.velocity.tolist()
    cos, sin = math.cos(e.heading), math.sin(e.heading)
    north = surge * cos - sway * sin + float(e.current[0])
    east = surge * sin + sway * cos + float(e.current[1])
    index = [0, 1, states.index("heading")] if "heading" in states else [0, 1]
    P = [[0.0] * 3 for _ in range(3)]
    for row, i in enumerate(index):
        for column, j in enumerate(index):
            P[row][column] = float(e.covariance[i, j])
    position = e.position.tolist()
    return StateReport(
        stamp, position[0] + north * dt, position[1] + east * dt, position[2], e.heading + yaw_rate * dt,
        north, east, yaw_rate, P[0][0], P[0][1], P[0][2], P[1][1], P[1][2], P[2][2],
    )  # fmt: skip
