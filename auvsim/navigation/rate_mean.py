"""The mean of a sampled rate over the time from one update to the next: an input of a filter."""

import math
from itertools import pairwise

SILENT = 1.0  # time after its last reading when a sensor is taken to have failed [s]


class RateMean:
    """Integrates a rate between its readings, as a straight line from each to the next."""

    def __init__(self) -> None:
        self._readings: list[tuple[float, float]] = []  # stamp [s] and rate, from the one before the last mean on
        self._since = -math.inf  # until when the last mean reached [s]

    def add(self, stamp: float, rate: float) -> None:
        """Takes a reading; one that is not later than the last, or not finite, is ignored."""
        if math.isfinite(rate) and (not self._readings or stamp > self._readings[-1][0]):
            self._readings.append((stamp, rate))

    def mean(self, time: float) -> float:
        """Mean since the last time it was asked for; held before the first reading and after the last, 0 without any.

        What fell silent more than a second before the interval began shows nothing, and 0 is returned.

        Args:
            time: Now [s], later than the last time.
        """
        since, self._since = self._since, time
        if not self._readings or since - self._readings[-1][0] > SILENT:
            return 0.0
        if not math.isfinite(since):
            return self._readings[-1][1]
        total, (at, rate) = 0.0, (since, self._at(since))
        for stamp, value in [r for r in self._readings if since < r[0] < time] + [(time, self._at(time))]:
            total += 0.5 * (rate + value) * (stamp - at)
            at, rate = stamp, value
        before = [k for k, (stamp, _) in enumerate(self._readings) if stamp <= time]
        self._readings = self._readings[before[-1] :] if before else self._readings
        return total / (time - since)

    def _at(self, time: float) -> float:
        """The rate at a time: between its readings, or that of the nearest."""
        readings = self._readings
        for (first, rate), (second, following) in pairwise(readings):
            if first <= time <= second:
                return rate + (following - rate) * (time - first) / (second - first)
        return readings[0][1] if time < readings[0][0] else readings[-1][1]
