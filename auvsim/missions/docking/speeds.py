"""Speeds and courses by the current: how fast through the water, and along which line to the entrance."""

import math

from auvsim.base.frames import wrap
from auvsim.missions.line_of_sight import heading_for_course

SLOWEST = 0.1  # speed over ground that is reckoned with at least [m/s]


def approach_course(axis: float, speed: float, current: tuple[float, float], limit: float) -> float:
    """Course over ground of the approach line [rad]: the axis, or turned to keep the heading within `limit` of it.

    Args:
        axis: course of the dock's axis [rad].
        speed: through the water [m/s].
        current: north, east [m/s].
        limit: largest angle between heading and axis [rad].
    """
    heading = heading_for_course(axis, speed, current)
    offset = wrap(heading - axis)
    if abs(offset) <= limit:
        return axis
    heading = axis + math.copysign(limit, offset)
    return math.atan2(speed * math.sin(heading) + current[1], speed * math.cos(heading) + current[0])


def in_current(course: float, current: tuple[float, float]) -> tuple[float, float]:
    """A current (north, east) along a course [rad] and across it to starboard [m/s]."""
    cos, sin = math.cos(course), math.sin(course)
    return current[0] * cos + current[1] * sin, current[1] * cos - current[0] * sin


def speed_through_water(
    least: float, axis: float, current: tuple[float, float], ground_speed: float, crab: float, fastest: float = math.inf
) -> float:
    """Least speed through the water that leaves a speed over ground along an axis, at no more than a crab angle [m/s].

    To go along the axis at `g` over ground takes (g - c_along, -c_across) through the water, and an angle off the axis
    whose sine is the current across by the speed.

    Args:
        least: What it is without a current [m/s].
        axis: [rad].
        current: North, east [m/s].
        ground_speed: Along the axis [m/s].
        crab: Largest angle between heading and axis [rad].
        fastest: That the vehicle can hold [m/s].
    """
    along, across = in_current(axis, current)
    floor = math.hypot(max(ground_speed - along, 0.0), across)
    return min(max(least, floor, abs(across) / math.sin(crab)), fastest)


def ground_speed_along(line: float, speed: float, current: tuple[float, float]) -> float:
    """Speed over ground [m/s] along a course [rad] that is held against a current; 0 or less where it cannot be."""
    along, across = in_current(line, current)
    if abs(across) >= speed:
        return along - speed
    return math.sqrt(speed * speed - across * across) + along


def way_through_water(distance: float, line: float, speed: float, current: tuple[float, float]) -> float:
    """Way through the water [m] of a distance over ground [m] along a course [rad].

    Args:
        distance: [m].
        line: The course [rad].
        speed: Through the water [m/s].
        current: North, east [m/s].
    """
    return distance * speed / max(ground_speed_along(line, speed, current), SLOWEST)


def fastest(holds, slowest: float = 0.2, highest: float = 8.0) -> float:
    """The highest speed through the water [m/s] that a vehicle can hold, to a centimetre per second.

    Args:
        holds: Whether it can hold a speed [m/s].
        slowest: That it surely can [m/s].
        highest: That no one asks for [m/s].
    """
    if holds(highest):
        return highest
    while highest - slowest > 0.01:
        middle = 0.5 * (slowest + highest)
        slowest, highest = (middle, highest) if holds(middle) else (slowest, middle)
    return slowest
