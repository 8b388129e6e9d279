"""An ultra-short-baseline system on the dock: it measures the vehicle and reports with its own attitude and depth.

The transceiver sits on the dock, the transponder on the vehicle (Qiu & Li 2019). Pings happen between control
ticks, so the vehicle is interpolated to the time of each ping.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field, field_validator, model_validator

from auvsim.acoustics.message import Message, UsblPacket
from auvsim.acoustics.motion import interpolate
from auvsim.base.frames import Array, rotation, wrap
from auvsim.base.randomness import Noise
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import StructurePose, Truth

Vector = tuple[float, float, float]
BITS = 8 * 16  # of a packet: seven numbers of 16 bits and the dock's state


class UsblSettings(Settings):
    """Timing, noise, outliers and lever arms of the USBL, and the errors of the dock's own compass and depth gauge.

    The noise table is the square root of the USBL variances in table 1 of Qiu & Li 2019.
    """

    enabled: bool = Field(default=True, description="whether a dock's USBL serves the vehicle")
    dock: str | None = Field(
        default=None, description="structure that serves the vehicle; none: its mission's dock, or the only one"
    )
    interval: float = Field(default=5.0, ge=0.05, description="mean time from ping to ping; the first is random [s]")
    jitter: float = Field(default=1.0, ge=0.0, description="half width of the interval's uniform distribution [s]")
    near_range: float | None = Field(default=None, gt=0.0, description="range below which to ping faster [m]")
    near_interval: float | None = Field(default=None, ge=0.05, description="mean interval there; jitter in ratio [s]")
    maximum_range: float | None = Field(default=None, gt=0.0, description="range beyond which pings are lost [m]")
    noise: tuple[tuple[float, float], ...] = Field(
        default=((12.0, 0.0067), (40.0, 0.0678), (100.0, 0.3390), (200.0, 0.4807)),
        min_length=1,
        description="range [m] and sd per axis [m]; log-log between, constant beyond",
    )
    noise_scale: float = Field(default=1.0, ge=0.0, description="factor on the noise table [-]")
    outlier_probability: float = Field(default=0.02, ge=0.0, le=1.0, description="share of outliers [-]")
    outlier_minimum: float = Field(default=10.0, ge=0.0, description="smallest extra error of an outlier [m]")
    outlier_maximum: float = Field(default=30.0, ge=0.0, description="largest extra error of an outlier [m]")
    burst_range: float | None = Field(
        default=None,
        gt=0.0,
        description="range at which a burst of one false position begins, each time it is passed [m]",
    )
    burst_duration: float = Field(
        default=15.0, ge=0.0, description="duration of a burst; the position is wrong as an outlier is [s]"
    )
    dock_heading_bias_deg: float = Field(default=0.3, ge=0.0, description="dock heading bias of a trial, sd [deg]")
    dock_tilt_bias_deg: float = Field(default=0.3, ge=0.0, description="dock pitch, roll bias of a trial, sd [deg]")
    dock_depth_noise: float = Field(default=0.02, ge=0.0, description="white noise of the dock's depth, sd [m]")
    dock_depth_bias: float = Field(default=0.05, ge=0.0, description="dock depth bias of a trial, sd [m]")
    transceiver: Vector = Field(default=(0.0, 0.0, -1.0), description="place in the dock's frame from its mouth [m]")
    transponder: Vector = Field(default=(0.0, 0.0, -0.1), description="place in the vehicle's body frame [m]")

    @field_validator("noise")
    @classmethod
    def _table(cls, table: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        ranges = [row[0] for row in table]
        if min(min(row) for row in table) <= 0.0:
            raise ValueError("ranges and standard deviations must be > 0; for no noise set noise_scale to 0")
        if any(far <= near for near, far in pairwise(ranges)):
            raise ValueError(f"the ranges are {ranges}, they must increase")
        return table

    @model_validator(mode="after")
    def _consistent(self) -> "UsblSettings":
        if self.jitter >= self.interval:
            raise ValueError(f"jitter is {self.jitter} s, it must be less than the interval, {self.interval} s")
        if (self.near_range is None) != (self.near_interval is None):
            raise ValueError("near_range and near_interval go together: give both or neither")
        if self.outlier_maximum < self.outlier_minimum:
            raise ValueError(f"outlier_maximum must be at least outlier_minimum, {self.outlier_minimum} m")
        return self

    def sigma(self, slant_range: float) -> float:
        """Standard deviation per axis [m] at a range [m]: log-log in the table, constant beyond its ends."""
        ranges, sigmas = ([math.log(number) for number in column] for column in zip(*self.noise, strict=True))
        x = math.log(slant_range) if slant_range > 0.0 else -math.inf
        if x <= ranges[0]:
            return self.noise_scale * math.exp(sigmas[0])
        if x >= ranges[-1]:
            return self.noise_scale * math.exp(sigmas[-1])
        index = bisect_right(ranges, x) - 1
        fraction = (x - ranges[index]) / (ranges[index + 1] - ranges[index])
        return self.noise_scale * math.exp(sigmas[index] + fraction * (sigmas[index + 1] - sigmas[index]))


@dataclass(frozen=True, kw_only=True, slots=True)
class Ping:
    """One measurement by the dock, before it is sent."""

    message: Message  # to the vehicle; with a `UsblPacket`
    slant_range: float  # true distance from transceiver to transponder [m]
    outlier: bool
    lost: bool  # out of range: there is nothing to send

    @property
    def reading(self) -> Reading:
        """What the dock measured."""
        return self.message.payload.reading


class Usbl:
    """Measures (7,): transponder from transceiver in the dock's frame, dock heading, pitch, roll, dock depth.

    The dock's true attitude turns the position; its measured attitude and depth, with biases that are constant in a
    trial, are what it reports. Each ping takes 7 normals and 3 uniforms, whatever becomes of it.
    """

    name = "usbl"
    value = Variable(
        ("packet",),
        "float64",
        "m, rad",
        "transponder x, y, z [m]; dock heading, pitch, roll [rad]; dock depth [m]",
        "dock",
    )
    sizes: ClassVar = {"packet": 7}
    columns: ClassVar = {
        "lost": Variable((), "bool", "1", "whether the packet never arrived"),
        "outlier": Variable((), "bool", "1", "whether the fix was drawn as an outlier"),
    }

    def __init__(
        self,
        settings: UsblSettings,
        generator: Generator,
        dock: StructurePose,
        *,
        vehicle: str = "",
        structure: str = "",
        clock_offset: float = 0.0,
        occupant: Callable[[], str | None] = lambda: None,
    ) -> None:
        """A USBL of a dock that serves one vehicle.

        Args:
            settings: timing, noise, lever arms.
            generator: of its noise.
            dock: where the dock truly is.
            vehicle: name of the one that it serves.
            structure: name of the dock.
            clock_offset: dock's clock ahead of the vehicle's [s]; shifts the stamps.
            occupant: says which vehicle the dock's latch holds now, if any.
        """
        self._settings = settings
        self.vehicle, self.structure = vehicle, structure
        self._clock_offset, self._occupant = clock_offset, occupant
        self._noise = Noise(generator)
        heading, pitch, roll, depth = self._noise.normals(4)
        heading_bias = math.radians(settings.dock_heading_bias_deg) * heading
        tilt_bias = math.radians(settings.dock_tilt_bias_deg)
        self._dock_attitude = (
            wrap(dock.heading + heading_bias),
            dock.pitch + tilt_bias * pitch,
            dock.roll + tilt_bias * roll,
        )
        self._dock_depth = dock.depth + settings.dock_depth_bias * depth
        self._to_dock = rotation(dock.roll, dock.pitch, dock.heading).T
        self._mouth = dock.position
        self._transceiver = np.array(settings.transceiver)
        self._transponder = np.array(settings.transponder)
        self._next = settings.interval * (1.0 - self._noise.uniforms(1)[0])  # phase in (0, interval]
        self._sequence = 0
        self._was_beyond = False  # whether the last ping was from beyond the range at which bursts begin
        self._burst: tuple[float, Array] = (-math.inf, np.zeros(3))  # its end [s] and the false position

    def poll(self, previous: Truth, now: Truth) -> list[Ping]:
        """The pings in (previous.time, now.time]; call it with every pair of consecutive truths.

        Raises:
            ValueError: If a ping fell before `previous.time`, because a pair was left out.
        """
        if now.time < self._next:
            return []
        if self._next <= previous.time:
            raise ValueError(f"polled from {previous.time} s, but the ping at {self._next} s was never polled")
        pings = []
        while self._next <= now.time:
            pings.append(self._ping(previous, now))
        return pings

    def _ping(self, previous: Truth, now: Truth) -> Ping:
        settings, time = self._settings, self._next
        position, turn = interpolate(previous, now, time)
        relative = self._to_dock @ (position + turn @ self._transponder - self._mouth) - self._transceiver
        slant_range = math.sqrt(float(relative @ relative))
        draws = self._noise.normals(7)
        chance, size, wait = self._noise.uniforms(3)
        measured = relative + settings.sigma(slant_range) * np.array(draws[:3])
        outlier = chance < settings.outlier_probability
        if outlier:
            direction = np.array(draws[3:6])  # a normalised normal vector is uniform on the sphere
            error = settings.outlier_minimum + size * (settings.outlier_maximum - settings.outlier_minimum)
            measured += error / math.sqrt(float(direction @ direction)) * direction
        if settings.burst_range is not None:
            measured, false = self._in_burst(time, slant_range, measured, draws[3:6], size)
            outlier = outlier or false
        depth = self._dock_depth + settings.dock_depth_noise * draws[6]
        value = np.array((*measured.tolist(), *self._dock_attitude, depth))
        reading = Reading("usbl", time + self._clock_offset, math.nan, value, self._sequence)
        message = Message(self.structure, self.vehicle, time, "usbl", UsblPacket(reading, self._occupant()), BITS)
        self._sequence += 1
        self._next = time + self._wait(slant_range, wait)
        lost = settings.maximum_range is not None and slant_range > settings.maximum_range
        return Ping(message=message, slant_range=slant_range, outlier=outlier, lost=lost)

    def _in_burst(
        self, time: float, slant_range: float, measured: Array, direction: list[float], size: float
    ) -> tuple[Array, bool]:
        """What is shown in place of a measured position, and whether it is the false one of a burst.

        A burst is a reflection from something fixed: all its pings show one place, off the vehicle's at its begin as an
        outlier is, horizontally.
        """
        settings = self._settings
        assert settings.burst_range is not None
        beyond = slant_range > settings.burst_range
        if self._was_beyond and not beyond and time >= self._burst[0]:
            level = np.array((*direction[:2], 0.0))
            step = settings.outlier_minimum + size * (settings.outlier_maximum - settings.outlier_minimum)
            self._burst = (time + settings.burst_duration, measured + step / np.linalg.norm(level) * level)
        self._was_beyond = beyond
        return (self._burst[1].copy(), True) if time < self._burst[0] else (measured, False)

    def _wait(self, slant_range: float, draw: float) -> float:
        settings = self._settings
        wait = settings.interval + settings.jitter * (2.0 * draw - 1.0)
        if settings.near_range is None or settings.near_interval is None or slant_range >= settings.near_range:
            return wait
        return wait * settings.near_interval / settings.interval
