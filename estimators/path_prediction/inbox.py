"""What a modem hands on is judged before a follower sees it: what it should not see is refused by name, and counted."""

import math
from collections import Counter

import numpy as np

from estimators.core import loops
from estimators.core.history import outcome
from estimators.core.screening import Limits, Screen
from estimators.core.types import NO_MODEL, Gaussian, Measurement, Outcome
from estimators.path_prediction.follower import Follower
from estimators.path_prediction.messages import Packet, Pulse

SIZES = {"range": (1, 1), "bearing": (1, 1), "range_bearing": (2, 2), "packet": (5, 3)}  # of value and covariance
SIMULTANEOUS = 1e-3  # stamps closer than this are the same [s]
REMEMBERED = 256  # messages of a kind by which duplicates are known


class Inbox:
    """A follower behind a gate for pulses and packets, and for its own clock.

    A pulse is a `Measurement` of kind "range", "bearing" or "range_bearing", its stamp the emission, `received` the
    detection. A packet is of kind "packet": north, east, heading, speed, yaw rate, with the pose's covariance. Both
    bear the pulse's number as `sequence` and the leader's name as `source`.

    Reasons: "no_model", another kind; "wrong_vehicle"; "truncated", sizes or a number missing; "not_finite";
    "not_positive_definite"; "clock", a stamp that does not fit the number; "future", received after now or before it
    was sent; "too_old"; "duplicate"; "impossible" and "spike", see `screening.Screen`. Of the follower's own clock:
    "clock_back", a tick that is not later than the last, which is left out, and "clock_gap", which is bridged.

    Args:
        follower: That hears.
        leader: Name of the vehicle it listens to.
        period: Of the pulses; that of number n leaves at n periods [s].
        keep: Age up to which messages are used [s].
        farthest: Range that no leader can have [m].
        closing: Fastest change of the range [m/s].
        longest_step: Time between ticks above which the clock has jumped [s].
    """

    def __init__(
        self,
        follower: Follower,
        *,
        leader: str,
        period: float = 10.0,
        keep: float = 120.0,
        farthest: float = 10_000.0,
        closing: float = 10.0,
        longest_step: float = 5.0,
    ) -> None:
        self.follower, self._leader, self._period, self._keep = follower, leader, period, keep
        self._screen = Screen(Limits(low=0.0, high=farthest, rate=closing, noise=100.0))
        self._longest = longest_step
        self._known: dict[tuple[str, int], None] = {}
        self.refused: Counter[str] = Counter()

    @property
    def belief(self) -> Gaussian:
        """The follower's pose."""
        return self.follower.belief

    def tick(self, time: float, speed: float, yaw_rate: float) -> None:
        """Moves the follower on with its odometry; a sample that is no number counts as "not_finite" and as none."""
        if not math.isfinite(time) or time <= self.follower.time:
            self.refused["clock_back"] += 1
            return
        if not (math.isfinite(speed) and math.isfinite(yaw_rate)):
            self.refused["not_finite"] += 1
            return  # the next sample bridges it
        if time - self.follower.time > self._longest:
            self.refused["clock_gap"] += 1
        while self.follower.time < time:
            self.follower.advance(min(time, self.follower.time + self._longest), speed, yaw_rate)

    def take(self, measurement: Measurement) -> Outcome:
        """Hands a message on, if there is no reason against it, at the follower's time."""
        reason = self._reason(measurement)
        if reason:
            self.refused[reason] += 1
            return outcome(measurement, reason)
        number = measurement.sequence or 0
        self._known[measurement.kind, number] = None
        if len(self._known) > REMEMBERED:
            del self._known[next(iter(self._known))]
        m, v, C = measurement, measurement.value, measurement.covariance
        if m.kind == "packet":
            self.follower.receive(Packet(number, m.stamp, m.received, v[:3].copy(), C, float(v[3]), float(v[4])))
        else:
            pulse = Pulse(number, m.stamp, m.received)
            if m.kind != "bearing":
                pulse = pulse._replace(range=float(v[0]), range_variance=float(C[0, 0]))
            if m.kind != "range":
                pulse = pulse._replace(bearing=float(v[-1]), bearing_variance=float(C[-1, -1]))
            self.follower.hear(pulse)
        return outcome(measurement, "")

    def _reason(self, m: Measurement) -> str:
        sizes = SIZES.get(m.kind)
        if sizes is None:
            return NO_MODEL
        if m.source != self._leader:
            return "wrong_vehicle"
        if m.value.shape != sizes[:1] or m.covariance.shape != (sizes[1], sizes[1]) or m.sequence is None:
            return "truncated"
        if not (loops.is_finite(m.value, m.covariance) and math.isfinite(m.stamp) and math.isfinite(m.received)):
            return "not_finite"
        if np.abs(m.covariance - m.covariance.T).max() > 1e-9 * np.abs(m.covariance).max():
            return "not_positive_definite"
        if not loops.factor(m.covariance)[1]:
            return "not_positive_definite"
        now = self.follower.time + SIMULTANEOUS
        if abs(m.stamp - m.sequence * self._period) > SIMULTANEOUS:
            return "clock"
        if m.stamp > now or m.received > now or m.received < m.stamp:
            return "future"
        if m.stamp < now - self._keep:
            return "too_old"
        if (m.kind, m.sequence) in self._known:
            return "duplicate"
        return self._screen.judge(m.stamp, float(m.value[0])) if m.kind in ("range", "range_bearing") else ""
