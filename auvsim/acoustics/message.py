"""Messages between modems, and their fates."""

from typing import Any, NamedTuple

from auvsim.base.reading import Reading


class Message(NamedTuple):
    """A message that one modem sends."""

    source: str  # who sends: a vehicle or structure, by name
    destination: str | None  # to whom; None: to all that hear it
    sent: float  # [s]
    kind: str  # what the payload is: "usbl"
    payload: Any
    bits: int = 0  # length of the packet; 0 where it does not matter


class UsblPacket(NamedTuple):
    """What a dock's USBL sends to a vehicle."""

    reading: Reading  # stamped by the dock's clock, received NaN
    occupant: str | None  # vehicle that the dock's latch holds


class Delivery(NamedTuple):
    """A message that arrived, with the range and bearing that the receiver's modem measured."""

    message: Message
    received: float  # [s]
    range: float | None = None  # by travel time [m]
    bearing: float | None = None  # in the receiver's body axes, clockwise from its bow [rad]


class Fate(NamedTuple):
    """Fate of a message to one receiver, for the log."""

    message: Message
    destination: str
    received: float  # of its first arrival [s]; NaN if it is lost
    fate: str  # delivered, or why it was lost
