"""One vehicle's modem in a run: when it sends what, and what it measures of what it receives."""

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from auvsim.acoustics.access import Slots
from auvsim.acoustics.channel import Arrival
from auvsim.acoustics.clock import Clock
from auvsim.acoustics.message import Delivery, Message, Outgoing
from auvsim.acoustics.modem import ModemSettings, TellSettings
from auvsim.acoustics.payload import PULSE, REQUEST, STATE, StateReport, packet_bits
from auvsim.base.randomness import Noise

REMEMBERED = 8  # requests without a reply that are kept

Report = Callable[[float, float], StateReport | None]  # (true time, stamp) -> estimate of the vehicle; None before any


class Due(NamedTuple):
    """What is to be sent, and when."""

    time: float  # true [s]
    kind: str
    destination: str | None = None
    payload: tuple[float, ...] | None = None  # None: of what is told, composed when it is sent
    bits: int | None = None  # None: by the numbers of the payload
    sequence: int | None = None  # None: the next
    asks: str | None = None
    answers: int | None = None


class Repeated:
    """Times at which something is sent again and again, by a modem's clock.

    Args:
        period: between two [s].
        phase: time of the first [s].
        jitter: half width of their spread [s].
        random: whether times between two are exponential.
        slots: that each must wait for; None: no need.
        noise: of jitter and randomness; one uniform a time.
    """

    def __init__(
        self, period: float, phase: float, jitter: float, random: bool, slots: Slots | None, noise: Noise
    ) -> None:
        self._period, self._jitter, self._random, self._slots, self._noise = period, jitter, random, slots, noise
        self._nominal = phase
        self.next = self._draw()

    def pop(self) -> float:
        """The time that is due [s]; the next one follows."""
        due = self.next
        self.next = self._draw()
        return due

    def _draw(self) -> float:
        (draw,) = self._noise.uniforms(1)
        if self._random:
            self._nominal -= self._period * math.log1p(-draw)
            wanted = self._nominal
        else:
            wanted = self._nominal + self._jitter * (2.0 * draw - 1.0)
            self._nominal += self._period
        return self._slots.take(wanted) if self._slots else wanted


