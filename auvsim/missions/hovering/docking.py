"""Hovering docking: to a gate before the dock, in line with it, then creeping in; back out and again if it fails.

Coordinates: dock frame, x along the course of a vehicle that enters, y to starboard, origin at the centre of the mouth.
"""

import math
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from auvsim.base.frames import Array, wrap
from auvsim.base.settings import Settings
from auvsim.control.controller import Setpoints, Station
from auvsim.data.log import VehicleLog
from auvsim.missions.docking.guidance import Docking, Phase, find_dock
from auvsim.missions.docking.metrics import docking_metrics
from auvsim.missions.docking.reports import DockReports
from auvsim.missions.hovering.carrot import Carrot, require_thrusters
from auvsim.missions.mission import Event, Mission, MissionSetup, Situation
from auvsim.navigation.estimate import Estimate

AIMED = math.radians(5.0)  # error of the heading with which the vehicle counts as turned to the axis [rad]
NEAR, ASIDE = 3.0, 6.0  # a vehicle beside or behind the dock keeps these distances: along and across its axis [m]
FACE = 4.0  # distance from the gate beyond which the vehicle faces where it goes [m]
PUSH = 0.3  # distance behind the latch at which the place stands at the end [m]


class HoveringDockingSettings(Settings):
    """Settings of hovering docking: gate, corridor, speeds over ground, attempts and time limits."""

    kind: Literal["hovering_docking"] = "hovering_docking"
    dock: str | None = Field(default=None, description="name of the structure to dock at; none: the only one")
    transit_speed: float = Field(default=0.4, gt=0, description="speed over ground to the gate [m/s]")
    creep_speed: float = Field(default=0.15, gt=0, description="speed over ground from the gate into the dock [m/s]")
    gate_distance: float = Field(default=4.0, ge=3.5, description="distance of the gate before the entrance [m]")
    gate_radius: float = Field(default=0.3, gt=0, description="distance within which it is in line at the gate [m]")
    settling: float = Field(default=10.0, ge=0, description="time in line at the gate before it creeps in [s]")
    corridor: float = Field(default=0.25, gt=0, description="error across the axis above which it waits [m]")
    final_distance: float = Field(default=1.0, gt=0, description="distance at which the last metre begins [m]")
    attempts: int = Field(default=3, ge=1, le=1000, description="attempts before the vehicle gives up")
    fix_timeout: float = Field(default=30.0, gt=0, description="time without a fix that breaks an approach off [s]")
    lost_timeout: float = Field(default=180.0, gt=0, description="time without a fix that ends the mission [s]")
    patience: float = Field(default=90.0, gt=0, description="time from the gate after which it backs out [s]")


