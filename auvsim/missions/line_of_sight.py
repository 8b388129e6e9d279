"""Headings and courses against a current, and guidance along a line by line of sight (Fossen 2021, sec. 12.3)."""

import math


def heading_for_course(course: float, speed: float, current: tuple[float, float]) -> float:
    """Heading [rad] whose course over ground is `course` [rad], or the nearest to it in too strong a current.

    Args:
        course: over ground [rad].
        speed: through the water [m/s].
        current: north, east [m/s].
    """
    across = current[1] * math.cos(course) - current[0] * math.sin(course)
    return course - math.asin(max(-0.95, min(0.95, across / speed)))


def cross_track(line: float, north: float, east: float) -> float:
    """Distance to starboard of a line of course `line` [rad] through the origin [m]."""
    return east * math.cos(line) - north * math.sin(line)


def course_to_line(line: float, error: float, lookahead: float) -> float:
    """Course [rad] that leads back to a line of course `line` [rad] from `error` [m] to starboard of it."""
    return line - math.atan2(error, lookahead)
