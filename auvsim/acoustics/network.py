"""The acoustic network: messages sent at a time, delivered at their physical arrival or not at all."""

import math
from collections.abc import Iterable, Mapping
from typing import Protocol

from auvsim.acoustics.message import Delivery, Fate, Message
from auvsim.acoustics.modems import Modems
from auvsim.physics.truth import Truth


class Link(Protocol):
    """What carries messages to one receiver."""

    def send(self, message: Message, slant_range: float, *, lost: bool = False) -> Fate:
        """Takes a message over a distance [m]; `lost`: never sent, being out of reach."""
        ...

    def receive(self, now: float) -> list[Delivery]:
        """Takes out what has arrived by now [s], in order of arrival."""
        ...


class Ping(Protocol):
    """A message of a service, handed to the network."""

    @property
    def message(self) -> Message:
        """To be sent."""
        ...

    @property
    def slant_range(self) -> float:
        """True distance to the receiver [m]."""
        ...

    @property
    def lost(self) -> bool:
        """Out of reach: there is nothing to send."""
        ...


class Service(Protocol):
    """A sender that acts by itself, such as a dock's USBL."""

    vehicle: str  # name of the one that it serves

    def poll(self, previous: Truth, now: Truth) -> Iterable[Ping]:
        """Messages sent between two consecutive true states of the vehicle."""
        ...


class Network:
    """Links to each receiver with the services that use them, and modems that share the water.

    Services and modems work in bands of their own: neither disturbs the other.

    Args:
        links: what carries messages of services, by the receiver's name.
        services: what sends by itself.
        modems: of the vehicles that have one.
    """

    def __init__(
        self, links: Mapping[str, Link], services: Iterable[Service] = (), modems: Modems | None = None
    ) -> None:
        self._links, self._services, self.modems = dict(links), tuple(services), modems

    def poll(self, previous: Mapping[str, Truth], now: Mapping[str, Truth]) -> list[tuple[Ping, Fate]]:
        """Lets every service send what it has between two truths, with the fate of each."""
        sent = []
        for service in self._services:
            for ping in service.poll(previous[service.vehicle], now[service.vehicle]):
                receiver = ping.message.destination
                assert receiver is not None
                sent.append((ping, self._links[receiver].send(ping.message, ping.slant_range, lost=ping.lost)))
        return sent

    def send(self, message: Message, ranges: Mapping[str, float]) -> list[Fate]:
        """Sends a message to its destination, or to all whose distance [m] is given.

        A receiver without a link does not hear it, which is its fate.
        """
        to = ranges if message.destination is None else {message.destination: ranges[message.destination]}
        fates = []
        for receiver, distance in to.items():
            link = self._links.get(receiver)
            fate = link.send(message, distance) if link else Fate(message, receiver, math.nan, "no modem")
            fates.append(fate._replace(destination=receiver))
        return fates

    def deliver(self, receiver: str, now: float) -> list[Delivery]:
        """What has arrived at a receiver by now [s], in order of arrival; what modems deliver comes last."""
        link = self._links.get(receiver)
        arrived = link.receive(now) if link else []
        return arrived + self.modems.deliver(receiver, now) if self.modems else arrived
