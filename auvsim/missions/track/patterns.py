"""Settings of tracks, and their waypoints."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from auvsim.base.frames import Array
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


Pattern = Annotated[
    Annotated[Waypoints, Tag("Waypoints")] | Annotated[LawnMower, Tag("LawnMower")],
    Discriminator(tag_by_kind(Waypoints, LawnMower)),
]


def points(pattern: Waypoints | LawnMower) -> Array:
    """The waypoints (k, 2) of a track, north and east [m], in order."""
    if isinstance(pattern, Waypoints):
        return np.array(pattern.points, dtype=float)
    heading = math.radians(pattern.heading_deg)
    along = np.array((math.cos(heading), math.sin(heading)))
    across = np.array((-along[1], along[0])) * (1.0 if pattern.side == "starboard" else -1.0)
    ends = []
    for lane in range(pattern.lanes):
        begin = np.array(pattern.corner) + lane * pattern.spacing * across
        lane_ends = [begin, begin + pattern.length * along]
        ends += lane_ends if lane % 2 == 0 else lane_ends[::-1]
    return np.array(ends)
