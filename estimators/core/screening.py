"""One gate for every scalar sensor: values no filter should see are refused by name, before any model sees them."""

import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass

from estimators.core.errors import ParameterError


@dataclass(frozen=True, kw_only=True, slots=True)
class Limits:
    """What a healthy sensor can show."""

    low: float = -math.inf  # values outside are impossible
    high: float = math.inf
    rate: float = math.inf  # fastest change [unit/s]; what jumps faster is a spike
    noise: float = 0.0  # change beyond that rate that its noise explains [unit]
    frozen: float = math.inf  # time in which a live sensor changes at least once [s]
    period: float | None = None  # of an angle, 2 pi, so that a turn is no jump

    def __post_init__(self) -> None:
        if not (self.low < self.high and self.rate > 0.0 and self.noise >= 0.0 and self.frozen > 0.0):
            raise ParameterError(f"limits {self} must have low < high, and rate and frozen above 0")


LARGEST = sys.float_info.max


def judge(screens: Iterable["Screen"], stamp: float, values: Iterable[float]) -> str:
    """The reason to refuse a reading of several components at a stamp [s], each with its screen; "" if there is none.

    All of them are shown to their screens, since each remembers what it was shown.
    """
    reason, known = "", stamp <= LARGEST
    for screen, value in zip(screens, values, strict=False):
        if known and screen._lowest <= value <= screen._highest and stamp > screen._latest:  # the common case, cheaply
            screen._latest = stamp
        else:
            found = screen.judge(stamp, value)
            reason = reason or found
    return reason


class Screen:
    """Judges the values of one scalar sensor, in order of arrival.

    Reasons: "not_finite"; "impossible", outside its limits; "clock", a stamp that is no later than the one before;
    "spike", farther from the last good value than the sensor's rate allows in the time since; "frozen", the same value
    for longer than a live sensor keeps it. What a spike is compared with is given up after two values in a row that
    agree with each other: then it was the last good one that was wrong, or the vehicle was moved.
    """

    def __init__(self, limits: Limits) -> None:
        self._low, self._high, self._frozen = limits.low, limits.high, limits.frozen
        self._rate, self._noise, self._period = limits.rate, limits.noise, limits.period
        self._stamp, self._value = -math.inf, math.nan  # the last good one
        self._doubtful: tuple[float, float] | None = None  # the last spike
        self._changed = -math.inf  # since when the sensor has shown `_shown`
        self._shown = math.nan
        self._latest = -math.inf  # stamp
        self._remembers = limits.rate < math.inf or limits.frozen < math.inf  # else no value depends on those before
        # Finite values between these need no further look, if it remembers nothing.
        self._lowest = math.inf if self._remembers else max(limits.low, -LARGEST)
        self._highest = min(limits.high, LARGEST)

    def judge(self, stamp: float, value: float) -> str:
        """The reason to refuse a value that was true at `stamp` [s]; "" if there is none."""
        if not (math.isfinite(value) and math.isfinite(stamp)):
            return "not_finite"
        if not self._low <= value <= self._high:
            return "impossible"
        if stamp <= self._latest:
            return "clock"
        self._latest = stamp
        if not self._remembers:
            return ""
        if value != self._shown:
            self._shown, self._changed = value, stamp
        elif stamp - self._changed > self._frozen:
            return "frozen"
        if self._jumps(stamp, value, self._stamp, self._value):
            doubtful, self._doubtful = self._doubtful, (stamp, value)
            if doubtful is None or self._jumps(stamp, value, *doubtful):
                return "spike"
        self._stamp, self._value, self._doubtful = stamp, value, None
        return ""

    def _jumps(self, stamp: float, value: float, before: float, last: float) -> bool:
        change = value - last
        if self._period is not None:
            change = math.remainder(change, self._period)
        return abs(change) > self._noise + self._rate * (stamp - before)  # False of the first: NaN
