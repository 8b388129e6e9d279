"""The water that all modems share: packets travel while both ends move, overlap, drown in noise, or are received."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from numpy.random import Generator
from pydantic import Field

from auvsim.acoustics import propagation
from auvsim.acoustics.medium import Medium
from auvsim.acoustics.message import Message
from auvsim.acoustics.presets import Modem
from auvsim.base.frames import Array
from auvsim.base.randomness import Noise
from auvsim.base.settings import Settings

EARLY = 0.9  # share of a first guess of a travel time before which nothing arrives: two ends close in below 75 m/s
DELIVERED = "delivered"


class ChannelSettings(Settings):
    """Noise, spreading and collisions."""

    noise_level: float | None = Field(
        default=None, description="density of the noise; none: by wind and shipping [dB re 1 uPa^2/Hz]"
    )
    wind: float = Field(default=5.0, ge=0.0, description="wind over the surface, which makes noise [m/s]")
    shipping: float = Field(default=0.5, ge=0.0, le=1.0, description="shipping activity, which makes noise [-]")
    spreading: float = Field(default=1.5, ge=0.0, le=4.0, description="spreading: 2 spherical, 1 cylindrical [-]")
    fading: float = Field(default=0.0, ge=0.0, description="spread of received levels, sd, drawn a packet [dB]")
    dropout_probability: float = Field(default=0.0, ge=0.0, le=1.0, description="share lost for no reason [-]")
    capture: float = Field(
        default=10.0, ge=0.0, description="level above all that overlap it with which a packet survives [dB]"
    )

    def noise_in(self, modem: Modem) -> float:
        """Level of the noise in a modem's band [dB re 1 uPa]."""
        density = self.noise_level
        if density is None:
            density = propagation.noise_density(modem.frequency, self.wind, self.shipping)
        return density + propagation.to_decibel(modem.bandwidth)

    def received_level(self, modem: Modem, distance: float) -> float:
        """Level of a modem's sound at a distance [m], without fading [dB re 1 uPa]."""
        return modem.source_level - propagation.transmission_loss(distance, modem.frequency, self.spreading)

    def success(self, modem: Modem, distance: float, bits: float) -> float:
        """Probability that a packet over a distance [m] is received where nothing fades or overlaps."""
        snr = self.received_level(modem, distance) - self.noise_in(modem)
        good = propagation.packet_success(snr, bits, modem.bandwidth, modem.bit_rate, modem.coding_gain)
        return (1.0 - self.dropout_probability) * good


class Instant(NamedTuple):
    """Where a modem's transducer is, and how its vehicle lies."""

    position: Array  # (3,) NED [m]
    rotation: Array  # (3, 3) body to NED


class Motion(Protocol):
    """How a transducer moves between the last two truths."""

    begin: float  # [s]
    end: float  # [s]

    def at(self, time: float) -> Instant:
        """Where it is at a time between them [s]."""
        ...


class Draws(NamedTuple):
    """Random numbers of one packet on one link; every packet takes the same number of them."""

    drop: float  # uniform
    bits: float  # uniform
    processing: float  # uniform
    fading: float  # standard normal
    timing: float  # standard normal
    bearing: float  # standard normal


@dataclass(slots=True, eq=False)
class Transmission:
    """A packet under way."""

    message: Message
    start: float  # of its first wave front [s]
    end: float  # of its last [s]
    origin: Array  # (3,) where the first left [m]
    last_origin: Array | None = None  # (3,) where the last left [m]; None before it has


@dataclass(slots=True, eq=False)
class Arrival:
    """A packet at one receiver."""

    transmission: Transmission
    receiver: str
    draws: Draws
    front: float = math.nan  # when its first wave front arrives [s]; NaN before it has
    tail: float = math.nan  # likewise its last
    level: float = -math.inf  # [dB re 1 uPa]
    instant: Instant | None = None  # of the receiver at `front`
    earliest: float = -math.inf  # before which the next of them cannot arrive [s]


@dataclass(slots=True)
class _Receiver:
    """What a modem hears and sends, as far as it matters for what is still to be decided."""

    heard: list[Arrival] = field(default_factory=list)  # whose first wave front has arrived
    sent: list[tuple[float, float]] = field(default_factory=list)  # begin and end of what it sends itself [s]


class Decided(NamedTuple):
    """A packet at a receiver whose fate is known."""

    arrival: Arrival
    fate: str  # delivered, or why it was lost


