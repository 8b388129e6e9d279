"""The acoustic link from dock to vehicle: packets arrive late, out of order, twice or never."""

import heapq
import math
from dataclasses import dataclass

from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.base.randomness import Noise
from auvsim.base.reading import Reading
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


@dataclass(frozen=True, kw_only=True, slots=True)
class Packet:
    """What became of one reading that was sent."""

    reading: Reading  # as delivered: stamp by the dock's clock, received at the (first) arrival or NaN if lost
    lost: bool


class Channel:
    """A queue of packets on their way; each takes 5 uniforms, whether it is lost or not."""

    def __init__(self, settings: AcousticSettings, generator: Generator) -> None:
        self._settings = settings
        self._noise = Noise(generator)
        self._queue: list[tuple[float, int, Reading]] = []
        self._count = 0  # breaks ties of arrival in the order sent

    def send(self, reading: Reading, slant_range: float, *, lost: bool = False) -> Packet:
        """Sends a reading at its stamp over a distance [m]; `lost` marks what was never there to send."""
        settings = self._settings
        drop, jitter, late, twice, gap = self._noise.uniforms(5)
        stamp = reading.stamp + settings.clock_offset
        if lost or drop < settings.dropout_probability:
            return Packet(reading=reading._replace(stamp=stamp, received=math.nan), lost=True)
        delay = settings.delay + settings.per_metre * slant_range + settings.jitter * (2.0 * jitter - 1.0)
        if late < settings.late_probability:
            delay += settings.late_delay
        sent = reading._replace(stamp=stamp, received=reading.stamp + delay)
        self._push(sent)
        if twice < settings.duplicate_probability:  # the copy follows within one late_delay
            self._push(sent._replace(received=sent.received + gap * settings.late_delay))
        return Packet(reading=sent, lost=False)

    def receive(self, now: float) -> list[Reading]:
        """Takes the readings that have arrived by now [s] out of the queue, in order of arrival."""
        arrived = []
        while self._queue and self._queue[0][0] <= now:
            arrived.append(heapq.heappop(self._queue)[2])
        return arrived

    def _push(self, reading: Reading) -> None:
        heapq.heappush(self._queue, (reading.received, self._count, reading))
        self._count += 1
