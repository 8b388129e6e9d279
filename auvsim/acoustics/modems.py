"""All modems of a run: they send by medium access, the shared channel carries, they measure what they receive."""

import heapq
import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from numpy.random import Generator
from pydantic import Field

from auvsim.acoustics.access import AccessSettings, FreeSettings, PollingSettings, Slots, TdmaSettings
from auvsim.acoustics.channel import DELIVERED, ChannelSettings, Decided, Motion, SharedChannel
from auvsim.acoustics.clock import Clock, ClockSettings
from auvsim.acoustics.medium import SLOWEST, Medium
from auvsim.acoustics.message import Delivery, Fate, Message, Outgoing
from auvsim.acoustics.modem import ModemSettings, TellSettings
from auvsim.acoustics.motion import Segment, Still
from auvsim.acoustics.payload import NUMBERS, REQUEST, STATE, StateReport, packet_bits
from auvsim.acoustics.station import Station
from auvsim.base.errors import InputError
from auvsim.base.randomness import Noise
from auvsim.physics.truth import Truth

UNDER_WAY = "under way"


class SoundSettings(ChannelSettings):
    """The water in which modems talk, and their medium access."""

    sound_speed: float = Field(
        default=1500.0, ge=1000.0, le=2000.0, description="sound speed at the surface [m/s of sound]"
    )
    sound_speed_gradient: float = Field(
        default=0.0, ge=-1.0, le=1.0, description="change of the sound speed with depth [1/s]"
    )
    access: AccessSettings = Field(default=FreeSettings(), description="Medium access, by its `kind`.")

    def medium(self, floor: Callable[[float, float], float], deepest: float = 0.0) -> Medium:
        """The water.

        Args:
            floor: depth of the sea floor [m] at north, east [m].
            deepest: depth at which there must be a sound speed [m].

        Raises:
            InputError: the sound speed falls to nothing.
        """
        if self.sound_speed + self.sound_speed_gradient * deepest < SLOWEST:
            raise InputError(
                f"network.sound_speed_gradient: {self.sound_speed_gradient:g} 1/s leaves less than {SLOWEST:g} m/s "
                f"at {deepest:g} m; use less"
            )
        return Medium(self.sound_speed, self.sound_speed_gradient, floor)


class Equipment(NamedTuple):
    """A modem and its clock, of a vehicle or at a place."""

    modem: ModemSettings
    clock: ClockSettings
    place: tuple[tuple[float, float, float], float] | None = None  # where it stays: NED [m], heading [rad]
    key: str = ""  # dotted, of its settings; "": of a vehicle's


class Modems:
    """The modems of a run.

    Args:
        stations: by name of vehicle, or of what stays where it is.
        channel: what carries their packets.
        places: of those that stay: position (3,) NED [m] and heading [rad].
    """

    def __init__(
        self,
        stations: Mapping[str, Station],
        channel: SharedChannel,
        places: Mapping[str, tuple[tuple[float, float, float], float]] | None = None,
    ) -> None:
        self.stations, self._channel, self._places = dict(stations), channel, dict(places or {})
        self._queues: dict[str, list[tuple[float, int, Delivery]]] = {name: [] for name in stations}
        self._stamped: dict[int, Message] = {}  # messages under way as they were stamped, by the true one's identity
        self._count = 0

    def post(self, name: str, outgoing: Outgoing) -> Fate | None:
        """Takes a message of a vehicle's mission; its fate where it cannot even be sent."""
        to = outgoing.destination
        if name in self.stations and (to is None or to in self.stations):
            self.stations[name].post(outgoing)
            return None
        message = Message(name, to, math.nan, outgoing.kind, outgoing.payload)
        return Fate(message, to or "", math.nan, "no modem")

    def advance(self, previous: Mapping[str, Truth], now: Mapping[str, Truth]) -> list[Fate]:
        """Lets all send and receive between two truths; returns the fates decided, with true times."""
        sent, begin, end = [], next(iter(previous.values())).time, next(iter(now.values())).time
        for station in self.stations.values():
            sent += station.begins(begin, end)
        if not sent and not self._channel.busy:
            return []
        motions: dict[str, Motion] = {name: Still(*place, begin, end) for name, place in self._places.items()}
        for name, station in self.stations.items():
            if name not in motions:
                motions[name] = Segment(previous[name], now[name], station.settings.transducer)
        decided = []
        for message in sorted(sent, key=lambda m: m.sent):
            self._stamped[id(message)] = self.stations[message.source].stamped(message)
            decided += self._channel.transmit(message, motions)
        decided += self._channel.advance(motions)
        fates = [fate for found in decided for fate in self._take(found, end)]
        if not self._channel.busy:
            self._stamped.clear()
        return fates

    def deliver(self, receiver: str, now: float) -> list[Delivery]:
        """What a modem hands over by now [s], in order."""
        queue, arrived = self._queues.get(receiver, []), []
        while queue and queue[0][0] <= now:
            arrived.append(heapq.heappop(queue)[2])
        return arrived

    def under_way(self) -> list[Fate]:
        """Packets of which nobody knows yet what becomes of them."""
        return [
            Fate(arrival.transmission.message, arrival.receiver, math.nan, UNDER_WAY)
            for arrival in self._channel.under_way()
            if arrival.transmission.message.destination in (None, arrival.receiver)
        ]

    def _take(self, decided: Decided, now: float) -> list[Fate]:
        """The fate of a packet at one receiver, and of the reply it asked for if there will be none."""
        arrival, fate = decided
        message, receiver = arrival.transmission.message, arrival.receiver
        if message.destination not in (None, receiver):
            return []
        if fate != DELIVERED:
            return [Fate(message, receiver, math.nan, fate)]
        station = self.stations[receiver]
        turn_around = self.stations[message.source].settings.turn_around
        delivery = station.heard(arrival, self._stamped[id(message)], turn_around)
        if receiver not in self._places:  # where nobody reads it
            heapq.heappush(self._queues[receiver], (delivery.received, self._count, delivery))
        self._count += 1
        fates = [Fate(message, receiver, delivery.received, DELIVERED)]
        if message.asks == receiver and (why := station.answer(arrival, now)):
            reply = Message(receiver, message.source, arrival.front, STATE, (), answers=message.sequence)
            fates.append(Fate(reply, message.source, math.nan, f"not sent: {why}"))
        return fates