class HoveringDocking(Mission):
    """The phase machine of a hovering docking; phases, variables and metrics are those of any docking.

    Raises:
        InputError: the vehicle cannot hover; no structure to dock at, or several and none is named.
    """

    Settings = HoveringDockingSettings
    phases, columns = Docking.phases, Docking.columns
    variables: ClassVar = dict(list(Docking.variables.items())[:3])  # attempt, along_track, cross_track
    aftermath = Docking.aftermath

    def __init__(self, setup: MissionSetup) -> None:
        super().__init__(setup)
        require_thrusters(setup)
        self._s: HoveringDockingSettings = setup.settings
        self.dock = find_dock(self._s.dock, setup.structures)
        pose = self.dock.pose
        self._reports = DockReports(None if setup.usbl else (pose.heading, pose.depth))
        self._always = not setup.usbl  # known by the chart, whether it is heard or not
        self._mouth, self._nose = pose.position[:2], setup.vehicle.nose
        self._structure = self.dock.structure
        self._start = setup.heading, setup.depth
        self._carrot = Carrot(setup.period)
        self.phase, self.attempt = Phase.SEARCH, 1
        self.along = self.cross = math.nan  # of the nose, by the estimate [m]
        self._since, self._in_line = 0.0, math.nan

    @property
    def at_rest(self) -> bool:
        """Whether the latch holds the vehicle."""
        return self.phase == Phase.DOCKED

    @property
    def approach(self) -> int | None:
        """Number of the attempt whose approach is under way."""
        return self.attempt if self.phase in (Phase.APPROACH, Phase.FINAL) else None

    def row(self) -> tuple[Any, ...]:
        """Attempt, distance of the nose along the dock's axis and across it, as estimated."""
        return self.attempt, self.along, self.cross

    def overdue(self, duration: float) -> str:
        """Says that it has not docked in time."""
        return f"not docked within {duration:g} s"

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """What a docking is judged by."""
        return docking_metrics(log)

    def update(self, now: Situation) -> Setpoints | Station:
        """The setpoints now."""
        self._reports.observe(now.readings)
        if now.latched and self.phase != Phase.DOCKED:
            self._enter(Phase.DOCKED, now.time, "latched")
        silence = 0.0 if self._always else now.time - self._reports.last
        if self.phase not in (Phase.DOCKED, Phase.ABORTED) and silence > self._s.lost_timeout:
            self._enter(Phase.ABORTED, now.time, f"no fix for {silence:.0f} s")
        if self.finished:
            return Setpoints(self._reports.axis, now.depth, 0.0)  # in the cage it stays in line, and presses nowhere
        estimate = now.estimate
        if estimate is None or not estimate.initialised or not self._reports.count:
            return Setpoints(*self._start, 0.0)
        here, _, heading = estimate.at(now.time)
        self._locate(here, heading)
        if self.phase == Phase.SEARCH:
            self._enter(Phase.HOMING, now.time, "first fix")
        goal, speed = self._decide(now.time, estimate, heading, silence)
        return self._station(goal, speed, here, self._facing(goal, here))

    def _decide(self, time: float, estimate: Estimate, heading: float, silence: float) -> tuple[Array, float]:
        """Where the nose is to go, in the dock's frame, and how fast; enters the phases."""
        s, gate = self._s, np.array((-self._s.gate_distance, 0.0))
        if self.phase in (Phase.APPROACH, Phase.FINAL):
            reason = self._reason_to_break_off(time, silence)
            if reason:
                self._break_off(time, reason)
            elif self.phase == Phase.APPROACH and self.along > -s.final_distance:
                text = f"{-self.along:.1f} m before the entrance, {self.cross:+.2f} m off the axis"
                self._enter(Phase.FINAL, time, text)
        if self.phase in (Phase.APPROACH, Phase.FINAL):
            outside, off = self.along < 0.0, abs(self.cross) > s.corridor
            goal = self.along if outside and off else self._structure.latched + PUSH
            return np.array((goal, 0.0)), s.creep_speed
        if self.phase == Phase.GO_AROUND:
            if self.along < -NEAR or abs(self.cross) > ASIDE:
                self._enter(Phase.HOMING, time, f"out of the dock, attempt {self.attempt}")
            return gate, s.creep_speed
        if self.along > -NEAR:  # beside or behind the dock: first clear of it, then forward
            side = math.copysign(ASIDE, self.cross)
            clear = abs(self.cross) > ASIDE - 1.0
            return np.array((gate[0] if clear else self.along, side)), s.transit_speed
        if self._is_in_line(gate, heading) and self._is_certain(estimate):
            self._in_line = time if math.isnan(self._in_line) else self._in_line
            if time - self._in_line >= s.settling and silence < s.fix_timeout:
                self._enter(Phase.APPROACH, time, f"in line at the gate, attempt {self.attempt}")
        else:
            self._in_line = math.nan
        return gate, s.transit_speed

    def _is_in_line(self, gate: Array, heading: float) -> bool:
        off = math.hypot(self.along - gate[0], self.cross - gate[1])
        return off < self._s.gate_radius and abs(wrap(heading - self._reports.axis)) < AIMED

    def _is_certain(self, estimate: Estimate) -> bool:
        """Whether the place across the axis is known to a third of the mouth's radius."""
        across = np.array((-math.sin(self._reports.axis), math.cos(self._reports.axis)))
        variance = float(across @ estimate.horizontal_covariance @ across)
        return math.sqrt(max(variance, 0.0)) < self._structure.mouth_radius / 3.0

    def _reason_to_break_off(self, time: float, silence: float) -> str | None:
        """What is wrong with this attempt."""
        if silence > self._s.fix_timeout:
            return f"no fix for {silence:.0f} s"
        if self.along > -0.2 and abs(self.cross) > self._structure.mouth_radius:
            return f"entrance missed by {abs(self.cross):.2f} m"
        if time - self._since > self._s.patience:
            return f"not captured within {self._s.patience:.0f} s"
        return None

    def _break_off(self, time: float, reason: str) -> None:
        if self.attempt >= self._s.attempts:
            self._enter(Phase.ABORTED, time, f"{reason}; attempt {self.attempt} was the last")
            return
        self.attempt += 1
        self._enter(Phase.GO_AROUND, time, f"{reason}; attempt {self.attempt} follows")

    def _locate(self, here: Array, heading: float) -> None:
        """The nose in the dock's frame."""
        nose = here + self._nose * np.array((math.cos(heading), math.sin(heading))) - self._mouth
        self.along, self.cross = (self._to_ned.T @ nose).tolist()

    @property
    def _to_ned(self) -> Array:
        """(2, 2) from the dock's frame to north and east."""
        cos, sin = math.cos(self._reports.axis), math.sin(self._reports.axis)
        return np.array(((cos, -sin), (sin, cos)))

    def _facing(self, goal: Array, here: Array) -> float:
        """The dock's axis; on a longer way to the gate, where it goes."""
        way = self._mouth + self._to_ned @ goal - here
        if self.phase == Phase.HOMING and float(np.hypot(*way)) > FACE:
            return math.atan2(way[1], way[0])
        return self._reports.axis

    def _station(self, goal: Array, speed: float, here: Array, facing: float) -> Station:
        """A place on the way of the vehicle's origin to where its nose is at a goal."""
        origin = self._mouth + self._to_ned @ (goal - (self._nose, 0.0))
        place = self._carrot.move(origin, here, speed)
        return Station(facing, self._reports.depth, speed, tuple(place.tolist()))

    def _enter(self, phase: Phase, time: float, reason: str) -> None:
        self.events.append(Event(time, phase.name.lower(), reason))
        # The last metre belongs to the approach, whose time goes on.
        self._since = self._since if phase == Phase.FINAL else time
        self.phase, self.finished = phase, phase in (Phase.DOCKED, Phase.ABORTED)
