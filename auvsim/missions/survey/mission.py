"""A survey: a fix at the surface, a dive, lanes at an altitude, perhaps another fix, home and into the dock."""

import math
from dataclasses import replace
from typing import Any, ClassVar, Literal

from pydantic import Field

from auvsim.base.settings import Settings
from auvsim.control.controller import Setpoints
from auvsim.data.log import VehicleLog
from auvsim.data.variables import Variable
from auvsim.missions.docking.guidance import Docking, DockingSettings
from auvsim.missions.docking.metrics import docking_metrics
from auvsim.missions.line_of_sight import course_to_line, cross_track, heading_for_course
from auvsim.missions.mission import Event, Metric, Mission, MissionSetup, Situation
from auvsim.missions.survey.altitude import AltitudeKeeper
from auvsim.missions.track.patterns import LawnMower, Waypoints, points

FIX, DIVE, LANES, SURFACE, HOME = range(5)
OWN = ("fix", "dive", "lanes", "surface", "home")
SHALLOW = 0.15  # depth asked for at the surface [m]


class SurveySettings(Settings):
    """Lanes at an altitude, and home to the dock on the estimate until the dock is heard."""

    kind: Literal["survey"] = "survey"
    pattern: LawnMower | Waypoints = Field(default=LawnMower(), description="The way, by its `kind`.")
    altitude: float = Field(default=5.0, gt=0.5, le=1000.0, description="height above the floor [m]")
    deepest: float = Field(default=30.0, gt=0.0, description="depth that is safe wherever the floor is [m]")
    blind_depth: float = Field(default=8.0, gt=0.0, description="depth where the altimeter hears no floor [m]")
    patience: float = Field(default=5.0, gt=0.0, description="time without an echo after which that is so [s]")
    speed: float = Field(default=1.5, gt=0, description="speed through the water [m/s]")
    lookahead: float = Field(default=12.0, gt=0, description="lookahead of the line of sight [m]")
    radius: float = Field(default=6.0, gt=0, description="distance at which a waypoint counts as reached [m]")
    fix_time: float = Field(default=30.0, ge=0.0, description="time with fixes at the surface before a dive [s]")
    second_fix: bool = Field(default=False, description="whether it surfaces again for a fix after the lanes")
    lost_timeout: float = Field(
        default=300.0, gt=0.0, description="time about the dock without hearing it that ends the run [s]"
    )
    docking: DockingSettings = DockingSettings(gate_distance=50.0, gate_radius=10.0, retry_distance=50.0)


