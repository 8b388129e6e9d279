"""Docking guidance: search, homing to the gate on the dock's axis, approach, the last metres, go-around, abort.

The law is line of sight with the crab angle taken from the estimated current. Where a cross current would turn the
heading too far off the dock's axis for the funnel, the approach line is turned instead, so that it still runs through
the entrance; where the current is strong, the vehicle goes faster. All of it is decided in the dock's frame, by the
estimate without the estimated errors of compass and gauge: x along the course of a vehicle that enters, y to starboard,
origin at the centre of the mouth.
"""

import math
from collections.abc import Sequence
from typing import Any, ClassVar

from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.control.controller import Setpoints
from auvsim.data.log import VehicleLog
from auvsim.missions.docking import path, speeds
from auvsim.missions.docking.columns import COLUMNS, VARIABLES
from auvsim.missions.docking.decisions import NO_RETURN, SoFar, above_or_below, not_ready, reason_to_break_off
from auvsim.missions.docking.heard import Heard
from auvsim.missions.docking.jam import jam_watch
from auvsim.missions.docking.lag import LagWatch
from auvsim.missions.docking.metrics import docking_metrics
from auvsim.missions.docking.path import CLEAR
from auvsim.missions.docking.relative import Locator, Relative
from auvsim.missions.docking.settings import DockingSettings, Phase
from auvsim.missions.docking.speeds import approach_course
from auvsim.missions.docking.target import find_dock
from auvsim.missions.docking.weave import NEEDED, STRAIGHT, Leg, Weave, least_weave, miss_deviation, prior_of
from auvsim.missions.line_of_sight import course_to_line, cross_track, heading_for_course
from auvsim.missions.mission import Event, Mission, MissionSetup, Situation
from auvsim.navigation.estimate import Estimate

__all__ = ["CLEAR", "Docking", "DockingSettings", "Phase", "approach_course", "find_dock"]

BACKING = 60.0  # longest time of backing out [s]
FREEING = 20.0  # time of backing away from what holds the vehicle [s]
EARLY = 4.0  # deviation across the axis by the mouth's radius with which the last metres are begun if a fix is to come
MEETS = 11.0  # distance before the mouth at which a fix is to come in unsteady water [m]
OFTEN = 6.5  # time between fixes so frequent that one comes there anyway [s]
HURRY = 1.5  # highest factor on the speed over ground for that
FASTER = 0.3  # by how much homing is faster than an approach in a strong current [m/s]
UNSTEADY_GAIN = 10.0  # how much faster for each m/s by which the current is uncertain beyond that [-]
STEADY = 0.05  # deviation of a current that counts as known [m/s]
RUSH = 0.5  # by how much that may exceed the speed of homing [m/s]
AGAIN = 0.2  # how much faster each further attempt is [m/s]
HOPELESS = 0.1  # speed over ground that is none [m/s]