def build_modems(
    sound: SoundSettings,
    equipment: Mapping[str, Equipment],
    medium: Medium,
    noise: Callable[[str], Generator],
    report: Callable[[str, float, float], StateReport | None],
    period: float,
) -> Modems | None:
    """The modems of a run; None if there are none.

    Args:
        sound: noise, losses and medium access.
        equipment: by name of vehicle, structure or beacon.
        medium: sound speed and the water's limits.
        noise: gives the generator of a source of noise by its full name.
        report: gives a vehicle's own estimate: of its name, the true time and the stamp for it.
        period: between two looks of a modem [s].

    Raises:
        InputError: slots are too short, a turn-around time is, or there is no modem of a name.
    """
    if not equipment:
        return None
    access, names = sound.access, [*equipment]
    slots: dict[str, Slots] = {}
    if isinstance(access, TdmaSettings):
        order = _order(access, names)
        _check_slots(access, sound, {n: e.modem for n, e in equipment.items()})
        slots = {name: Slots(k, len(order), access.slot) for k, name in enumerate(order)}
    polling = access if isinstance(access, PollingSettings) else None
    if polling:
        _known(polling.master, names, "network.access.master")
    _check_replies(equipment, polling, period)
    stations = {}
    for name, (settings, clock, *_) in equipment.items():
        tell = settings.tell
        if polling:
            own = polling.period if name == polling.master else None
            tell = TellSettings(period=own, phase=polling.phase) if own else TellSettings()
        stations[name] = Station(
            name,
            settings,
            Clock(clock, noise(f"{name}/clock")),
            Noise(noise(f"{name}/modem")),
            lambda time, stamp, name=name: report(name, time, stamp),
            tell=tell,
            slots=slots.get(name),
            polls=tuple(n for n in names if n != name) if polling and name == polling.master else (),
            asks=polling is None,
        )
    channel = SharedChannel(medium, sound, {n: e.modem.modem for n, e in equipment.items()}, noise)
    return Modems(stations, channel, {n: e.place for n, e in equipment.items() if e.place})


def _order(access: TdmaSettings, names: list[str]) -> tuple[str, ...]:
    order = access.order or tuple(names)
    for name in order:
        _known(name, names, "network.access.order")
    if sorted(order) != sorted(names):
        raise InputError(f"network.access.order: {', '.join(order)} must name each modem once: {', '.join(names)}")
    return order


def _check_slots(access: TdmaSettings, sound: SoundSettings, modems: Mapping[str, ModemSettings]) -> None:
    for name, settings in modems.items():
        longest = settings.modem.duration(packet_bits(NUMBERS[STATE]))
        needed = longest + access.reach / sound.sound_speed
        if access.slot < needed:
            raise InputError(
                f"network.access.slot: {access.slot:g} s is too short for a packet of '{name}' ({longest:.2f} s) and "
                f"{access.reach:g} m of travel; use {math.ceil(100.0 * needed) / 100.0:g} s"
            )


def _check_replies(equipment: Mapping[str, Equipment], polling: PollingSettings | None, period: float) -> None:
    """Sees that who is asked has time to decode the question before it must reply."""
    asked = []
    if polling:
        asked = [(polling.master, name, STATE) for name in equipment if name != polling.master]
    else:
        for name, (settings, *_) in equipment.items():
            if settings.ask.whom is not None:
                key = f"{equipment[name].key or f'vehicles.{name}.modem'}.ask.whom"
                _known(settings.ask.whom, [*equipment], key)
                if settings.ask.whom == name:
                    raise InputError(f"{key}: '{name}' cannot ask itself; name another, or none")
                asked.append((name, settings.ask.whom, REQUEST))
    for asks, name, kind in asked:
        modem, settings = equipment[asks].modem.modem, equipment[name].modem
        own = settings.modem
        needed = modem.duration(packet_bits(NUMBERS[kind])) + own.processing + own.processing_jitter + period
        if settings.turn_around < needed:
            raise InputError(
                f"vehicles.{name}.modem.turn_around: {settings.turn_around:g} s is too short to decode the question of "
                f"'{asks}'; use {math.ceil(100.0 * needed) / 100.0:g} s"
            )


def _known(name: str, names: list[str], key: str) -> None:
    if name not in names:
        raise InputError(f"{key}: no modem on '{name}'; there are {', '.join(names)}")
