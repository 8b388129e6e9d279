"""Ways round a dock, in its frame: to a gate, about a gate while something is waited for, out of the funnel."""

import math

from auvsim.missions.docking.relative import Relative

CLEAR = 4.0  # distance that the go-around keeps from the entrance [m]
BESIDE = 3.0  # distance from the axis at which the vehicle would pass the dock [m]
ABEAM = (-5.0, 40.0)  # detour round the dock: along the axis and to either side of it [m]
BEFORE = 40.0  # distance before the entrance from which the path to a gate is clear [m]
ORBIT = 30.0  # radius of the circle about a gate [m]


def on_line(x: float, y: float, turned: float) -> tuple[float, float]:
    """A point on a line through the mouth that is turned off the axis by an angle [rad], in the dock's frame [m].

    Args:
        x: Along the line [m].
        y: To starboard of it [m].
        turned: Of the line, clockwise [rad].
    """
    cos, sin = math.cos(turned), math.sin(turned)
    return x * cos - y * sin, x * sin + y * cos


def course_to(here: Relative, point: tuple[float, float]) -> float:
    """Course over ground [rad] straight to a point of the dock's frame."""
    return here.axis + math.atan2(point[1] - here.cross, point[0] - here.along)


def orbit(here: Relative, centre: tuple[float, float], side: float) -> float:
    """Course over ground [rad] on to a circle about a point of the dock's frame, clockwise if `side` is 1."""
    x, y = here.along - centre[0], here.cross - centre[1]
    distance = math.hypot(x, y)
    inward = math.atan((distance - ORBIT) / ORBIT)
    return here.axis + math.atan2(y, x) + side * (0.5 * math.pi + inward)


def room_to_turn(here: Relative, radius: float) -> tuple[float, bool]:
    """The side to which a vehicle before the dock turns, 1 to starboard, and whether it can with a turning radius [m].

    A torpedo cannot be steered astern for long: the farther it has turned off, the less room it needs.
    """
    off = here.off
    side = math.copysign(1.0, here.cross + radius * math.sin(off))
    turned = max(-math.pi / 2, min(math.pi / 2, side * off))
    return side, abs(here.cross) > radius or here.along < -CLEAR - radius * (1.0 - math.sin(turned))
