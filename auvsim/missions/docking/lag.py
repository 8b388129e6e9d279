"""Fixes that lag behind the vehicle's own motion, or run ahead of it: a dock's clock that is off."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from auvsim.base.frames import Array
from auvsim.base.reading import Reading
from auvsim.navigation.estimate import Estimate

KEPT = 60  # fixes
NEEDED = 15  # fixes by which a lag may be told
TRIED = np.arange(-15.0, 15.1, 0.5)  # offsets of the clock [s]
LEAST = 2.0  # offset that counts [s]
BETTER = 0.3  # by what factor an offset must reduce the residuals' scale to be believed
SPAN = 500.0  # time for which the way is kept [s]


class LagWatch:
    """Compares the way of the fixes with the way through the water, which no fix enters, later or earlier.

    Heading and surge of the estimate are those of compass and propeller. A steady current is fitted to each offset, so
    that only turns and changes of speed can tell it.
    """

    def __init__(self) -> None:
        self._way: deque[tuple[float, float, float]] = deque()  # time [s], north and east through the water [m]
        self._fixes: deque[tuple[float, float, float]] = deque(maxlen=KEPT)  # stamp [s], north, east from the dock [m]

    def observe(self, readings: Sequence[Reading], estimate: Estimate | None) -> None:
        """Takes the dock's packets and the last estimate."""
        for reading in readings:
            if reading.sensor == "usbl":
                x, y, _, heading = reading.value[:4].tolist()
                cos, sin = math.cos(heading), math.sin(heading)
                self._fixes.append((reading.stamp, x * cos - y * sin, x * sin + y * cos))
        if estimate is None or not estimate.initialised or (self._way and estimate.time <= self._way[-1][0]):
            return
        before, north, east = self._way[-1] if self._way else (estimate.time, 0.0, 0.0)
        step = (estimate.time - before) * float(estimate.velocity[0])
        self._way.append(
            (estimate.time, north + step * math.cos(estimate.heading), east + step * math.sin(estimate.heading))
        )
        while self._way[0][0] < estimate.time - SPAN:
            self._way.popleft()

    def offset(self) -> float | None:
        """Offset of the dock's clock [s], positive ahead, that fits the fixes far better than none; None: none does."""
        way, fixes = np.array(self._way), np.array(self._fixes)
        if len(fixes) < NEEDED or len(way) < 2:
            return None
        most = np.abs(TRIED).max()
        fixes = fixes[(fixes[:, 0] > way[0, 0] + most) & (fixes[:, 0] < way[-1, 0] - most)]
        if len(fixes) < NEEDED:
            return None
        scales = np.array([_scale(way, fixes, offset) for offset in TRIED])
        best = int(scales.argmin())
        found = float(TRIED[best])
        return found if abs(found) >= LEAST and scales[best] < BETTER * _scale(way, fixes, 0.0) else None


def _scale(way: Array, fixes: Array, offset: float) -> float:
    """Median distance [m] of the fixes from the way, moved by a steady current, with a clock of that offset [s].

    Args:
        way: (n, 3) time, north, east.
        fixes: (k, 3) stamp, north, east.
        offset: [s].
    """
    times = fixes[:, 0] - offset
    apart = fixes[:, 1:] - np.column_stack([np.interp(times, way[:, 0], way[:, axis]) for axis in (1, 2)])
    A = np.column_stack([np.ones_like(times), times - times.mean()])
    weights = np.ones(len(times))
    distance = np.zeros(len(times))
    for _ in range(4):  # least absolute distance by reweighting: some fixes are outliers
        root = np.sqrt(weights)[:, None]
        fitted = A @ np.linalg.lstsq(root * A, root * apart, rcond=None)[0]
        distance = np.hypot(*(apart - fitted).T)
        weights = 1.0 / np.maximum(distance, 0.1)
    return float(np.median(distance))