class Station:
    """A vehicle's modem.

    Args:
        name: of the vehicle.
        settings: of its modem.
        clock: of the vehicle.
        noise: of its own timing.
        report: gives the vehicle's own estimate.
        tell: what it tells and when, which medium access may have changed.
        slots: in which it may send; None: at any time.
        polls: whom it asks in turn as it tells.
    """

    def __init__(
        self,
        name: str,
        settings: ModemSettings,
        clock: Clock,
        noise: Noise,
        report: Report,
        *,
        tell: TellSettings | None = None,
        slots: Slots | None = None,
        polls: tuple[str, ...] = (),
        asks: bool = True,
    ) -> None:
        self.name, self.settings, self.modem, self.clock = name, settings, settings.modem, clock
        self._report, self._slots, self._polls = report, slots, polls
        self._tell = settings.tell if tell is None else tell
        ask = settings.ask
        self._telling = self._asking = None
        if self._tell.period is not None:
            t = self._tell
            self._telling = Repeated(self._tell.period, t.phase, t.jitter, t.random, slots, noise)
        if asks and ask.whom is not None:
            self._asking = Repeated(ask.period, ask.phase, ask.jitter, False, slots, noise)
        self._due: list[Due] = []
        self._outbox: deque[Outgoing] = deque()
        self._sequence = self._polled = 0
        self._free_at = -math.inf  # when it has sent what it sends [s]
        self._asked: dict[int, float] = {}  # when, by its clock, by sequence [s]

    def post(self, outgoing: Outgoing) -> None:
        """Takes a message of the mission, to be sent as soon as medium access allows."""
        self._outbox.append(outgoing)

    def begins(self, since: float, until: float) -> list[Message]:
        """The messages that it begins to send in (since, until] [s], with the true time as `sent`."""
        shown = self.clock.read(until)
        while self._telling and self._telling.next <= shown:
            self._tell_at(self.clock.when(self._telling.pop(), until))
        while self._asking and self._asking.next <= shown:
            time = self.clock.when(self._asking.pop(), until)
            self._due.append(Due(time, REQUEST, self.settings.ask.whom, (), asks=self.settings.ask.whom))
        while self._outbox:
            out = self._outbox.popleft()
            time = self.clock.when(self._slots.take(shown), until) if self._slots else until
            self._due.append(Due(time, out.kind, out.destination, out.payload, out.bits))
        if not self._due:
            return []
        sent = []
        self._due.sort(key=lambda due: due.time)
        while self._due and max(self._due[0].time, self._free_at) <= until:
            due = self._due.pop(0)
            message = self._compose(due, max(due.time, self._free_at, math.nextafter(since, math.inf)))
            if message is not None:
                self._free_at = message.sent + self.modem.duration(message.bits)
                sent.append(message)
        return sent

    def stamped(self, message: Message) -> Message:
        """A message as it was stamped: `sent` by this modem's clock."""
        return message._replace(sent=self.clock.read(message.sent))

    def heard(self, arrival: Arrival, message: Message, turn_around: float) -> Delivery:
        """What the modem says of a packet that it received.

        Args:
            arrival: of the packet.
            message: as its sender stamped it.
            turn_around: of the sender, where it answers [s].
        """
        settings, modem, draws = self.settings, self.modem, arrival.draws
        arrived = self.clock.read(arrival.front + modem.timing_noise * draws.timing)
        decoded = arrival.tail + modem.processing + modem.processing_jitter * (2.0 * draws.processing - 1.0)
        distance = settings.sound_speed * (arrived - message.sent) if settings.one_way else None
        asked = self._asked.pop(message.answers, None) if message.answers is not None else None
        if asked is not None and message.destination == self.name:
            distance = 0.5 * settings.sound_speed * (arrived - asked - turn_around)
        bearing = None
        if modem.bearing_noise_deg is not None and arrival.instant is not None:
            to_sender = arrival.transmission.origin - arrival.instant.position
            forward, starboard, _ = (to_sender @ arrival.instant.rotation).tolist()
            error = settings.bearing_bias_deg + modem.bearing_noise_deg * draws.bearing
            bearing = math.remainder(math.atan2(starboard, forward) + math.radians(error), math.tau)
        return Delivery(message, decoded, distance, bearing, arrived)

    def answer(self, arrival: Arrival, now: float) -> str:
        """Prepares the reply to a message that asks for one; "" or why there will be none.

        Args:
            arrival: of that message.
            now: time up to which everything has happened [s].
        """
        begin = arrival.front + self.modem.timing_noise * arrival.draws.timing + self.settings.turn_around
        message = arrival.transmission.message
        if begin <= now:
            return "the reply would be late"
        if self._free_at > begin or any(due.answers is not None for due in self._due):
            return "it sends already"
        destination = message.source
        self._due.append(Due(begin, STATE, destination, answers=message.sequence))
        return ""

    def _tell_at(self, time: float) -> None:
        asks = None
        if self._polls:
            asks = self._polls[self._polled % len(self._polls)]
            self._polled += 1
        if self._tell.delay == 0.0:
            self._due.append(Due(time, STATE, asks=asks))
            return
        stamp = self.clock.read(time)
        report = self._report(time, stamp)
        if report is not None:
            self._sequence += 1
            self._due.append(Due(time, PULSE, payload=(), sequence=self._sequence, asks=asks))
            self._due.append(Due(time + self._tell.delay, STATE, payload=report, sequence=self._sequence))

    def _compose(self, due: Due, time: float) -> Message | None:
        """The message of something due at a time [s]; None where there is nothing to tell yet."""
        payload = self._report(time, self.clock.read(time)) if due.payload is None else due.payload
        if payload is None:
            return None
        sequence = due.sequence
        if sequence is None:
            self._sequence += 1
            sequence = self._sequence
        if due.kind == REQUEST:
            self._asked[sequence] = self.clock.read(time)
            for old in list(self._asked)[:-REMEMBERED]:
                del self._asked[old]
        bits = packet_bits(len(payload)) if due.bits is None else due.bits
        return Message(self.name, due.destination, time, due.kind, payload, bits, sequence, due.asks, due.answers)
