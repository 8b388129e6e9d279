"""Docking guidance: search, homing to the gate on the dock's axis, approach, the last metres, go-around, abort.

The law is line of sight with the crab angle taken from the estimated current. Where a cross current would turn the
heading too far off the dock's axis for the funnel, the approach line is turned instead, so that it still runs through
the entrance. Coordinates: dock frame, x along the course of a vehicle that enters, y to starboard, origin at the
centre of the mouth.
"""

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, ClassVar, Literal

from pydantic import Field

from auvsim.base.errors import InputError, unknown_name
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.control.controller import Setpoints
from auvsim.data.log import VehicleLog
from auvsim.data.variables import Variable
from auvsim.missions.docking.metrics import docking_metrics
from auvsim.missions.line_of_sight import course_to_line, cross_track, heading_for_course
from auvsim.missions.mission import Event, Metric, Mission, MissionSetup, Place, Situation
from auvsim.navigation.estimate import Estimate

CLEAR = 4.0  # distance that the go-around keeps from the entrance [m]
BESIDE = 3.0  # distance from the axis at which the vehicle would pass the dock [m]
BACKING = 60.0  # longest time of backing out [s]
ABEAM = (-5.0, 40.0)  # detour round the dock: along the axis and to either side of it [m]
BEFORE = 40.0  # distance before the entrance from which the path to a gate is clear [m]


class Phase(IntEnum):
    """Phases of a docking trial, as logged."""

    SEARCH = 0  # no fix yet: hold course and depth
    HOMING = 1  # to the gate on the dock's axis
    APPROACH = 2  # along the line to the entrance
    FINAL = 3  # the last metres
    DOCKED = 4  # the latch holds
    GO_AROUND = 5  # back out and round for another attempt
    ABORTED = 6  # given up


class DockingSettings(Settings):
    """Settings of docking: homing, approach, attempts and time limits."""

    kind: Literal["docking"] = Field(
        default="docking", description="docking, manoeuvre, track, or package.module:Class"
    )
    dock: str | None = Field(default=None, description="name of the structure to dock at; none: the only one")
    homing_speed: float = Field(default=1.5, gt=0, description="speed through the water while homing to the gate [m/s]")
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
    attempts: int = Field(default=3, ge=1, le=1000, description="attempts before the vehicle gives up")
    fix_timeout: float = Field(default=30.0, gt=0, description="time without a fix that breaks an approach off [s]")
    uncertain_timeout: float = Field(
        default=10.0,
        gt=0,
        description="time with an off-axis deviation above the mouth's radius after which it is broken off [s]",
    )
    lost_timeout: float = Field(default=180.0, gt=0, description="time without a fix that ends the trial [s]")


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


