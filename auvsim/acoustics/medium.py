"""Sound in the water: travel time with a uniform sound speed or one that changes linearly with depth, in closed form.

In a linear sound speed c(z) = c0 + g z rays are arcs of circles about the depth at which c would be zero, and the
travel time between two points a distance d apart, with sound speeds c1 and c2, is acosh(1 + g^2 d^2 / (2 c1 c2)) / |g|
(Jensen, Kuperman, Porter, Schmidt 2011, sec. 3.3).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

SLOWEST = 100.0  # least sound speed anywhere in the water [m/s]
EXACT = 1e-10  # of an arrival [s]

Point = Any  # (3,) north, east, depth [m]: an array or a tuple


@dataclass(frozen=True, slots=True)
class Medium:
    """Sound speed in depth, and where the water ends."""

    surface_speed: float = 1500.0  # c0, at the surface [m/s]
    gradient: float = 0.0  # g, of the sound speed with depth [1/s]
    floor: Callable[[float, float], float] = lambda north, east: math.inf  # depth of the sea floor [m]

    def sound_speed(self, depth: float) -> float:
        """Sound speed at a depth [m/s]."""
        return self.surface_speed + self.gradient * depth

    def travel_time(self, a: Point, b: Point) -> float:
        """Time of the direct path between two points [s]; NaN where there is none.

        There is none where the ray would leave the water, through the surface or into the sea floor, or where a point
        is out of the water.
        """
        (na, ea, da), (nb, eb, db) = a, b
        distance = math.sqrt((nb - na) ** 2 + (eb - ea) ** 2 + (db - da) ** 2)
        if da < 0.0 or db < 0.0:
            return math.nan
        g = self.gradient
        if g == 0.0:
            return distance / self.surface_speed
        c1, c2 = self.sound_speed(da), self.sound_speed(db)
        if min(c1, c2) < SLOWEST or not self._stays_in_water(a, b):
            return math.nan
        # acosh(1 + x) for a small x, where 1 + x would lose it
        x = g * g * distance * distance / (2.0 * c1 * c2)
        return math.log1p(x + math.sqrt(x * (x + 2.0))) / abs(g)

    def turning_point(self, a: Point, b: Point) -> tuple[float, float, float] | None:
        """Where the ray between two points is level [m]; None if nowhere between them."""
        g, (na, ea, da), (nb, eb, db) = self.gradient, a, b
        across = math.hypot(nb - na, eb - ea)
        if g == 0.0 or across == 0.0:
            return None
        centre_depth = -self.surface_speed / g
        ra, rb = da - centre_depth, db - centre_depth  # both on one side of the centre
        along = (across * across + rb * rb - ra * ra) / (2.0 * across)  # of the centre, from a towards b
        if not 0.0 < along < across:
            return None
        share, radius = along / across, math.hypot(along, ra)
        return na + share * (nb - na), ea + share * (eb - ea), centre_depth + math.copysign(radius, ra)

    def arrival(self, origin: Point, sent: float, place: Callable[[float], Point], guess: float) -> float:
        """When a wave front reaches a receiver that moves [s]: t - sent = travel time to place(t); NaN if it does not.

        A fixed point, contracting by the receiver's speed over that of sound, which the receiver must stay below.

        Args:
            origin: where it was sent.
            sent: when [s].
            place: of the receiver at a time [s].
            guess: of the arrival [s].
        """
        time = guess
        for _ in range(50):
            previous, time = time, sent + self.travel_time(origin, place(time))
            if not abs(time - previous) > EXACT:  # NaN ends it, too
                break
        return time

    def _stays_in_water(self, a: Point, b: Point) -> bool:
        turning = self.turning_point(a, b)
        if turning is None:
            return True
        north, east, depth = turning
        return 0.0 <= depth <= self.floor(north, east)
