"""Messages between modems, and their fates."""

import math
from typing import Any, NamedTuple

from auvsim.base.reading import Reading


class Message(NamedTuple):
    """A message that one modem sends."""

    source: str  # who sends: a vehicle or structure, by name
    destination: str | None  # to whom; None: to all that hear it
    sent: float  # [s]; by the sender's clock, in what a modem delivers
    kind: str  # what the payload is: "usbl", "state", "pulse", "request", or of a mission's own
    payload: Any  # of modems a tuple of numbers
    bits: int = 0  # length of the packet; 0 where it does not matter
    sequence: int = 0  # counts what one modem sends; a packet that tells of an earlier pulse has the pulse's
    asks: str | None = None  # who is to reply at once
    answers: int | None = None  # sequence of the message that asked for this one


class UsblPacket(NamedTuple):
    """What a dock's USBL sends to a vehicle."""

    reading: Reading  # stamped by the dock's clock, received NaN
    occupant: str | None  # vehicle that the dock's latch holds


class Outgoing(NamedTuple):
    """A message that a mission wants its vehicle's modem to send."""

    kind: str
    payload: tuple[float, ...]
    destination: str | None = None  # None: to all
    bits: int | None = None  # length of the packet; None: by the numbers of the payload


class Delivery(NamedTuple):
    """A message that arrived, with the range and bearing that the receiver's modem measured.

    Range and bearing are those of the sender when the message was sent, seen from the receiver when its first wave
    front arrived.
    """

    message: Message
    received: float  # when it was handed over, decoded [s]
    range: float | None = None  # by travel time, one way or, of an answer, two ways [m]
    bearing: float | None = None  # in the receiver's body axes, clockwise from its bow [rad]
    arrived: float = math.nan  # its first wave front, by the receiver's clock [s]


class Fate(NamedTuple):
    """Fate of a message to one receiver, for the log."""

    message: Message
    destination: str
    received: float  # of its first arrival [s]; NaN if it is lost
    fate: str  # delivered, or why it was lost