class SharedChannel:
    """Carries the packets of all modems.

    A packet is lost at a receiver that sends while it arrives ("transmitting"), whose noise flips one of its bits
    ("noise"), where other packets overlap it and it is not `capture` above their sum ("collision"), and for no reason
    with `dropout_probability` ("dropped"). It never arrives where no direct path leads ("no path").

    Args:
        medium: sound speed and the water's limits.
        settings: noise, spreading and collisions.
        modems: by name of vehicle.
        noise: gives the generator of a source of noise by name; each link, `acoustics/a>b`, has its own.
    """

    def __init__(
        self,
        medium: Medium,
        settings: ChannelSettings,
        modems: Mapping[str, Modem],
        noise: Callable[[str], Generator],
    ) -> None:
        self._medium, self._settings, self.modems = medium, settings, dict(modems)
        self._links = {
            (a, b): Noise(noise(f"acoustics/{a}>{b}")) for a in modems for b in modems if a != b
        }  # fmt: skip
        self._noise_levels = {name: settings.noise_in(modem) for name, modem in self.modems.items()}
        self._sounding: list[Transmission] = []  # whose last wave front has not left
        self._coming: list[Arrival] = []  # of which something has not arrived
        self._receivers = {name: _Receiver() for name in modems}

    @property
    def busy(self) -> bool:
        """Whether anything is under way."""
        return bool(self._coming or self._sounding)

    def transmit(self, message: Message, motions: Mapping[str, Motion]) -> list[Decided]:
        """Starts a packet at `message.sent`, within the time of the motions; returns where it is lost at once."""
        sender, start = message.source, message.sent
        end = start + self.modems[sender].duration(message.bits)
        transmission = Transmission(message, start, end, motions[sender].at(start).position)
        self._sounding.append(transmission)
        self._receivers[sender].sent.append((start, end))
        lost = []
        for name, modem in self.modems.items():
            if name == sender:
                continue
            noise = self._links[sender, name]
            arrival = Arrival(transmission, name, Draws(*noise.uniforms(3), *noise.normals(3)))
            time = self._medium.travel_time(transmission.origin, motions[name].at(start).position)
            if not modem.hears(self.modems[sender]):
                lost.append(Decided(arrival, "other band"))
            elif math.isnan(time):
                lost.append(Decided(arrival, "no path"))
            else:
                arrival.earliest = start + EARLY * time
                self._coming.append(arrival)
        return lost

    def advance(self, motions: Mapping[str, Motion]) -> list[Decided]:
        """What is decided at each receiver within the time of the motions, in order of time."""
        now = next(iter(motions.values())).end
        for transmission in self._sounding:
            if transmission.end <= now:
                motion = motions[transmission.message.source]
                transmission.last_origin = motion.at(max(transmission.end, motion.begin)).position
        self._sounding = [t for t in self._sounding if t.last_origin is None]
        decided = [self._front(a, motions) for a in self._coming if math.isnan(a.front) and a.earliest <= now]
        ended = [a for a in self._coming if not math.isnan(a.front) and a.earliest <= now and self._tail(a, motions)]
        decided += [Decided(a, self._fate(a)) for a in sorted(ended, key=lambda a: a.tail)]
        found = [d for d in decided if d is not None]
        if found:
            done = {id(d.arrival) for d in found}
            self._coming = [a for a in self._coming if id(a) not in done]
            self._forget()
        return found

    def under_way(self) -> list[Arrival]:
        """Packets whose fate is not known yet."""
        return list(self._coming)

    def _front(self, arrival: Arrival, motions: Mapping[str, Motion]) -> Decided | None:
        """Takes note of a first wave front that has arrived."""
        transmission, motion = arrival.transmission, motions[arrival.receiver]
        time = self._arrival(transmission.origin, transmission.start, motion)
        if math.isnan(time):
            return Decided(arrival, "no path")
        if time > motion.end:
            return None
        arrival.front, arrival.instant = time, motion.at(time)
        modem = self.modems[transmission.message.source]
        away = (arrival.instant.position - transmission.origin).tolist()
        arrival.level = self._settings.received_level(modem, math.hypot(*away))
        arrival.level += self._settings.fading * arrival.draws.fading
        arrival.earliest = time + EARLY * (transmission.end - transmission.start)
        self._receivers[arrival.receiver].heard.append(arrival)
        return None

    def _tail(self, arrival: Arrival, motions: Mapping[str, Motion]) -> bool:
        """Whether the last wave front has arrived."""
        transmission, motion = arrival.transmission, motions[arrival.receiver]
        if transmission.last_origin is None:
            return False
        time = self._arrival(transmission.last_origin, transmission.end, motion)
        if time > motion.end:
            return False
        # Where the ray has left the water meanwhile, the rest is as long as what was sent.
        arrival.tail = arrival.front + transmission.end - transmission.start if math.isnan(time) else time
        return True

    def _arrival(self, origin: Array, sent: float, motion: Motion) -> float:
        """When a wave front arrives, if within the motion; else a time after its end, or NaN."""
        place = motion.at(motion.end).position
        at_end = sent + self._medium.travel_time(origin, place)
        if not at_end <= motion.end:  # the way is monotonous in time, since nothing moves as fast as sound
            return at_end
        return self._medium.arrival(
            origin, sent, lambda t: motion.at(min(max(t, motion.begin), motion.end)).position, at_end
        )

    def _fate(self, arrival: Arrival) -> str:
        transmission, receiver = arrival.transmission, self._receivers[arrival.receiver]
        if any(begin < arrival.tail and end > arrival.front for begin, end in receiver.sent):
            return "transmitting"
        modem, settings = self.modems[transmission.message.source], self._settings
        snr = arrival.level - self._noise_levels[arrival.receiver]
        bits = transmission.message.bits
        good = propagation.packet_success(snr, bits, modem.bandwidth, modem.bit_rate, modem.coding_gain)
        if arrival.draws.bits >= good:
            return "noise"
        others = [
            propagation.from_decibel(other.level)
            for other in receiver.heard
            if other is not arrival and other.front < arrival.tail and not other.tail <= arrival.front
        ]
        if others and arrival.level - propagation.to_decibel(sum(others)) < settings.capture:
            return "collision"
        return "dropped" if arrival.draws.drop < settings.dropout_probability else DELIVERED

    def _forget(self) -> None:
        """Drops what overlaps nothing any more whose fate is open."""
        open_from = dict.fromkeys(self._receivers, math.inf)
        for arrival in self._coming:
            begin = arrival.transmission.start if math.isnan(arrival.front) else arrival.front
            open_from[arrival.receiver] = min(open_from[arrival.receiver], begin)
        for name, receiver in self._receivers.items():
            since = open_from[name]
            receiver.heard = [a for a in receiver.heard if not a.tail <= since]
            receiver.sent = receiver.sent[-1:] if since == math.inf else [s for s in receiver.sent if s[1] > since]
