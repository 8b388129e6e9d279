"""A track as a mission: from waypoint to waypoint by line of sight, on the estimate; or a heading in time."""

import math
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from auvsim.base.settings import Settings
from auvsim.control.controller import Setpoints
from auvsim.data.log import VehicleLog
from auvsim.data.variables import Variable
from auvsim.missions.line_of_sight import course_to_line, cross_track, heading_for_course
from auvsim.missions.mission import Event, Metric, Mission, MissionSetup, Situation
from auvsim.missions.track.metrics import track_metrics
from auvsim.missions.track.patterns import Circle, Pattern, Waypoints, Weave, heading, points

SEARCH, UNDER_WAY, DONE = range(3)


class TrackSettings(Settings):
    """A track at one depth: waypoints, lanes, or headings in time."""

    kind: Literal["track"] = "track"
    pattern: Pattern = Field(default=Waypoints(), description="The way, by its `kind`.")
    depth: float = Field(default=10.0, gt=0, description="depth [m]")
    speed: float = Field(default=1.5, gt=0, description="speed through the water [m/s]")
    lookahead: float = Field(default=15.0, gt=0, description="lookahead of the line of sight [m]")
    radius: float = Field(default=10.0, gt=0, description="distance at which a waypoint counts as reached [m]")
    lasts: float | None = Field(
        default=None, gt=0, description="duration of a weave or a circle; none: to the end of the run [s]"
    )


class Track(Mission):
    """Follows the legs between waypoints, of which the first begins where the vehicle first knows its position.

    Headings in time are followed from the start, whether a position is known or not.
    """

    Settings = TrackSettings
    phases = ("search", "under_way", "done")
    variables: ClassVar = {
        "waypoint": Variable((), "int32", "1", "number of the waypoint ahead, from 0"),
        "cross_track": Variable((), "float64", "m", "estimated distance to starboard of the leg"),
    }
    columns: ClassVar = {
        "finished": Metric("bool", "1", "whether the last waypoint was reached"),
        "waypoints": Metric("int", "1", "waypoints reached"),
        "cross_track_rms": Metric("float", "m", "true distance from the leg, rms, on legs between waypoints"),
    }
    aftermath = 2.0

    def __init__(self, setup: MissionSetup) -> None:
        super().__init__(setup)
        self._s: TrackSettings = setup.settings
        pattern = self._s.pattern
        self._law = pattern if isinstance(pattern, Weave | Circle) else None
        self._points = np.empty((0, 2)) if isinstance(pattern, Weave | Circle) else points(pattern)
        self._begin: float | None = None  # of headings in time [s]
        self._hold = setup.heading
        self._from: tuple[float, float] | None = None  # begin of the leg [m]
        self.waypoint, self.cross = 0, math.nan

    def update(self, now: Situation) -> Setpoints:
        """The setpoints now."""
        s, estimate = self._s, now.estimate
        if self.phase == DONE:
            return Setpoints(now.heading, s.depth, 0.0)
        if self._law is not None:
            return self._by_law(self._law, now.time)
        if estimate is None or not estimate.initialised:
            return Setpoints(self._hold, s.depth, s.speed)
        north, east, current = _position_now(now)
        if self._from is None:
            self._from = (north, east)
            self._enter(UNDER_WAY, now.time, f"{len(self._points)} waypoints")
        target_north, target_east = self._points[self.waypoint].tolist()
        if math.hypot(target_north - north, target_east - east) < s.radius or self._is_past(north, east):
            self.events.append(Event(now.time, "waypoint", f"{self.waypoint} reached"))
            self._from = (target_north, target_east)
            self.waypoint += 1
            if self.waypoint == len(self._points):
                self._enter(DONE, now.time, "last waypoint reached")
                self.finished = True
                return Setpoints(now.heading, s.depth, 0.0)
            target_north, target_east = self._points[self.waypoint].tolist()
        line = math.atan2(target_east - self._from[1], target_north - self._from[0])
        self.cross = cross_track(line, north - self._from[0], east - self._from[1])
        course = course_to_line(line, self.cross, s.lookahead)
        return Setpoints(heading_for_course(course, s.speed, current), s.depth, s.speed)

    def row(self) -> tuple[Any, ...]:
        """Waypoint ahead and distance from the leg."""
        return max(0, min(self.waypoint, len(self._points) - 1)), self.cross

    def overdue(self, duration: float) -> str:
        """Text for the log."""
        endless = self._law is not None and self._s.lasts is None
        return f"under way to the end at {duration:g} s" if endless else super().overdue(duration)

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """Metrics of the track."""
        return track_metrics(log)

    def _by_law(self, law: Weave | Circle, time: float) -> Setpoints:
        s = self._s
        if self._begin is None:
            self._begin = time
            self._enter(UNDER_WAY, time, law.kind)
        since = time - self._begin
        wanted = heading(law, since, s.speed)
        if s.lasts is not None and since >= s.lasts:
            self._enter(DONE, time, f"{law.kind} of {s.lasts:g} s")
            self.finished = True
            return Setpoints(wanted, s.depth, 0.0)
        return Setpoints(wanted, s.depth, s.speed)

    def _is_past(self, north: float, east: float) -> bool:
        """Whether the vehicle has passed the waypoint ahead abeam."""
        assert self._from is not None
        leg = self._points[self.waypoint] - self._from
        return float(leg @ (north - self._from[0], east - self._from[1])) > float(leg @ leg) > 0.0

    def _enter(self, phase: int, time: float, text: str) -> None:
        self.phase = phase
        self.events.append(Event(time, self.phases[phase], text))


def _position_now(now: Situation) -> tuple[float, float, tuple[float, float]]:
    """North and east [m] by dead reckoning from the last estimate, and its current, north and east [m/s]."""
    estimate = now.estimate
    assert estimate is not None
    u, v, _ = estimate.velocity.tolist()
    current_north, current_east = estimate.current.tolist()
    cos, sin, dt = math.cos(now.heading), math.sin(now.heading), now.time - estimate.time
    over_ground = np.array((u * cos - v * sin + current_north, u * sin + v * cos + current_east))
    north, east = (estimate.position[:2] + over_ground * dt).tolist()
    return north, east, (current_north, current_east)
