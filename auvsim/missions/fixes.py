"""What tells a vehicle where it is: places, rates and errors of its ranges and its dock's fixes, by their settings."""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from auvsim.acoustics.link import AcousticSettings
from auvsim.acoustics.usbl import UsblSettings
from auvsim.sensors.range import RangeSettings

Place = tuple[float, float, float]  # north, east, depth [m]


class FixSource(NamedTuple):
    """A beacon that is ranged to, or a dock's USBL."""

    place: Place
    interval: float  # mean time between two that arrive [s]
    deviation: Callable[[float], float]  # of a range [m] at a distance [m]
    bearing: bool = False  # whether it tells the direction too, as well across as along
    maximum: float = math.inf  # distance beyond which nothing is heard [m]
    mount: Place = (0.0, 0.0, 0.0)  # of a USBL's transceiver in the dock's axes, from its mouth [m]


def fix_sources(
    sensors: Iterable[Any], usbl: tuple[UsblSettings, Place] | None, link: AcousticSettings
) -> tuple[FixSource, ...]:
    """The sources of a vehicle; constant errors and outliers are left out, lost fixes make the interval longer.

    Args:
        sensors: Settings of the sensors on board.
        usbl: Settings of the one that serves the vehicle, and the place of its dock's mouth; None: none does.
        link: From the dock.
    """
    found = [
        FixSource(s.beacon, _interval(1.0 / s.rate, s.dropout_probability), lambda d, s=s: s.noise, maximum=s.maximum)
        for s in sensors
        if isinstance(s, RangeSettings)
    ]
    if usbl is not None:
        s, dock = usbl
        interval = _interval(s.interval, link.dropout_probability)
        reach = s.maximum_range or math.inf
        found.append(FixSource(dock, interval, s.sigma, bearing=True, maximum=reach, mount=s.transceiver))
    return tuple(found)


def _interval(period: float, lost: float) -> float:
    return period / (1.0 - lost) if lost < 1.0 else math.inf
