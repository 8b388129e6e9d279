"""Held fast at the dock: fixes that stay where they are while the propeller drives the vehicle on."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from auvsim.base.reading import Reading
from auvsim.missions.fixes import FixSource
from auvsim.vehicles.library import Structure

DRIVEN = 8.0  # time of driving between two fixes that must move a free vehicle [s]
SETTLED = 5.0  # time after the thrust turns from which it counts as driving [s]
MOVED = 1.0  # distance between two fixes of a vehicle that is held [m]
NEAR = 3.0  # distance from the mouth within which there is anything to hold it [m]


class DockShape(NamedTuple):
    """What of a dock tells whether a nose is inside."""

    mouth_radius: float  # [m]
    throat_radius: float  # [m]
    cone_length: float  # [m]
    transceiver: tuple[float, float, float]  # from the mouth: forward, starboard, down [m]


class JamWatch:
    """Looks at the dock's fixes for a vehicle that is held.

    Args:
        dock: Its shape.
        ahead: Distance of the nose from the vehicle's transponder, along the vehicle [m].
    """

    def __init__(self, dock: DockShape, ahead: float) -> None:
        self._dock, self._ahead = dock, ahead
        self._sign, self._since = 0, -math.inf  # of the thrust, and since when
        self._anchor: tuple[float, tuple[float, ...]] | None = None  # stamp and place of a fix that may be held

    def driven(self, time: float, speed: float) -> None:
        """Takes the speed through the water that is commanded [m/s]."""
        sign = (speed > 0.0) - (speed < 0.0)
        if sign != self._sign:
            self._sign, self._since, self._anchor = sign, time, None

    def observe(self, readings: Sequence[Reading], off: float) -> str | None:
        """Where the vehicle is held, in words; None: it is not, as far as one knows.

        Args:
            readings: New ones.
            off: Heading from the dock's axis [rad].
        """
        for reading in readings:
            if reading.sensor != "usbl" or reading.stamp < self._since + SETTLED or not self._sign:
                continue
            place = tuple(a + b for a, b in zip(reading.value[:3].tolist(), self._dock.transceiver, strict=True))
            if math.hypot(*place) > NEAR + self._ahead:
                self._anchor = None
            elif self._anchor is None or math.dist(place, self._anchor[1]) > MOVED:
                self._anchor = reading.stamp, place
            elif reading.stamp - self._anchor[0] >= DRIVEN:
                self._anchor = None
                return self._where(place, off)
        return None

    def _where(self, place: Sequence[float], off: float) -> str:
        along, cross = place[0] + self._ahead * math.cos(off), place[1] + self._ahead * math.sin(off)
        d = self._dock
        width = d.mouth_radius - (d.mouth_radius - d.throat_radius) * min(max(along / d.cone_length, 0.0), 1.0)
        inside = along > 0.0 and math.hypot(cross, place[2]) < width
        side = "in" if inside else "beside"
        return f"jammed {side} the funnel: the nose at {along:+.1f} m, {math.hypot(cross, place[2]):.1f} m off the axis"


def jam_watch(dock: Structure, nose: float, sources: Sequence[FixSource]) -> JamWatch | None:
    """The watch over a vehicle that a dock's USBL serves; None without one.

    Args:
        dock: The one to dock at.
        nose: Of the vehicle, forward of its transponder [m].
        sources: Of its fixes.
    """
    mount = next((source.mount for source in sources if source.bearing), None)
    if mount is None:
        return None
    return JamWatch(DockShape(dock.mouth_radius, dock.throat_radius, dock.cone_length, mount), nose)
