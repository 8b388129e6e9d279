"""The acoustic link from dock to vehicle: packets arrive late, out of order, twice or never."""

import heapq
import math

from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.acoustics.message import Delivery, Fate, Message
from auvsim.base.randomness import Noise
from auvsim.base.settings import Settings


class AcousticSettings(Settings):
    """Delays and losses of the link.

    A packet arrives `delay + per_metre * range` after its stamp, give or take `jitter`. The fixed part is processing
    and packet length; 0.002 s/m is three travels of sound: query, answer, packet.
    """

    delay: float = Field(default=1.5, ge=0.0, description="fixed delay [s]")
    per_metre: float = Field(default=0.002, ge=0.0, description="delay in proportion to range [s/m]")
    jitter: float = Field(default=0.1, ge=0.0, description="half width of the delay's uniform distribution [s]")
    dropout_probability: float = Field(default=0.05, ge=0.0, le=1.0, description="share of packets lost [-]")
    late_probability: float = Field(default=0.02, ge=0.0, le=1.0, description="share of packets held back [-]")
    late_delay: float = Field(default=6.5, ge=0.0, description="extra delay of those; > ping interval reorders [s]")
    duplicate_probability: float = Field(default=0.0, ge=0.0, le=1.0, description="share that arrives twice [-]")
    clock_offset: float = Field(default=0.0, description="dock clock ahead of the vehicle's; shifts the stamps [s]")

    @model_validator(mode="after")
    def _causal(self) -> "AcousticSettings":
        if self.jitter > self.delay:
            raise ValueError(f"jitter is {self.jitter} s, it must not exceed the delay, {self.delay} s")
        return self


class Channel:
    """A queue of messages in transit to one receiver; each takes 5 uniforms, whether it is lost or not."""

    def __init__(self, settings: AcousticSettings, generator: Generator) -> None:
        self._settings = settings
        self._noise = Noise(generator)
        self._queue: list[tuple[float, int, Message]] = []
        self._count = 0  # breaks ties of arrival in the order sent

    def send(self, message: Message, slant_range: float, *, lost: bool = False) -> Fate:
        """Sends a message over a distance [m]; `lost`: never sent, being out of reach."""
        settings, to = self._settings, message.destination or ""
        drop, jitter, late, twice, gap = self._noise.uniforms(5)
        if lost:
            return Fate(message, to, math.nan, "out of range")
        if drop < settings.dropout_probability:
            return Fate(message, to, math.nan, "dropped")
        delay = settings.delay + settings.per_metre * slant_range + settings.jitter * (2.0 * jitter - 1.0)
        if late < settings.late_probability:
            delay += settings.late_delay
        received = message.sent + delay
        self._push(received, message)
        if twice < settings.duplicate_probability:  # the copy follows within one late_delay
            self._push(received + gap * settings.late_delay, message)
        return Fate(message, to, received, "delivered")

    def receive(self, now: float) -> list[Delivery]:
        """Takes the messages that have arrived by now [s] out of the queue, in order of arrival."""
        arrived = []
        while self._queue and self._queue[0][0] <= now:
            received, _, message = heapq.heappop(self._queue)
            arrived.append(Delivery(message, received))
        return arrived

    def _push(self, received: float, message: Message) -> None:
        heapq.heappush(self._queue, (received, self._count, message))
        self._count += 1
