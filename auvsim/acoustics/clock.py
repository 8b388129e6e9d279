"""A vehicle's clock: offset, drift and random walk against true time, and jumps."""

from numpy.random import Generator
from pydantic import Field

from auvsim.base.randomness import Noise
from auvsim.base.settings import Settings

GRID = 1.0  # at whose points the random walk is drawn; in between it is linear [s]


class ClockSettings(Settings):
    """The clock by which a vehicle's modem stamps what it sends and measures; sensors keep the time of the run.

    1 ppm is a temperature-compensated crystal; a chip-scale atomic clock or an oven keeps some 1e-3 ppm. At 1500 m/s
    a millisecond between two clocks is 1.5 m of one-way range.
    """

    offset: float = Field(default=0.0, description="ahead of true time at the start [s]")
    drift_ppm: float = Field(default=0.0, ge=-1e4, le=1e4, description="too fast, in 1e-6 [ppm]")
    walk: float = Field(default=0.0, ge=0.0, description="random walk of the offset as density [s/sqrt(s)]")
    jump: float = Field(default=0.0, description="by which it leaps forward once [s]")
    jump_time: float = Field(default=0.0, ge=0.0, description="when it does [s]")


class Clock:
    """Reads a clock at any time; what it shows depends on the time alone, not on when it was read before.

    Args:
        settings: its errors.
        generator: of its random walk.
    """

    def __init__(self, settings: ClockSettings, generator: Generator) -> None:
        self._s, self._noise, self._rate = settings, Noise(generator), 1e-6 * settings.drift_ppm
        self._walk = [0.0]  # at the points of the grid [s]

    def read(self, time: float) -> float:
        """What it shows [s] at a true time [s]."""
        s = self._s
        shown = time + s.offset + self._rate * time
        if s.jump and time >= s.jump_time:
            shown += s.jump
        return shown + self._walked(time) if s.walk else shown

    def when(self, shown: float, near: float) -> float:
        """The true time [s], near another, at which it shows a time [s]; between leaps."""
        return near + (shown - self.read(near)) / (1.0 + self._rate)

    def _walked(self, time: float) -> float:
        index = int(max(time, 0.0) / GRID)
        while len(self._walk) < index + 2:
            (draw,) = self._noise.normals(1)
            self._walk.append(self._walk[-1] + self._s.walk * GRID**0.5 * draw)
        before, after = self._walk[index : index + 2]
        return before + (after - before) * (max(time, 0.0) / GRID - index)
