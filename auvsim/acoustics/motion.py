"""How a point of a vehicle moves between two truths, or stays."""

from collections.abc import Sequence

import numpy as np

from auvsim.acoustics.channel import Instant
from auvsim.base.frames import Array, rotation, wrap
from auvsim.base.interpolation import cubic_hermite
from auvsim.physics.truth import Truth


class Still:
    """The way of what does not move, between two times.

    Args:
        position: (3,) NED [m].
        heading: [rad].
        begin, end: [s].
    """

    __slots__ = ("_instant", "begin", "end")

    def __init__(self, position: Sequence[float], heading: float, begin: float, end: float) -> None:
        self._instant = Instant(np.array(position), rotation(0.0, 0.0, heading))
        self.begin, self.end = begin, end

    def at(self, time: float) -> Instant:
        """Where it is, and how it lies, at any time [s]."""
        return self._instant


class Segment:
    """The way of a point of a vehicle between two consecutive truths.

    Args:
        previous: Truth at its begin.
        now: Truth at its end.
        point: The point (3,) in the body frame [m].
    """

    __slots__ = ("_now", "_point", "_previous", "begin", "end")

    def __init__(self, previous: Truth, now: Truth, point: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        self._previous, self._now, self._point = previous, now, np.array(point)
        self.begin, self.end = previous.time, now.time

    def at(self, time: float) -> Instant:
        """Where the point is at a time [s], and how the body lies."""
        position, turn = interpolate(self._previous, self._now, time)
        return Instant(position + turn @ self._point, turn)


def interpolate(previous: Truth, now: Truth, time: float) -> tuple[Array, Array]:
    """Position (3,) NED [m] and rotation (3, 3) body to NED at a time between two truths.

    Position follows the cubic through both positions and velocities over ground; the Euler angles are linear.
    """
    width = now.time - previous.time
    fraction = (time - previous.time) / width
    first, last = previous.attitude.tolist(), now.attitude.tolist()
    start_slope = rotation(*first) @ previous.nu[:3]
    end_slope = rotation(*last) @ now.nu[:3]
    position = [
        cubic_hermite(*axis, width, fraction)[0]
        for axis in zip(
            previous.position.tolist(), now.position.tolist(), start_slope.tolist(), end_slope.tolist(), strict=True
        )
    ]
    attitude = [a + fraction * wrap(b - a) for a, b in zip(first, last, strict=True)]
    return np.array(position), rotation(*attitude)
