"""Depth that keeps an altitude over the sea floor: from gauge and altimeter, within safe limits."""

import math
from collections.abc import Collection, Sequence

from auvsim.base.reading import Reading

SMOOTHING = 4.0  # time constant of the floor's depth [s]


class AltitudeKeeper:
    """Knows the floor's depth below the vehicle by its altimeters.

    Args:
        altimeters: names of the sensors that measure the range to the floor.
        altitude: to be kept [m].
        deepest: depth that is safe wherever the floor is [m].
        blind: depth to go to where the floor has not been heard for `patience` [m].
        patience: [s].
    """

    def __init__(
        self, altimeters: Collection[str], altitude: float, deepest: float, blind: float, patience: float
    ) -> None:
        self._altimeters, self._altitude, self._deepest = altimeters, altitude, deepest
        self._blind, self._patience = blind, patience
        self.floor = math.nan  # its depth, smoothed [m]
        self._heard = -math.inf
        self._tilt = 1.0  # vertical part of the hull's downward axis

    def observe(self, readings: Sequence[Reading], depth: float) -> None:
        """Takes what compass and altimeters among `readings` show, at a depth by the gauge [m]."""
        for reading in readings:
            if reading.sensor == "compass":
                self._tilt = math.cos(float(reading.value[1])) * math.cos(float(reading.value[2]))
            elif reading.sensor in self._altimeters:
                below = depth + float(reading.value[0]) * self._tilt
                passed = reading.stamp - self._heard
                share = 1.0 - math.exp(-passed / SMOOTHING) if math.isfinite(self.floor) else 1.0
                self.floor = below if passed > self._patience else self.floor + share * (below - self.floor)
                self._heard = reading.stamp

    def depth(self, time: float) -> float:
        """The depth to keep at a time [s]: above the floor by the altitude, never below the safe depth [m]."""
        if time - self._heard > self._patience:
            return min(self._blind, self._deepest)
        return min(max(self.floor - self._altitude, 0.0), self._deepest)
