"""What a vehicle hears of its dock, and how much of it was of use to the estimator."""

import math
from collections import Counter, deque
from collections.abc import Sequence

from auvsim.base.reading import Reading
from auvsim.missions.docking.reports import DockReports
from auvsim.navigation.estimate import Estimate

NUMBERED = 8  # packets that tell the time between two
FIXES = ("usbl", "fix", "range")  # kinds of measurement that tell where the vehicle is


class Heard(DockReports):
    """The dock's reports, and when a fix was last heard and last used.

    Args:
        charted: Heading [rad] and depth [m] of the mouth where the dock reports nothing; None where it does.
        ranges: Names of the sensors that measure ranges to beacons.
    """

    def __init__(self, charted: tuple[float, float] | None, ranges: Sequence[str] = ()) -> None:
        super().__init__(charted)
        self._ranges = tuple(ranges)
        self._used = 0.0  # when the estimator last accepted a fix [s]
        self._judges = False  # whether the estimator says what it accepts
        self._seen = float("-inf")  # time of the last estimate looked at [s]
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=NUMBERED)  # number and time of the dock's packets [s]
        self._refused: Counter[str] = Counter()  # fixes refused since one was last accepted, by reason

    def begin(self, time: float) -> None:
        """Counts silence from a time on [s], at which listening begins."""
        self.last, self._used = max(self.last, time), max(self._used, time)

    def observe(self, readings: Sequence[Reading]) -> None:
        """Takes the dock's packets and the ranges among readings."""
        super().observe(readings)
        for reading in readings:
            if reading.sensor == "usbl":
                self._arrivals.append((reading.sequence, reading.received))
        if self._ranges:
            self.last = max([self.last, *(r.received for r in readings if r.sensor in self._ranges)])

    def judge(self, estimate: Estimate) -> None:
        """Takes what the estimator made of the fixes since its last estimate."""
        if estimate.time <= self._seen:
            return
        self._seen = estimate.time
        for outcome in estimate.outcomes:
            if outcome.kind in FIXES:
                self._judges = True
                if outcome.accepted:
                    self._used = estimate.time
                    self._refused.clear()
                else:
                    self._refused[outcome.reason] += 1

    def silence(self, time: float) -> float:
        """Time since a fix was last of use, or since listening began [s]."""
        return time - (self._used if self._judges else self.last)

    @property
    def interval(self) -> float | None:
        """Time from one packet of the dock to the next, lost ones included [s]; None until there are two."""
        if len(self._arrivals) < 2 or self._arrivals[-1][0] <= self._arrivals[0][0]:
            return None
        (first, begin), (last, end) = self._arrivals[0], self._arrivals[-1]
        return (end - begin) / (last - first)

    def due(self, time: float, wait: float, interval: float) -> float:
        """Time from now at which the first packet after a wait [s] is due, at an interval [s]."""
        last = self._arrivals[-1][1] - time
        return last + (math.floor((wait - last) / interval) + 1) * interval

    def lost(self, time: float) -> str:
        """Why there was none for so long."""
        text = f"no fix for {self.silence(time):.0f} s"
        if not self._refused:
            return text
        count = sum(self._refused.values())
        reason = self._refused.most_common(1)[0][0].replace("_", " ")
        clock = ": the dock's clock is off" if reason in ("future", "too old") else ""
        return f"{text}: {count} refused, {reason}{clock}"
