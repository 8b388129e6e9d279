"""Settings of tracks, their waypoints, and the headings of those that are none of waypoints."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from auvsim.base.frames import Array, wrap
from auvsim.base.settings import Settings, tag_by_kind


class Waypoints(Settings):
    """Straight legs from point to point."""

    kind: Literal["waypoints"] = "waypoints"
    points: tuple[tuple[float, float], ...] = Field(
        default=((100.0, 0.0),), min_length=1, description="north, east of each point [m]"
    )


class LawnMower(Settings):
    """Parallel lanes in alternating directions."""

    kind: Literal["lawn_mower"] = "lawn_mower"
    corner: tuple[float, float] = Field(default=(0.0, 0.0), description="start of the first lane: north, east [m]")
    heading_deg: float = Field(default=0.0, description="course of the first lane, clockwise from north [deg]")
    length: float = Field(default=100.0, gt=0, description="length of a lane [m]")
    spacing: float = Field(default=30.0, gt=0, description="distance between lanes [m]")
    lanes: int = Field(default=4, ge=1, le=10_000, description="number of lanes")
    side: Literal["starboard", "port"] = Field(default="starboard", description="side of the other lanes")
    order: Literal["adjacent", "racetrack"] = Field(
        default="adjacent",
        description="one lane after the next, or the halves in turn: wide turns, neighbours in one direction",
    )


class Weave(Settings):
    """A heading that swings about a course and needs no position: course + amplitude sin(2 pi t / swing + phase)."""

    kind: Literal["weave"] = "weave"
    course_deg: float = Field(default=0.0, description="mean heading, clockwise from north [deg]")
    amplitude_deg: float = Field(default=40.0, ge=0.0, le=180.0, description="amplitude of the swing [deg]")
    swing: float = Field(default=300.0, ge=1.0, description="period of the swing [s]")
    phase_deg: float = Field(default=0.0, description="phase at the start; 90 begins at the greatest heading [deg]")


class Circle(Settings):
    """A steady turn, which needs no position; its circle drifts with the current."""

    kind: Literal["circle"] = "circle"
    heading_deg: float = Field(default=0.0, description="heading at the start, clockwise from north [deg]")
    radius: float = Field(default=100.0, gt=0.0, description="radius through the water [m]")
    side: Literal["starboard", "port"] = Field(default="starboard", description="side to which it turns")


Law = Weave | Circle
Pattern = Annotated[
    Annotated[Waypoints, Tag("Waypoints")]
    | Annotated[LawnMower, Tag("LawnMower")]
    | Annotated[Weave, Tag("Weave")]
    | Annotated[Circle, Tag("Circle")],
    Discriminator(tag_by_kind(Waypoints, LawnMower, Weave, Circle)),
]


def heading(pattern: Law, time: float, speed: float) -> float:
    """Heading [rad] of a track that is no way between points.

    Args:
        pattern: The track.
        time: Since its start [s].
        speed: Through the water [m/s].
    """
    if isinstance(pattern, Weave):
        swing = math.sin(math.tau * time / pattern.swing + math.radians(pattern.phase_deg))
        return wrap(math.radians(pattern.course_deg + pattern.amplitude_deg * swing))
    turned = speed * time / pattern.radius * (1.0 if pattern.side == "starboard" else -1.0)
    return wrap(math.radians(pattern.heading_deg) + turned)


def points(pattern: Waypoints | LawnMower) -> Array:
    """The waypoints (k, 2) of a track, north and east [m], in order."""
    if isinstance(pattern, Waypoints):
        return np.array(pattern.points, dtype=float)
    heading = math.radians(pattern.heading_deg)
    along = np.array((math.cos(heading), math.sin(heading)))
    across = np.array((-along[1], along[0])) * (1.0 if pattern.side == "starboard" else -1.0)
    ends = []
    half = (pattern.lanes + 1) // 2
    for number in range(pattern.lanes):
        lane = number if pattern.order == "adjacent" else number // 2 + half * (number % 2)
        begin = np.array(pattern.corner) + lane * pattern.spacing * across
        lane_ends = [begin, begin + pattern.length * along]
        ends += lane_ends if number % 2 == 0 else lane_ends[::-1]
    return np.array(ends)
