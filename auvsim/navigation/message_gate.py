"""The gate for messages: what no modem of another vehicle can have sent is refused by name, before anyone reads it."""

import math
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from auvsim.acoustics.message import Delivery, Message
from auvsim.acoustics.payload import NUMBERS, STATE
from estimators.core.types import Outcome

MESSAGE = "message"  # kind of the outcomes
REMEMBERED = 64  # messages of a sender among which a duplicate is recognised
LATEST = 0.01  # by which a message may seem to arrive before it was sent, as clocks differ [s]
SLOWEST_SOUND = 1400.0  # [m/s]
CLOSING = 10.0  # fastest change of a distance between two vehicles [m/s]
CLOCKS = 0.02  # change between two messages that clocks and arrival times explain [s]
LONGEST = 60.0  # longest travel time [s]
BACK = 0.1  # sum of leaps below which the clocks agree as before: what moved meanwhile is in it [s]


@dataclass(slots=True)
class _Sender:
    """What is remembered of one sender."""

    known: deque[tuple[str, int]] = field(default_factory=lambda: deque(maxlen=REMEMBERED))
    arrived: float = math.nan  # of the last message whose clocks could be compared [s]
    travel: float = math.nan  # how long it seemed to travel [s]
    leapt: float = 0.0  # sum of the leaps of the clocks so far [s]


class MessageGate:
    """Judges messages, in order of arrival.

    Reasons: "unknown_source", a sender that has no modem, or oneself; "wrong_vehicle", addressed to another;
    "truncated", another number of numbers than its kind has; "not_finite"; "duplicate"; "future", sent or true after it
    arrived; "impossible", so early that it cannot still have been under way; "clock_jump", one of the two clocks has
    leapt, for as long as it has not leapt back: its time says nothing any more, and neither does a range by it.

    Args:
        name: Of the vehicle that receives.
        others: Names of those that have a modem.
    """

    def __init__(self, name: str, others: Collection[str]) -> None:
        self._name, self._senders = name, {other: _Sender() for other in others if other != name}
        self.refused: dict[str, int] = {}  # in a row, by sender

    def judge(self, delivery: Delivery) -> str:
        """Why a message is to be refused; "" if it is not."""
        message = delivery.message
        sender = self._senders.get(message.source)
        if sender is None:
            return "unknown_source"
        if message.destination not in (None, self._name):
            return "wrong_vehicle"
        if reason := _malformed(message):
            return reason
        if (message.kind, message.sequence) in sender.known:
            return "duplicate"
        sender.known.append((message.kind, message.sequence))
        return _clock(sender, delivery)

    def passed(self, deliveries: Sequence[Delivery]) -> tuple[list[Delivery], list[Outcome]]:
        """Those that may be heard, and the fates of the others."""
        good, refused = [], []
        for delivery in deliveries:
            reason = self.judge(delivery)
            if reason:
                m = delivery.message
                stamp = m.sent if math.isfinite(m.sent) else delivery.received
                refused.append(Outcome(MESSAGE, m.source, stamp, m.sequence, False, reason, math.nan))
                self.refused[m.source] = self.refused.get(m.source, 0) + 1
            else:
                good.append(delivery)
        return good, refused


def _malformed(message: Message) -> str:
    payload, wanted = message.payload, NUMBERS.get(message.kind)
    if not isinstance(payload, tuple) or (wanted is not None and len(payload) != wanted):
        return "truncated"
    numbers = (message.sent, *payload)
    if not all(isinstance(number, int | float) and math.isfinite(number) for number in numbers):
        return "not_finite"
    return ""


def _clock(sender: _Sender, delivery: Delivery) -> str:
    message, arrived = delivery.message, delivery.arrived
    travel = arrived - message.sent
    before, since = sender.travel, arrived - sender.arrived
    sender.travel, sender.arrived = travel, arrived
    change = travel - before
    if abs(change) > CLOCKS + CLOSING / SLOWEST_SOUND * abs(since):  # False of the first: NaN
        sender.leapt += change
    if message.kind == STATE and message.payload[0] > message.sent + LATEST:
        return "future"
    if travel < -LATEST:
        return "future"
    if not travel <= LONGEST:
        return "impossible"
    return "clock_jump" if abs(sender.leapt) > BACK else ""