class Docking(Mission):
    """The phase machine of a docking.

    Raises:
        InputError: there is no structure to dock at, or several and none is named.
    """

    Settings = DockingSettings
    phases = tuple(phase.name.lower() for phase in Phase)
    variables: ClassVar = VARIABLES
    columns: ClassVar = COLUMNS
    aftermath = 5.0

    def __init__(self, setup: MissionSetup) -> None:
        super().__init__(setup)
        settings: DockingSettings = setup.settings
        self.dock = find_dock(settings.dock, setup.structures)
        self._s, self._vehicle = settings, setup.name
        assert self.dock is not None
        self._mouth_radius, self._latched = self.dock.structure.mouth_radius, self.dock.structure.latched
        pose = self.dock.pose
        self._locator = Locator((pose.north, pose.east), setup.vehicle.nose, setup.period)
        self._fixes, self._weave = setup.fixes, STRAIGHT  # what tells where it is; the weave that is flown
        self._lag = LagWatch()
        self._jam = jam_watch(self.dock.structure, setup.vehicle.nose, setup.fixes)
        self._backs_until = -math.inf  # time until which it backs away from what holds it [s]
        self._limit = math.radians(settings.heading_limit_deg)
        self._fastest = speeds.fastest(setup.holds)
        self.phase = Phase.SEARCH
        self.attempt = 1
        self._here: Relative | None = None
        self._reports = Heard(None if setup.usbl else (pose.heading, pose.depth), setup.ranges)
        self._certain = 0.0  # when the position across the axis was last known better than the mouth's radius
        self._hold: tuple[float, float] | None = None  # heading and depth held in search
        self._side = 1.0  # on which the dock is passed: 1 to starboard of its axis
        self._leg = 1  # of the path to a gate: 0 back out of the funnel, 1 round the dock, 2 to the gate
        self._waits_for = ""  # what keeps the vehicle at a gate
        self._returns = 0  # to a gate without an attempt counted
        self._phase_start = 0.0
        self._nearest = (math.inf, 0.0)  # least distance to the gate [m] and when that was [s]
        self._paced: tuple[Relative | None, int, float] = (None, 0, 0.0)  # place and attempt of the last speed, and it
        self._pace = 1.0  # factor on the speed over ground of an approach, for a fix to come in time
        self._occupant: str | None = None  # another vehicle in the dock, as reported in its packets

    @property
    def axis(self) -> float:
        """Course of the dock's axis as the dock reports it [rad]."""
        return self._reports.axis

    @property
    def dock_depth(self) -> float:
        """Depth of the mouth [m], the mean of what the dock reported."""
        return self._reports.depth

    @property
    def along(self) -> float:
        """Estimated distance of the nose along the axis, negative before the mouth [m]; NaN before there is any."""
        return self._here.along if self._here else math.nan

    @property
    def cross(self) -> float:
        """Estimated distance of the nose to starboard of the axis [m]; NaN before there is any."""
        return self._here.cross if self._here else math.nan

    @property
    def at_rest(self) -> bool:
        """Whether the latch holds the vehicle."""
        return self.phase == Phase.DOCKED

    @property
    def approach(self) -> int | None:
        """Number of the attempt whose approach is under way."""
        return self.attempt if self.phase in (Phase.APPROACH, Phase.FINAL) else None

    def row(self) -> tuple[Any, ...]:
        """Values of `variables`."""
        h = self._here
        if h is None:
            return (self.attempt, *(math.nan,) * 5)
        return self.attempt, h.along, h.cross, h.below, h.cross_deviation, h.axis

    def overdue(self, duration: float) -> str:
        """Says that it has not docked in time, and what it was doing."""
        doing = f", waits at the gate: {self._waits_for}" if self._waits_for and self.phase != Phase.SEARCH else ""
        return self._with_clock(f"not docked within {duration:g} s{doing}")

    def _with_clock(self, reason: str) -> str:
        """A reason for giving up, after that the dock's clock is off where the fixes show it."""
        offset = self._lag.offset()
        return reason if offset is None else f"the dock's clock is off by {offset:+.1f} s: {reason}"

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """What a docking is judged by, see `docking.metrics`."""
        return docking_metrics(log)

    def _observe(self, readings: Sequence[Reading]) -> None:
        """Takes the dock's reports among `readings`."""
        self._reports.observe(readings)

    def update(self, now: Situation) -> Setpoints:
        """The setpoints now."""
        if self._hold is None:  # the first call
            self._reports.begin(now.time)
        self._observe(now.readings)
        self._lag.observe(now.readings, now.estimate)
        if now.estimate is not None:
            self._reports.judge(now.estimate)
        for delivery in now.messages:
            if delivery.message.kind == "usbl" and delivery.message.payload.occupant not in (None, self._vehicle):
                self._occupant = delivery.message.payload.occupant
        setpoints = self._decide(now)
        self._locator.commanded(setpoints.speed)
        if self._jam:
            self._jam.driven(now.time, setpoints.speed)
        self.finished = self.phase in (Phase.DOCKED, Phase.ABORTED)
        return setpoints

    def _decide(self, now: Situation) -> Setpoints:
        time, estimate, compass, gauge = now.time, now.estimate, now.heading, now.depth
        if self._hold is None:
            self._hold = (compass, gauge)
        if now.latched and self.phase != Phase.DOCKED:
            self._enter(Phase.DOCKED, time, "latched")
        if self.phase in (Phase.DOCKED, Phase.ABORTED):
            return Setpoints(compass, gauge, 0.0)
        if self._occupant is not None:
            return self._abort(now, f"the dock is occupied by '{self._occupant}'")
        if self._reports.silence(time) > self._s.lost_timeout:
            return self._abort(now, self._reports.lost(time))
        if estimate is None or not estimate.initialised or not self._reports.count:
            return Setpoints(*self._hold, self._s.approach_speed)
        here = self._locator.locate(time, estimate, compass, gauge, self._reports.axis, self._reports.depth)
        self._here = here
        if self.phase == Phase.SEARCH:
            self._enter(Phase.HOMING, time, "first fix")
            self._side = math.copysign(1.0, here.cross)
        held = self._jam.observe(now.readings, here.off) if self._jam else None
        if self.phase in (Phase.HOMING, Phase.GO_AROUND):
            if held:
                self._free(time, held)
            heading, depth, speed, rudder = self._homing(time, here)
            if self._s.weave and self.phase == Phase.APPROACH:
                self._weave = self._planned_weave(estimate, here)
                if self._weave.amplitude:
                    text = f"{self._weave.amplitude:.1f} m to both sides of the line"
                    self.events.append(Event(time, "weave", text))
        else:
            reason = held or self._reason_to_break_off(time, here)
            if held:
                self._backs_until = time + FREEING
            following = self._break_off(time, here, reason) if reason else self._follow_line(time, here)
            heading, depth, speed, rudder = following
            stands = self.phase == Phase.APPROACH and not self._comes_nearer(time, -here.along)
            if stands:
                reason = self._too_strong(here, True) or f"no progress, {-here.along:.0f} m before the entrance"
                return self._abort(now, reason)
        # What compass and gauge will show when it is so.
        return Setpoints(wrap(heading + here.compass_bias), depth + here.depth_bias, speed, rudder)

    def _enter(self, phase: Phase, time: float, reason: str) -> None:
        if phase == Phase.ABORTED:
            reason = self._with_clock(reason)
        self.events.append(Event(time, phase.name.lower(), reason))
        self.phase, self._phase_start, self._nearest = phase, time, (math.inf, time)

    def _abort(self, now: Situation, reason: str) -> Setpoints:
        self._enter(Phase.ABORTED, now.time, reason)
        return Setpoints(now.heading, now.depth, 0.0)

    def _speed(self, here: Relative) -> float:
        """Speed through the water on an approach: the set one, or what the current asks for [m/s].

        The way on which line of sight takes an error back does not depend on speed, the time does: the stronger the
        current, the less steady, and the more attempts it has foiled, the faster.
        """
        if self._paced[0] is here and self._paced[1] == self.attempt:
            return self._paced[2]
        s = self._s
        unsteady = UNSTEADY_GAIN * max(here.unsteadiness - STEADY, 0.0) + AGAIN * (self.attempt - 1)
        least = max(s.approach_speed, s.speed_per_current * math.hypot(*here.current)) + unsteady
        least = min(least, max(s.homing_speed, s.approach_speed) + RUSH)
        crab = math.radians(s.crab_limit_deg)
        speed = speeds.speed_through_water(least, here.axis, here.current, s.ground_speed, crab, self._fastest)
        self._paced = here, self.attempt, speed
        return speed

    def _homing_speed(self, here: Relative) -> float:
        s = self._s
        needed = self._speed(here)
        faster = needed + FASTER if needed > s.approach_speed else needed
        return min(max(s.homing_speed, faster, math.hypot(*here.current) + s.ground_speed), self._fastest)

    def _line(self, here: Relative) -> float:
        """Course of the approach line [rad]."""
        return approach_course(here.axis, self._speed(here), here.current, self._limit)

    def _homing(self, time: float, here: Relative) -> Setpoints:
        """To the gate; on a go-around first back out of the funnel, then to a gate beside the line."""
        s, retry = self._s, self.phase == Phase.GO_AROUND
        if time < self._backs_until:
            return Setpoints(here.axis, self.dock_depth, -0.8 * s.approach_speed)
        if retry and self._leg == 0:
            if time - self._phase_start < BACKING and not self._has_room(here):
                return Setpoints(here.axis, self.dock_depth, -0.8 * s.approach_speed)
            self._leg = 1
        distance = s.retry_distance if retry else s.gate_distance
        aside = 0.5 * self._side * path.ABEAM[1] if retry else 0.0
        gate = path.on_line(-distance, aside, wrap(self._line(here) - here.axis))
        return self._to_gate(time, here, gate, distance)

    def _to_gate(self, time: float, here: Relative, gate: tuple[float, float], distance: float) -> Setpoints:
        """To a gate of the dock frame, from beside or behind the dock first round it; held there until all is ready."""
        speed = self._homing_speed(here)
        abeam = path.ABEAM[0], self._side * path.ABEAM[1]
        if here.along < -path.BEFORE or math.hypot(here.along - abeam[0], here.cross - abeam[1]) < 15.0:
            self._leg = 2
        if self._leg == 1:
            return self._on_course(here, path.course_to(here, abeam), speed)
        away = math.hypot(here.along - gate[0], here.cross - gate[1])
        if self._waits_for or away < self._s.gate_radius:
            left = min(distance, -here.along)
            way = speeds.way_through_water(left, self._line(here), self._speed(here), here.current)
            self._waits_for = not_ready(here, distance, way, self._s) or ""
            if not self._waits_for and away < 2.0 * self._s.gate_radius:
                hopeless = self._too_strong(here)
                if hopeless:
                    self._enter(Phase.ABORTED, time, hopeless)
                    return Setpoints(here.heading, self.dock_depth, 0.0)
                self._enter(Phase.APPROACH, time, f"gate reached, attempt {self.attempt}")
            elif self._waits_for:
                return self._on_course(here, path.orbit(here, gate, self._side), speed)
        elif not self._comes_nearer(time, away):
            reason = self._too_strong(here, True) or f"no progress, {away:.0f} m from the gate"
            self._enter(Phase.ABORTED, time, reason)
            return Setpoints(here.heading, self.dock_depth, 0.0)
        return self._on_course(here, path.course_to(here, gate), speed)

    def _on_course(self, here: Relative, course: float, speed: float) -> Setpoints:
        return Setpoints(heading_for_course(course, speed, here.current), self.dock_depth, speed)

    def _comes_nearer(self, time: float, away: float) -> bool:
        if away < self._nearest[0] - 5.0:
            self._nearest = (away, time)
        return time - self._nearest[1] <= self._s.progress_timeout

    def _too_strong(self, here: Relative, drifting: bool = False) -> str | None:
        """That the vehicle is too slow for the current on the approach line, or anywhere where it drifts; else None."""
        along = speeds.ground_speed_along(self._line(here), self._fastest, here.current)
        current = math.hypot(*here.current)
        if along > HOPELESS and (current < self._fastest or not drifting):
            return None
        return f"current too strong for this vehicle: {current:.2f} m/s, it makes {self._fastest:.2f} m/s"

    def _meets_fix(self, here: Relative) -> float | None:
        """Time between two fixes [s] of which one is to be met shortly before the mouth; None where none need be.

        In unsteady water the position is lost between two fixes, so that it matters how old the last one is at the
        mouth; unless they are so frequent that one comes there anyway.
        """
        interval = self._reports.interval
        if interval is None or interval < OFTEN or here.unsteadiness * interval < 0.5 * self._mouth_radius:
            return None
        return interval

    def _timed(self, time: float, here: Relative, speed: float) -> float:
        """Speed through the water [m/s], `speed` or more, for a fix to come where it still helps.

        Close before that place the pace stays as it is.
        """
        interval, way = self._meets_fix(here), -here.along - MEETS
        if interval is None:
            self._pace = 1.0
            return speed
        slow = max(speeds.ground_speed_along(self._line(here), speed, here.current), speeds.SLOWEST)
        if way > 0.5 * MEETS:
            wait = self._reports.due(time, way / (HURRY * slow), interval)
            self._pace = min(max(way / (wait * slow), 1.0), HURRY)
        crab = math.radians(self._s.crab_limit_deg)
        return speeds.speed_through_water(speed, here.axis, here.current, self._pace * slow, crab, self._fastest)

    def _follow_line(self, time: float, here: Relative) -> Setpoints:
        """Along the approach line, by line of sight."""
        speed, line = self._speed(here), self._line(here)
        # Cross-track error from the line of course `line` through the centre of the mouth, positive to starboard.
        error = cross_track(line, here.north, here.east)
        offset, slope = self._weave.at(here.north * math.cos(line) + here.east * math.sin(line))
        course = course_to_line(line + math.atan(slope), error - offset, self._s.lookahead)
        return self._on_course(here, course, self._timed(time, here, speed))

    def _planned_weave(self, estimate: Estimate, here: Relative) -> Weave:
        """The weave of an approach that begins."""
        assert self.dock is not None
        s, line, pose = self._s, self._line(here), self.dock.pose
        begin = here.north * math.cos(line) + here.east * math.sin(line)
        leg = Leg(
            line, here.axis, (pose.north, pose.east, pose.depth), begin, -s.final_distance, self._speed(here),
            here.current, s.lookahead,
        )  # fmt: skip
        prior = prior_of(estimate)
        return least_weave(
            leg, s.weave, self._mouth_radius / NEEDED, lambda weave: miss_deviation(leg, weave, self._fixes, prior)
        )

    def _reason_to_break_off(self, time: float, here: Relative) -> str | None:
        """What is wrong with this attempt; enters the last metres when they begin."""
        if here.cross_deviation <= self._mouth_radius or self.phase != Phase.FINAL:
            self._certain = time
        begins = self.phase == Phase.APPROACH and here.along > -self._s.final_distance
        most = self._mouth_radius * (1.0 if self._meets_fix(here) is None else EARLY)
        if begins and here.cross_deviation > most and self._returns < self._s.returns:
            return f"off-axis position uncertain by {here.cross_deviation:.1f} m"
        if begins:
            text = f"{-here.along:.0f} m before the entrance, {here.cross:+.2f} m off the axis, "
            self._enter(Phase.FINAL, time, text + above_or_below(here.below))
        final = self.phase == Phase.FINAL
        last = self.attempt >= self._s.attempts and self._returns >= self._s.returns
        so_far = SoFar(
            silence=self._reports.silence(time), uncertain=time - self._certain,
            final=time - self._phase_start if final else None, last=last,
        )  # fmt: skip
        return reason_to_break_off(here, so_far, self._s, self._mouth_radius, self._latched)

    def _break_off(self, time: float, here: Relative, reason: str) -> Setpoints:
        """Ends an attempt; before the point of no return it does not count as one, so often as the settings say."""
        self._side = math.copysign(1.0, here.cross)
        if (self.phase == Phase.APPROACH or here.along < -NO_RETURN) and self._returns < self._s.returns:
            self._returns += 1
            self._enter(Phase.GO_AROUND, time, f"{reason}; attempt {self.attempt} anew")
        elif self.attempt >= self._s.attempts:
            self._enter(Phase.ABORTED, time, f"{reason}; attempt {self.attempt} was the last")
            return Setpoints(here.axis, self.dock_depth, 0.0)
        else:
            self.attempt += 1
            self._enter(Phase.GO_AROUND, time, f"{reason}; attempt {self.attempt} follows")
        # In or close before the funnel back out first; beside or behind it, or far off, go round at once.
        room = -CLEAR - self._s.turning_radius
        in_the_way = room < here.along < self._latched + 0.5 and abs(here.cross) < path.BESIDE
        self._leg = 0 if in_the_way else 1
        return self._homing(time, here)

    def _free(self, time: float, held: str) -> None:
        """Drives off what holds the vehicle on the way to a gate: astern, or ahead if it was backing."""
        backing = time < self._backs_until or (self.phase == Phase.GO_AROUND and self._leg == 0)
        self._backs_until = -math.inf if backing else time + FREEING
        self._leg = max(self._leg, 1)
        self.events.append(Event(time, "jammed", held.removeprefix("jammed ")))

    def _has_room(self, here: Relative) -> bool:
        """Whether the vehicle can turn before the dock; sets to which side."""
        self._side, free = path.room_to_turn(here, self._s.turning_radius)
        return free
