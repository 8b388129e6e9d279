"""Docking guidance: search, homing to the gate on the dock's axis, approach, the last metres, go-around, abort.

The law is line of sight with the crab angle taken from the estimated current. Where a cross current would turn the
heading too far off the dock's axis for the funnel, the approach line is turned instead, so that it still runs through
the entrance. Coordinates: dock frame, x along the course of a vehicle that enters, y to starboard, origin at the
centre of the mouth.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from pydantic import Field

from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.navigation.navigator import Estimate

CLEAR = 4.0  # distance that the go-around keeps from the entrance [m]
BESIDE = 3.0  # distance from the axis at which the vehicle would pass the dock [m]
BACKING = 60.0  # longest time of backing out [s]
ABEAM = (-5.0, 40.0)  # the way round the dock: along the axis and to either side of it [m]
BEFORE = 40.0  # distance before the entrance from which nothing is in the way to a gate [m]


class Phase(IntEnum):
    """Phases of a docking trial, as logged."""

    SEARCH = 0  # no fix yet: hold course and depth
    HOMING = 1  # to the gate on the dock's axis
    APPROACH = 2  # along the line to the entrance
    FINAL = 3  # the last metres
    DOCKED = 4  # the latch holds
    GO_AROUND = 5  # back out and round for another attempt
    ABORTED = 6  # given up
    MANOEUVRE = 7  # no docking: a manoeuvre for the identification of the vehicle


class GuidanceSettings(Settings):
    """How the vehicle comes in."""

    homing_speed: float = Field(default=1.5, gt=0, description="speed through the water on the way to the gate [m/s]")
    approach_speed: float = Field(default=1.0, gt=0, description="speed through the water on the approach [m/s]")
    gate_distance: float = Field(default=200.0, gt=0, description="distance of the gate before the entrance [m]")
    gate_radius: float = Field(default=20.0, gt=0, description="distance at which the gate counts as reached [m]")
    retry_distance: float = Field(default=100.0, gt=0, description="distance of the gate of later attempts [m]")
    turning_radius: float = Field(
        default=16.0, gt=0, description="of the tightest turn, for the room to turn round before the dock [m]"
    )
    lookahead: float = Field(default=7.0, gt=0, description="lookahead of the line of sight [m]")
    heading_limit_deg: float = Field(
        default=20.0,
        gt=0,
        lt=60,
        description="largest angle between heading and dock axis before the line is turned instead [deg]",
    )
    final_distance: float = Field(default=20.0, gt=0, description="distance at which the last metres begin [m]")
    attempts: int = Field(default=3, ge=1, description="attempts before the vehicle gives up")
    fix_timeout: float = Field(default=30.0, gt=0, description="time without a fix that breaks an approach off [s]")
    uncertain_timeout: float = Field(
        default=10.0,
        gt=0,
        description="time with an off-axis deviation above the mouth's radius after which it is broken off [s]",
    )
    lost_timeout: float = Field(default=180.0, gt=0, description="time without a fix that ends the trial [s]")


class Command(NamedTuple):
    """What guidance asks of the autopilot."""

    heading: float  # [rad]
    depth: float  # [m]
    speed: float  # through the water [m/s]


class Event(NamedTuple):
    """A change of phase or another decision, for the log."""

    time: float  # [s]
    kind: str
    text: str


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """What guidance knows of vehicle and dock."""

    nose: float  # of the vehicle, ahead of its origin [m]
    mouth_radius: float  # [m]
    latched: float  # where the latch holds the nose, along the axis from the mouth [m]


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


def heading_for_course(course: float, speed: float, current: tuple[float, float]) -> float:
    """Heading [rad] whose course over ground is `course` [rad], or the nearest to it in too strong a current."""
    across = current[1] * math.cos(course) - current[0] * math.sin(course)
    return course - math.asin(max(-0.95, min(0.95, across / speed)))


class Guidance:
    """The phase machine of a docking trial.

    Args:
        settings: distances, speeds, limits.
        geometry: of vehicle and dock.
    """

    rudder: float | None = None  # asked for itself [rad]: never, a docking steers by headings

    def __init__(self, settings: GuidanceSettings, geometry: Geometry) -> None:
        self._s, self._g = settings, geometry
        self._limit = math.radians(settings.heading_limit_deg)
        self.phase = Phase.SEARCH
        self.attempt = 1
        self.events: list[Event] = []
        self.along = self.cross = math.nan  # of the estimate, dock frame [m]
        self.axis = 0.0  # course of the dock's axis [rad], the mean of what the dock reported
        self._axis_sum = (0.0, 0.0)
        self._depth_sum, self._fixes = 0.0, 0
        self._last_fix = 0.0
        self._certain = 0.0  # when the position across the axis was last known better than the mouth's radius
        self._hold: tuple[float, float] | None = None  # heading and depth held in search
        self._north = self._east = math.nan  # of the nose [m]
        self._current = (0.0, 0.0)  # north, east [m/s]
        self._side = 1.0  # on which the dock is passed: 1 to starboard of its axis
        self._leg = 1  # of the way to a gate: 0 back out of the funnel, 1 round the dock, 2 to the gate
        self._phase_start = 0.0

    @property
    def dock_depth(self) -> float:
        """Depth of the mouth [m], the mean of what the dock reported."""
        return self._depth_sum / max(self._fixes, 1)

    @property
    def finished(self) -> bool:
        """Whether nothing more will be tried."""
        return self.phase in (Phase.DOCKED, Phase.ABORTED)

    def observe(self, readings: Sequence[Reading]) -> None:
        """Takes the dock's reports among `readings`."""
        for reading in readings:
            if reading.sensor == "usbl" and all(map(math.isfinite, reading.value.tolist())):
                heading, depth = float(reading.value[3]), float(reading.value[6])
                self._axis_sum = (self._axis_sum[0] + math.cos(heading), self._axis_sum[1] + math.sin(heading))
                self.axis = math.atan2(self._axis_sum[1], self._axis_sum[0])
                self._depth_sum += depth
                self._fixes += 1
                self._last_fix = max(self._last_fix, reading.received)

    def update(self, time: float, estimate: Estimate | None, heading: float, depth: float, latched: bool) -> Command:
        """The command now.

        Args:
            time: [s].
            estimate: the last one, or None before there is any.
            heading: smoothed compass heading [rad].
            depth: smoothed depth [m].
            latched: whether the dock's latch holds the vehicle.
        """
        if self._hold is None:
            self._hold = (heading, depth)
        if latched and self.phase != Phase.DOCKED:
            self._enter(Phase.DOCKED, time, "latched")
        if self.phase in (Phase.DOCKED, Phase.ABORTED):
            return Command(heading, depth, 0.0)
        silence = time - self._last_fix
        if silence > self._s.lost_timeout:
            self._enter(Phase.ABORTED, time, f"no fix for {silence:.0f} s")
            return Command(heading, depth, 0.0)
        if estimate is None or not estimate.initialised or not self._fixes:
            return Command(*self._hold, self._s.approach_speed)
        self._locate(time, estimate, heading)
        if self.phase == Phase.SEARCH:
            self._enter(Phase.HOMING, time, "first fix")
            self._side = math.copysign(1.0, self.cross)
        if self.phase == Phase.HOMING:
            return self._to_gate(time, -self._s.gate_distance, 0.0)
        if self.phase == Phase.GO_AROUND:
            return self._go_around(time, wrap(heading - self.axis))
        reason = self._reason_to_break_off(time, estimate, silence)
        return self._break_off(time, reason, wrap(heading - self.axis)) if reason else self._follow_line()

    def _locate(self, time: float, estimate: Estimate, heading: float) -> None:
        """The nose now, by dead reckoning from the last estimate."""
        north, east, _ = estimate.position.tolist()
        u, v, _ = estimate.velocity.tolist()
        current_north, current_east = estimate.current.tolist()
        cos, sin, dt = math.cos(heading), math.sin(heading), time - estimate.time
        north = north + (u * cos - v * sin + current_north) * dt + self._g.nose * cos
        east = east + (u * sin + v * cos + current_east) * dt + self._g.nose * sin
        cos, sin = math.cos(self.axis), math.sin(self.axis)
        self.along = north * cos + east * sin
        self.cross = east * cos - north * sin
        self._north, self._east, self._current = north, east, (current_north, current_east)

    def _enter(self, phase: Phase, time: float, reason: str) -> None:
        self.events.append(Event(time, phase.name.lower(), reason))
        self.phase, self._phase_start = phase, time

    def _to(self, x: float, y: float) -> Command:
        """Straight to a point of the dock frame, crabbing against the current."""
        axis, speed = self.axis, self._s.homing_speed
        target_north = x * math.cos(axis) - y * math.sin(axis)
        target_east = x * math.sin(axis) + y * math.cos(axis)
        course = math.atan2(target_east - self._east, target_north - self._north)
        return Command(heading_for_course(course, speed, self._current), self.dock_depth, speed)

    def _to_gate(self, time: float, x: float, y: float) -> Command:
        """To a gate of the dock frame, from beside or behind the dock first round it."""
        abeam_x, abeam_y = ABEAM[0], self._side * ABEAM[1]
        if self.along < -BEFORE or math.hypot(self.along - abeam_x, self.cross - abeam_y) < 15.0:
            self._leg = 2
        if self._leg == 1:
            return self._to(abeam_x, abeam_y)
        if math.hypot(self.along - x, self.cross - y) < self._s.gate_radius:
            self._enter(Phase.APPROACH, time, f"gate reached, attempt {self.attempt}")
        return self._to(x, y)

    def _follow_line(self) -> Command:
        """Along the approach line, by line of sight."""
        speed = self._s.approach_speed
        line = approach_course(self.axis, speed, self._current, self._limit)
        # Cross-track error from the line of course `line` through the centre of the mouth, positive to starboard.
        error = self._east * math.cos(line) - self._north * math.sin(line)
        course = line - math.atan2(error, self._s.lookahead)
        return Command(heading_for_course(course, speed, self._current), self.dock_depth, speed)

    def _reason_to_break_off(self, time: float, estimate: Estimate, silence: float) -> str | None:
        """What is wrong with this attempt; enters the last metres when they begin."""
        s, g = self._s, self._g
        (north, both), (_, east) = estimate.covariance[:2, :2].tolist()
        cos, sin = math.cos(self.axis), math.sin(self.axis)
        variance = sin * sin * north - 2 * sin * cos * both + cos * cos * east  # across the axis
        if variance <= g.mouth_radius**2:
            self._certain = time
        if self.phase == Phase.APPROACH and self.along > -s.final_distance:
            self._enter(Phase.FINAL, time, f"{-self.along:.0f} m before the entrance, {self.cross:+.2f} m off the axis")
        if silence > s.fix_timeout:
            return f"no fix for {silence:.0f} s"
        if self.phase != Phase.FINAL:
            return None
        if time - self._certain > s.uncertain_timeout:
            return f"off-axis position uncertain by more than the mouth's radius for {time - self._certain:.0f} s"
        if self.along > -0.5 and abs(self.cross) > g.mouth_radius + 0.5:
            return f"entrance missed by {abs(self.cross):.2f} m"
        if self.along > g.latched + 1.5:
            return "entrance passed without capture"
        patience = 3.0 * (s.final_distance + g.latched) / s.approach_speed
        if time - self._phase_start > patience:
            return f"not captured within {patience:.0f} s of the last metres"
        return None

    def _break_off(self, time: float, reason: str, off: float) -> Command:
        """Ends an attempt at a heading `off` the axis [rad]."""
        if self.attempt >= self._s.attempts:
            self._enter(Phase.ABORTED, time, f"{reason}; attempt {self.attempt} was the last")
            return Command(self.axis, self.dock_depth, 0.0)
        self.attempt += 1
        self._side = math.copysign(1.0, self.cross)
        self._enter(Phase.GO_AROUND, time, f"{reason}; attempt {self.attempt} follows")
        # In or close before the funnel back out first; beside or behind it, or far off, go round at once.
        room = -CLEAR - self._s.turning_radius
        self._leg = 0 if room < self.along < self._g.latched + 0.5 and abs(self.cross) < BESIDE else 1
        return self._go_around(time, off)

    def _go_around(self, time: float, off: float) -> Command:
        """Back out of the funnel, then round to a gate abeam of the axis."""
        s = self._s
        if self._leg == 0:
            if time - self._phase_start < BACKING and not self._has_room(off):
                return Command(self.axis, self.dock_depth, -0.8 * s.approach_speed)
            self._leg = 1
        return self._to_gate(time, -s.retry_distance, 0.5 * self._side * ABEAM[1])

    def _has_room(self, off: float) -> bool:
        """Whether a vehicle at a heading `off` the axis [rad] can turn before the dock, and to which side.

        A torpedo cannot be steered astern for long: the farther it has turned off, the less room it needs.
        """
        radius = self._s.turning_radius
        self._side = math.copysign(1.0, self.cross + radius * math.sin(off))
        turned = max(-math.pi / 2, min(math.pi / 2, self._side * off))
        return abs(self.cross) > radius or self.along < -CLEAR - radius * (1.0 - math.sin(turned))
