"""Modems at places that are functions of time, for tests of the shared channel."""

import numpy as np

from auvsim.acoustics.channel import ChannelSettings, Instant, SharedChannel
from auvsim.acoustics.medium import Medium
from auvsim.acoustics.message import Message
from auvsim.acoustics.presets import Modem
from auvsim.base.randomness import stream

LOUD = Modem(
    bit_rate=500.0, preamble=0.0, frequency=25e3, bandwidth=5e3, source_level=190.0, coding_gain=10.0, processing=0.0,
    processing_jitter=0.0, timing_noise=0.0, bearing_noise_deg=None,
)  # fmt: skip
TICK = 0.1


class Way:
    """A motion given as a function of time."""

    def __init__(self, place, begin, end):
        self._place, self.begin, self.end = place, begin, end

    def at(self, time):
        assert self.begin - 1e-9 <= time <= self.end + 1e-9, "asked only between the last two truths"
        return Instant(np.array(self._place(time), dtype=float), np.eye(3))


def still(north, east=0.0, depth=50.0):
    return lambda time: (north, east, depth)


class Water:
    """A shared channel that is stepped in ticks."""

    def __init__(self, places, *, settings=None, medium=None, modem=LOUD, modems=None, seed=1):
        self.places = places
        self.channel = SharedChannel(
            medium or Medium(), settings or ChannelSettings(noise_level=0.0),
            modems or dict.fromkeys(places, modem), lambda name: stream(seed, 0, name),
        )  # fmt: skip
        self.tick = 0
        self.decided = []

    def run(self, messages, until, tick=TICK):
        """Sends messages, sorted by time, and gives all that is decided by a time."""
        waiting = sorted(messages, key=lambda m: m.sent)
        while self.tick * tick < until:
            begin, end = self.tick * tick, (self.tick + 1) * tick
            self.tick += 1
            if not self.channel.busy and (not waiting or waiting[0].sent > end):
                continue
            motions = {name: Way(place, begin, end) for name, place in self.places.items()}
            while waiting and waiting[0].sent <= end:
                self.decided += self.channel.transmit(waiting.pop(0), motions)
            if self.channel.busy:
                self.decided += self.channel.advance(motions)
        return self.decided


def packet(source, sent, bits=250, destination=None, sequence=0):
    return Message(source, destination, sent, "test", (), bits, sequence)


def fates(decided):
    """Fates by source, receiver and sequence."""
    return {
        (d.arrival.transmission.message.source, d.arrival.receiver, d.arrival.transmission.message.sequence): d.fate
        for d in decided
    }