class Survey(Mission):
    """The phases of a survey; once the dock is heard on the way home those of `Docking`, which it then is."""

    Settings = SurveySettings
    phases = (*OWN, *Docking.phases)
    variables: ClassVar = {
        **Docking.variables,
        "waypoint": Variable((), "int32", "1", "number of the waypoint ahead, from 0"),
        "leg_cross_track": Variable((), "float64", "m", "estimated distance to starboard of the leg"),
        "floor": Variable((), "float64", "m", "depth of the sea floor by gauge and altimeter", "NED"),
    }
    columns: ClassVar = {
        **Docking.columns,
        "lanes_done": Metric("bool", "1", "whether the last waypoint was reached"),
        "least_altitude": Metric("float", "m", "least true height above the floor by the altimeter on the lanes"),
    }
    aftermath = Docking.aftermath

    def __init__(self, setup: MissionSetup) -> None:
        super().__init__(setup)
        s: SurveySettings = setup.settings
        self._s = s
        self._docking = Docking(_of_docking(setup, s))
        self.dock = self._docking.dock
        assert self.dock is not None
        pose, gate = self.dock.pose, s.docking.gate_distance
        self._gate = (pose.north - gate * math.cos(pose.heading), pose.east - gate * math.sin(pose.heading))
        self._keeper = AltitudeKeeper(setup.altimeters, s.altitude, s.deepest, s.blind_depth, s.patience)
        self._points = points(s.pattern).tolist()
        self._hold, self._start_depth = setup.heading, setup.depth
        self._since = 0.0  # when the phase began [s]
        self._fixed: float | None = None  # when the first fix of this surfacing was used [s]
        self._from: tuple[float, float] | None = None
        self.waypoint, self.cross = 0, math.nan
        self._handed = False

    @property
    def at_rest(self) -> bool:
        """Whether the latch holds the vehicle."""
        return self._docking.at_rest

    @property
    def fixed_again(self) -> bool:
        """Whether there was a second fix at the surface."""
        return self._s.second_fix and self.phase >= HOME

    @property
    def approach(self) -> int | None:
        """Number of the attempt whose approach is under way."""
        return self._docking.approach

    def row(self) -> tuple[Any, ...]:
        """Values of `variables`."""
        return (*self._docking.row(), min(self.waypoint, len(self._points) - 1), self.cross, self._keeper.floor)

    def update(self, now: Situation) -> Setpoints:
        """The setpoints now."""
        self._keeper.observe(now.readings, now.depth)
        if not self._handed and self.phase == HOME and any(r.sensor == "usbl" for r in now.readings):
            self._handed = True
        if self._handed:
            return self._dock(now)
        estimate = now.estimate
        if estimate is None or not estimate.initialised:
            return Setpoints(self._hold, SHALLOW, self._s.speed)
        if self.phase in (FIX, SURFACE):
            return self._at_the_surface(now)
        depth = self._keeper.depth(now.time)
        if self.phase == DIVE and abs(now.depth - depth) < 1.0:
            self._enter(LANES, now.time, f"{len(self._points)} waypoints")
        (north, east), _, _ = estimate.at(now.time)
        target = self._target(now.time, float(north), float(east))
        return Setpoints(self._course(now, float(north), float(east), target), depth, self._s.speed)

    def overdue(self, duration: float) -> str:
        """Says that it has not docked in time, and what it was doing."""
        return f"not docked within {duration:g} s: {self.phases[self.phase]}"

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """Those of the docking, whether the lanes were done, and the least altitude on them."""
        mission = log["mission"]
        on_lanes = mission["phase"] == LANES
        done = bool((mission["phase"] > LANES).any())
        floor, time = mission["floor"][on_lanes], mission["time"][on_lanes]
        least = None
        if len(time):
            truth = log["truth"]
            depth = truth["position"][:, 2]
            k = truth["time"].searchsorted(time).clip(max=len(depth) - 1)
            least = float((floor - depth[k]).min())
        return {**docking_metrics(log), "lanes_done": done, "least_altitude": least}

    def _dock(self, now: Situation) -> Setpoints:
        setpoints = self._docking.update(now)
        self.events += self._docking.events
        self._docking.events.clear()
        self.phase = len(OWN) + int(self._docking.phase)
        self.finished = self._docking.finished
        return setpoints

    def _at_the_surface(self, now: Situation) -> Setpoints:
        """Straight on at the surface until there have been fixes for a while."""
        assert now.estimate is not None
        if any(o.kind in ("fix", "gps") and o.accepted for o in now.estimate.outcomes) or self.phase == FIX:
            self._fixed = now.time if self._fixed is None else self._fixed
        if self._fixed is not None and now.time - self._fixed >= self._s.fix_time:
            self._enter(DIVE if self.phase == FIX else HOME, now.time, "position fixed")
        return Setpoints(self._hold, SHALLOW, self._s.speed)

    def _target(self, time: float, north: float, east: float) -> tuple[float, float]:
        """The point to go to: the waypoint ahead, then the gate before the dock."""
        if self._from is None:
            self._from = (north, east)
        target = self._gate if self.waypoint == len(self._points) else tuple(self._points[self.waypoint])
        passed = _passed(self._from, target, north, east)
        if math.hypot(target[0] - north, target[1] - east) < self._s.radius or passed:
            if self.phase in (DIVE, LANES):
                self.events.append(Event(time, "waypoint", f"{self.waypoint} reached"))
                self.waypoint, self._from = self.waypoint + 1, target
                if self.waypoint == len(self._points):
                    self._hold = math.atan2(self._gate[1] - east, self._gate[0] - north)
                    self._fixed = None
                    self._enter(SURFACE if self._s.second_fix else HOME, time, "last waypoint reached")
            elif time - self._since > self._s.lost_timeout:
                self.finished = True
                self._enter(len(OWN) + 6, time, "the dock is not heard")
        return target  # pyright: ignore[reportReturnType]

    def _course(self, now: Situation, north: float, east: float, target: tuple[float, float]) -> float:
        """The heading that leads to the leg to a target and along it."""
        assert self._from is not None
        line = math.atan2(target[1] - self._from[1], target[0] - self._from[0])
        self.cross = cross_track(line, north - self._from[0], east - self._from[1])
        if self.phase == HOME:
            course = math.atan2(target[1] - east, target[0] - north)
        else:
            course = course_to_line(line, self.cross, self._s.lookahead)
        estimate = now.estimate
        assert estimate is not None
        wanted = heading_for_course(course, self._s.speed, (float(estimate.current[0]), float(estimate.current[1])))
        return wanted + estimate.value("compass_bias")

    def _enter(self, phase: int, time: float, text: str) -> None:
        self.phase, self._since = phase, time
        self.events.append(Event(time, self.phases[phase], text))


def _of_docking(setup: MissionSetup, settings: SurveySettings) -> MissionSetup:
    return replace(setup, settings=settings.docking)


def _passed(begin: tuple[float, float], end: tuple[float, float], north: float, east: float) -> bool:
    """Whether a place is abeam of the end of a leg, or past it."""
    along = (end[0] - begin[0], end[1] - begin[1])
    return (north - end[0]) * along[0] + (east - end[1]) * along[1] > 0.0 < math.hypot(*along)
