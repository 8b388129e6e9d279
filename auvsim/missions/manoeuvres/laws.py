"""Manoeuvres from which a vehicle is identified: rudder and speed as functions of time and of the compass.

The trials of the ITTC (7.5-02-06-01) and the IMO (MSC.137(76)): straight, turning circle, zig-zag, spiral; and
excitations: multisine, pseudo-random binary sequence, any table.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import wrap
from auvsim.missions.manoeuvres.settings import (
    CircleSettings,
    ManoeuvreSettings,
    MultisineSettings,
    OptimalSettings,
    PrbsSettings,
    SequenceSettings,
    Simple,
    SpiralSettings,
    StraightSettings,
    TableSettings,
    ZigzagSettings,
)

# Feedback of registers whose sequence is as long as can be (Golomb 1967; as in MATLAB's idinput and most tables).
TAPS = {3: (3, 2), 4: (4, 3), 5: (5, 3), 6: (6, 5), 7: (7, 6), 8: (8, 6, 5, 4), 9: (9, 5), 10: (10, 7), 11: (11, 9)}

# Rudder [rad] at a time after the approach [s] and a change of heading [rad]; None: the course is held.
Law = Callable[[float, float], float | None]


class Order(NamedTuple):
    """Rudder or course, and speed, that a manoeuvre demands now."""

    course: float  # that is held where there is no rudder [rad]
    rudder: float | None  # effective rudder, positive to starboard [rad]
    speed: float  # straight ahead, whose shaft speed is asked for [m/s]
    part: str  # what is being done, for the log


class Part(NamedTuple):
    """One manoeuvre of a sequence."""

    start: float  # [s]
    settings: Simple


def parts(settings: ManoeuvreSettings, start: float = 0.0) -> Iterator[Part]:
    """The manoeuvres of a sequence with the times at which they start; of any other, itself."""
    if not isinstance(settings, SequenceSettings):
        yield Part(start, settings)
        return
    for part in settings.parts:
        yield from parts(part, start)
        start += part.duration


def name(settings: ManoeuvreSettings) -> str:
    """What a manoeuvre is called in files and tables: its kind, or the name of a table."""
    return settings.name if isinstance(settings, TableSettings) else settings.kind


def speeds(settings: ManoeuvreSettings) -> set[float]:
    """All speeds that a manoeuvre asks for [m/s]."""
    found = set()
    for _, part in parts(settings):
        found |= {part.speed, *part.speed_steps}
        if isinstance(part, OptimalSettings):
            found |= {part.slowest, part.fastest}
        if isinstance(part, TableSettings):
            found |= {point.speed for point in part.points if point.speed is not None}
    return found


class Steering:
    """Steers a manoeuvre: gives its orders in time.

    Args:
        settings: the manoeuvre.
        limit: largest effective rudder [rad].
        rate: orders a second [Hz].
        course: of the first approach [rad].

    Raises:
        InputError: it asks for more rudder than the fins have, or changes faster than orders are given.
    """

    def __init__(self, settings: ManoeuvreSettings, *, limit: float, rate: float, course: float) -> None:
        self.duration = settings.duration
        self._parts = list(parts(settings))
        self._laws = [law(part.settings, limit, rate) for part in self._parts]
        self._current, self._course = 0, course

    def order(self, time: float, heading: float) -> Order:
        """The order at a time [s] and a measured heading [rad]; times must not decrease."""
        while self._current + 1 < len(self._parts) and time >= self._parts[self._current + 1].start - 1e-9:
            self._current += 1
            self._course = heading
        start, settings = self._parts[self._current]
        since = time - start - settings.approach + 1e-9  # times are sums of steps: at a switch they may be short of it
        if since < 0.0:
            return Order(self._course, None, settings.speed, f"{name(settings)}: approach")
        rudder = self._laws[self._current](since, wrap(heading - self._course))
        return Order(self._course, rudder, speed_at(settings, since), name(settings))


def speed_at(settings: Simple, since: float) -> float:
    """The speed asked for at a time after the approach [m/s]."""
    if isinstance(settings, TableSettings):
        given = [point.speed for point in settings.points if point.time <= since and point.speed is not None]
        return given[-1] if given else settings.speed
    if not settings.speed_steps:
        return settings.speed
    return settings.speed_steps[int(since / settings.step_time) % len(settings.speed_steps)]


def law(settings: Simple, limit: float, rate: float) -> Law:
    """The rudder of a manoeuvre as a function of time after the approach [s] and change of heading [rad].

    Args:
        settings: the manoeuvre.
        limit: largest effective rudder [rad].
        rate: how often the rudder is asked for [Hz].

    Raises:
        InputError: it asks for more rudder than `limit`, or changes faster than `rate` can follow.
    """

    def within(rudder_deg: float) -> float:
        if abs(rudder_deg) > math.degrees(limit) + 1e-9:
            text = f"rudder {rudder_deg:g} deg is beyond the fins' {math.degrees(limit):.4g} deg"
            raise InputError(f"manoeuvre {settings.kind}: {text}")
        return math.radians(rudder_deg)

    match settings:
        case StraightSettings():
            return lambda since, change: None
        case CircleSettings():
            held = limit if settings.rudder_deg is None else within(settings.rudder_deg)
            return lambda since, change: held
        case ZigzagSettings():
            switch = math.radians(settings.heading_deg)
            return _Zigzag(switch, min(switch, limit) if settings.rudder_deg is None else within(settings.rudder_deg))
        case MultisineSettings():
            if settings.highest >= 0.5 * rate:
                raise InputError(
                    f"manoeuvre multisine: highest {settings.highest:g} Hz must be below half the control rate, "
                    f"{0.5 * rate:g} Hz"
                )
            return multisine(settings.lowest, settings.highest, within(settings.rudder_deg))
        case PrbsSettings():
            if settings.clock < 1.0 / rate:
                raise InputError(
                    f"manoeuvre prbs: clock {settings.clock:g} s must be at least a control period, {1.0 / rate:g} s"
                )
            sides, rudder = binary_sequence(settings.order), within(settings.rudder_deg)
            return lambda since, change: rudder * sides[int(since / settings.clock) % len(sides)]
        case SpiralSettings():
            rudders = [within(rudder) for rudder in settings.rudders_deg]
            return lambda since, change: rudders[min(int(since / settings.hold), len(rudders) - 1)]
        case TableSettings():
            given = [within(point.rudder_deg) for point in settings.points]
            fastest = math.inf if settings.rudder_rate_deg is None else math.radians(settings.rudder_rate_deg) / rate
            return _Table([point.time for point in settings.points], given, fastest)
        case OptimalSettings():
            raise InputError("manoeuvre optimal: is designed before it is run; use `auvsim manoeuvre optimal`")


class _Zigzag:
    """Rudder to starboard until the heading has changed by `switch` [rad], then to port until as much, and so on."""

    def __init__(self, switch: float, rudder: float) -> None:
        self._switch, self._rudder, self._side = switch, rudder, 1.0

    def __call__(self, since: float, change: float) -> float:
        if self._side * change >= self._switch:
            self._side = -self._side
        return self._side * self._rudder


class _Table:
    """Rudders [rad] from times [s] on, that change by at most `step` [rad] from order to order."""

    def __init__(self, times: list[float], rudders: list[float], step: float) -> None:
        self._times, self._rudders, self._step = times, rudders, step
        self._rudder = 0.0

    def __call__(self, since: float, change: float) -> float:
        wanted = self._rudders[bisect_right(self._times, since) - 1]
        self._rudder += max(-self._step, min(self._step, wanted - self._rudder))
        return self._rudder


def multisine(lowest: float, highest: float, peak: float) -> Law:
    """Sum of equal sines at the multiples of `lowest` up to `highest` [Hz], scaled to `peak` [rad].

    Phases as in Schroeder (1970), eq. 11 for a flat spectrum: phi_k = -pi k (k - 1) / n.
    """
    numbers = np.arange(1, math.floor(highest / lowest + 1e-9) + 1)
    phases = -math.pi * numbers * (numbers - 1) / len(numbers)
    frequencies = 2.0 * math.pi * lowest * numbers
    # Forty points in a period of the highest: their largest value is within 0.3 % of the true peak.
    grid = np.arange(0.0, 1.0 / lowest, 1.0 / (40.0 * lowest * numbers[-1]))
    scale = peak / np.abs(np.cos(np.outer(grid, frequencies) + phases).sum(axis=1)).max()
    return lambda since, change: max(-peak, min(peak, scale * float(np.cos(frequencies * since + phases).sum())))


def binary_sequence(order: int) -> list[int]:
    """A maximum-length sequence of +1 and -1 (2^order - 1 of them) from a shift register of `order` bits."""
    register = [1] * order
    sequence = []
    for _ in range(2**order - 1):
        sequence.append(2 * register[-1] - 1)
        register = [sum(register[tap - 1] for tap in TAPS[order]) % 2, *register[:-1]]
    return sequence