class Docking(Mission):
    """The phase machine of a docking.

    Raises:
        InputError: there is no structure to dock at, or several and none is named.
    """

    Settings = DockingSettings
    phases = tuple(phase.name.lower() for phase in Phase)
    variables: ClassVar = {
        "attempt": Variable((), "int8", "1", "number of the docking attempt, from 1"),
        "along_track": Variable((), "float64", "m", "estimated distance along the dock axis, < 0 before", "dock"),
        "cross_track": Variable((), "float64", "m", "estimated distance to starboard of the dock axis", "dock"),
    }
    columns: ClassVar = {
        "docked": Metric("bool", "1", "whether it docked"),
        "docked_first": Metric("bool", "1", "whether it docked on the first attempt"),
        "failure_reason": Metric("str", "", "timeout, aborted or diverged; none if docked"),
        "failure_text": Metric("str", "", "what the log says of it"),
        "attempts": Metric("int", "1", "attempts to dock"),
        "time": Metric("float", "s", "of docking, or of the end"),
        "miss_distance": Metric("float", "m", "of the nose from the dock's axis where it first enters, last attempt"),
        "cross_track": Metric("float", "m", "its part to starboard"),
        "vertical": Metric("float", "m", "its part downward"),
        "heading_error_deg": Metric("float", "deg", "heading less that of the dock, there"),
        "contact_impulse": Metric("float", "N s", "contact impulse, friction included, until the latch held"),
        "peak_contact_force": Metric(
            "float", "N", "largest contact force, friction included, until then; as uncertain as the panels' stiffness"
        ),
        "docked_aligned": Metric("bool", "1", "whether it docked and lies within the dock's own limit of its axis"),
        "final_along": Metric("float", "m", "of the nose behind the mouth, along the axis, at the end, if it docked"),
        "final_cross": Metric("float", "m", "of the nose to starboard of the axis, then"),
        "final_down": Metric("float", "m", "of the nose below the axis, then"),
        "final_angle_deg": Metric("float", "deg", "between the vehicle's axis and the dock's, then"),
    }
    aftermath = 5.0

    def __init__(self, setup: MissionSetup) -> None:
        super().__init__(setup)
        settings: DockingSettings = setup.settings
        self.dock = find_dock(settings.dock, setup.structures)
        self._s, self._nose, self._vehicle = settings, setup.vehicle.nose, setup.name
        assert self.dock is not None
        self._mouth_radius, self._latched = self.dock.structure.mouth_radius, self.dock.structure.latched
        self._mouth = self.dock.pose.north, self.dock.pose.east
        self._limit = math.radians(settings.heading_limit_deg)
        self.phase = Phase.SEARCH
        self.attempt = 1
        self.along = self.cross = math.nan  # of the estimate, dock frame [m]
        self.axis = 0.0  # course of the dock's axis [rad], the mean of what the dock reported
        self._axis_sum = (0.0, 0.0)
        self._depth_sum, self._fixes = 0.0, 0
        self._ranges = setup.ranges
        if not setup.usbl:  # the dock lies as it is charted
            self.axis, self._depth_sum, self._fixes = self.dock.pose.heading, self.dock.pose.depth, 1
        self._last_fix = 0.0
        self._certain = 0.0  # when the position across the axis was last known better than the mouth's radius
        self._hold: tuple[float, float] | None = None  # heading and depth held in search
        self._north = self._east = math.nan  # of the nose, from the mouth [m]
        self._current = (0.0, 0.0)  # north, east [m/s]
        self._side = 1.0  # on which the dock is passed: 1 to starboard of its axis
        self._leg = 1  # of the path to a gate: 0 back out of the funnel, 1 round the dock, 2 to the gate
        self._phase_start = 0.0
        self._occupant: str | None = None  # another vehicle in the dock, as reported in its packets

    @property
    def dock_depth(self) -> float:
        """Depth of the mouth [m], the mean of what the dock reported."""
        return self._depth_sum / max(self._fixes, 1)

    @property
    def at_rest(self) -> bool:
        """Whether the latch holds the vehicle."""
        return self.phase == Phase.DOCKED

    @property
    def approach(self) -> int | None:
        """Number of the attempt whose approach is under way."""
        return self.attempt if self.phase in (Phase.APPROACH, Phase.FINAL) else None

    def row(self) -> tuple[Any, ...]:
        """Attempt, distance along the dock's axis and across it, as estimated."""
        return self.attempt, self.along, self.cross

    def overdue(self, duration: float) -> str:
        """Says that it has not docked in time."""
        return f"not docked within {duration:g} s"

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """What a docking is judged by, see `docking.metrics`."""
        return docking_metrics(log)

    def _observe(self, readings: Sequence[Reading]) -> None:
        """Takes the dock's reports among `readings`."""
        for reading in readings:
            if reading.sensor in self._ranges:
                self._last_fix = max(self._last_fix, reading.received)
            if reading.sensor == "usbl" and all(map(math.isfinite, reading.value.tolist())):
                heading, depth = float(reading.value[3]), float(reading.value[6])
                self._axis_sum = (self._axis_sum[0] + math.cos(heading), self._axis_sum[1] + math.sin(heading))
                self.axis = math.atan2(self._axis_sum[1], self._axis_sum[0])
                self._depth_sum += depth
                self._fixes += 1
                self._last_fix = max(self._last_fix, reading.received)

    def update(self, now: Situation) -> Setpoints:
        """The setpoints now."""
        self._observe(now.readings)
        for delivery in now.messages:
            if delivery.message.kind == "usbl" and delivery.message.payload.occupant not in (None, self._vehicle):
                self._occupant = delivery.message.payload.occupant
        setpoints = self._decide(now)
        self.finished = self.phase in (Phase.DOCKED, Phase.ABORTED)
        return setpoints

    def _decide(self, now: Situation) -> Setpoints:
        time, estimate, heading, depth = now.time, now.estimate, now.heading, now.depth
        if self._hold is None:
            self._hold = (heading, depth)
        if now.latched and self.phase != Phase.DOCKED:
            self._enter(Phase.DOCKED, time, "latched")
        if self.phase in (Phase.DOCKED, Phase.ABORTED):
            return Setpoints(heading, depth, 0.0)
        if self._occupant is not None:
            self._enter(Phase.ABORTED, time, f"the dock is occupied by '{self._occupant}'")
            return Setpoints(heading, depth, 0.0)
        silence = time - self._last_fix
        if silence > self._s.lost_timeout:
            self._enter(Phase.ABORTED, time, f"no fix for {silence:.0f} s")
            return Setpoints(heading, depth, 0.0)
        if estimate is None or not estimate.initialised or not self._fixes:
            return Setpoints(*self._hold, self._s.approach_speed)
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
        north = north + (u * cos - v * sin + current_north) * dt + self._nose * cos - self._mouth[0]
        east = east + (u * sin + v * cos + current_east) * dt + self._nose * sin - self._mouth[1]
        cos, sin = math.cos(self.axis), math.sin(self.axis)
        self.along = north * cos + east * sin
        self.cross = east * cos - north * sin
        self._north, self._east, self._current = north, east, (current_north, current_east)

    def _enter(self, phase: Phase, time: float, reason: str) -> None:
        self.events.append(Event(time, phase.name.lower(), reason))
        self.phase, self._phase_start = phase, time

    def _to(self, x: float, y: float) -> Setpoints:
        """Straight to a point of the dock frame, crabbing against the current."""
        axis, speed = self.axis, self._s.homing_speed
        target_north = x * math.cos(axis) - y * math.sin(axis)
        target_east = x * math.sin(axis) + y * math.cos(axis)
        course = math.atan2(target_east - self._east, target_north - self._north)
        return Setpoints(heading_for_course(course, speed, self._current), self.dock_depth, speed)

    def _to_gate(self, time: float, x: float, y: float) -> Setpoints:
        """To a gate of the dock frame, from beside or behind the dock first round it."""
        abeam_x, abeam_y = ABEAM[0], self._side * ABEAM[1]
        if self.along < -BEFORE or math.hypot(self.along - abeam_x, self.cross - abeam_y) < 15.0:
            self._leg = 2
        if self._leg == 1:
            return self._to(abeam_x, abeam_y)
        if math.hypot(self.along - x, self.cross - y) < self._s.gate_radius:
            self._enter(Phase.APPROACH, time, f"gate reached, attempt {self.attempt}")
        return self._to(x, y)

    def _follow_line(self) -> Setpoints:
        """Along the approach line, by line of sight."""
        speed = self._s.approach_speed
        line = approach_course(self.axis, speed, self._current, self._limit)
        # Cross-track error from the line of course `line` through the centre of the mouth, positive to starboard.
        error = cross_track(line, self._north, self._east)
        course = course_to_line(line, error, self._s.lookahead)
        return Setpoints(heading_for_course(course, speed, self._current), self.dock_depth, speed)

    def _reason_to_break_off(self, time: float, estimate: Estimate, silence: float) -> str | None:
        """What is wrong with this attempt; enters the last metres when they begin."""
        s = self._s
        (north, both), (_, east) = estimate.horizontal_covariance.tolist()
        cos, sin = math.cos(self.axis), math.sin(self.axis)
        variance = sin * sin * north - 2 * sin * cos * both + cos * cos * east  # across the axis
        if variance <= self._mouth_radius**2:
            self._certain = time
        if self.phase == Phase.APPROACH and self.along > -s.final_distance:
            self._enter(Phase.FINAL, time, f"{-self.along:.0f} m before the entrance, {self.cross:+.2f} m off the axis")
        if silence > s.fix_timeout:
            return f"no fix for {silence:.0f} s"
        if self.phase != Phase.FINAL:
            return None
        if time - self._certain > s.uncertain_timeout:
            return f"off-axis position uncertain by more than the mouth's radius for {time - self._certain:.0f} s"
        if self.along > -0.5 and abs(self.cross) > self._mouth_radius + 0.5:
            return f"entrance missed by {abs(self.cross):.2f} m"
        if self.along > self._latched + 1.5:
            return "entrance passed without capture"
        patience = 3.0 * (s.final_distance + self._latched) / s.approach_speed
        if time - self._phase_start > patience:
            return f"not captured within {patience:.0f} s of the last metres"
        return None

    def _break_off(self, time: float, reason: str, off: float) -> Setpoints:
        """Ends an attempt at a heading `off` the axis [rad]."""
        if self.attempt >= self._s.attempts:
            self._enter(Phase.ABORTED, time, f"{reason}; attempt {self.attempt} was the last")
            return Setpoints(self.axis, self.dock_depth, 0.0)
        self.attempt += 1
        self._side = math.copysign(1.0, self.cross)
        self._enter(Phase.GO_AROUND, time, f"{reason}; attempt {self.attempt} follows")
        # In or close before the funnel back out first; beside or behind it, or far off, go round at once.
        room = -CLEAR - self._s.turning_radius
        self._leg = 0 if room < self.along < self._latched + 0.5 and abs(self.cross) < BESIDE else 1
        return self._go_around(time, off)

    def _go_around(self, time: float, off: float) -> Setpoints:
        """Back out of the funnel, then round to a gate abeam of the axis."""
        s = self._s
        if self._leg == 0:
            if time - self._phase_start < BACKING and not self._has_room(off):
                return Setpoints(self.axis, self.dock_depth, -0.8 * s.approach_speed)
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


def find_dock(name: str | None, structures: Mapping[str, Place]) -> Place:
    """The structure of a name, or the only one.

    Raises:
        InputError: there is none of that name; none at all; or several, and none is named.
    """
    if name is not None:
        if name not in structures:
            raise unknown_name("structure", name, list(structures))
        return structures[name]
    if len(structures) != 1:
        known = f"name one of {', '.join(structures)}" if structures else "there is no structure"
        raise InputError(f"mission docking: no dock is given; {known}")
    return next(iter(structures.values()))
