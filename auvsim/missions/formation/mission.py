"""A formation as a mission: a vehicle keeps its station by its own estimate; a follower may choose it by the bound."""

import math
from typing import Any, ClassVar

import numpy as np

from auvsim.base.frames import Array
from auvsim.control.controller import Setpoints
from auvsim.data.log import VehicleLog
from auvsim.data.variables import Variable
from auvsim.missions.formation import choice
from auvsim.missions.formation.choice import Choice, Heard
from auvsim.missions.formation.metrics import formation_metrics
from auvsim.missions.formation.settings import FormationSettings
from auvsim.missions.line_of_sight import course_to_line, heading_for_course
from auvsim.missions.mission import Event, Metric, Mission, MissionSetup, Situation

SEARCH, ON_STATION, ALONE, LEAVING, DONE = range(5)
SLOWEST = 0.5  # speed through the water below which fins do not steer [m/s]
SMOOTHED = 20.0  # time over which the drift is averaged [s]
WORTH = 0.95  # share of the bound at the present station below which another is worth the way


class Formation(Mission):
    """Keeps a station about a moving point, and says whom it hears.

    A follower looks every `follow.period` at which of its leaders it hears and where they are. If one is gone or there
    again it says so, and goes on with the others where two or more are left; with fewer it keeps its station by dead
    reckoning and says that. Where it may, it moves to the station of the least bound.
    """

    Settings = FormationSettings
    phases = ("search", "on_station", "alone", "leaving", "done")
    variables: ClassVar = {
        "ahead": Variable((), "float64", "m", "station: ahead of the moving point"),
        "starboard": Variable((), "float64", "m", "station: to starboard of it"),
        "target": Variable(("north_east",), "float64", "m", "north and east of the station"),
        "along": Variable((), "float64", "m", "estimated position less the station, along the course"),
        "across": Variable((), "float64", "m", "likewise to starboard"),
        "heard": Variable((), "int32", "1", "leaders that are not silent"),
        "bound": Variable((), "float64", "m", "least rms position error by what is heard; of a leader NaN"),
    }
    columns: ClassVar = {
        "finished": Metric("bool", "1", "whether it lasted to its end in formation"),
        "station_rms": Metric("float", "m", "true distance from the station, rms, while on it"),
        "station_max": Metric("float", "m", "largest of it"),
    }
    aftermath = 2.0

    def __init__(self, setup: MissionSetup) -> None:
        super().__init__(setup)
        s: FormationSettings = setup.settings
        self._s, self._hold = s, setup.heading
        course = math.radians(s.course_deg)
        self._course = course
        self._velocity = s.speed * np.array([math.cos(course), math.sin(course)])
        self._planned = np.array([s.ahead, s.starboard])
        self._heard: dict[str, Heard] = {}
        self._present: tuple[str, ...] = ()
        self._speed, self._drift, self._period = s.speed, np.zeros(2), setup.period
        self._next = s.follow.period  # look at what is heard; all have spoken by then [s]
        self._choice = Choice(self._planned, math.nan)
        self._target, self._error = np.full(2, math.nan), np.full(2, math.nan)

    def update(self, now: Situation) -> Setpoints:
        """The setpoints now."""
        s, estimate = self._s, now.estimate
        choice.listen(self._heard, s.leaders, now.messages)
        if self.phase == DONE:
            return Setpoints(now.heading, s.depth, 0.0)
        if estimate is None or not estimate.initialised:
            return Setpoints(self._hold, s.depth, s.speed)
        if self.phase == SEARCH:
            self._enter(ON_STATION, now.time, f"station {self._text(self._planned)}")
        if now.time >= s.lasts:
            self._enter(DONE, now.time, f"formation of {s.lasts:g} s")
            self.finished = True
            return Setpoints(now.heading, s.depth, 0.0)
        if s.leaves is not None and now.time >= s.leaves:
            if self.phase != LEAVING:
                self._enter(LEAVING, now.time, "leaves the formation to starboard")
            return Setpoints(self._course + math.pi / 2.0, s.depth, s.speed)
        if s.leaders and now.time >= self._next:
            self._next = now.time + s.follow.period
            self._look(now.time)
        return self._keep(now)

    def row(self) -> tuple[Any, ...]:
        """Values of `variables`."""
        return *self._choice.station, self._target, *self._error, len(self._present), self._choice.bound

    def overdue(self, duration: float) -> str:
        """Text for the log."""
        return f"in formation at {duration:g} s; it was to last {self._s.lasts:g} s"

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """Metrics of the station."""
        return formation_metrics(log)

    def _point(self, time: float) -> Array:
        return np.array([self._s.north, self._s.east]) + self._velocity * time

    def _keep(self, now: Situation) -> Setpoints:
        """Course and speed that lead to the station: along its line by speed, across it by line of sight."""
        s, estimate = self._s, now.estimate
        assert estimate is not None
        place, body, heading = estimate.at(now.time)
        drift = self._drifting(body, heading)
        c, sn = math.cos(self._course), math.sin(self._course)
        ahead, starboard = self._choice.station
        self._target = self._point(now.time) + np.array([c * ahead - sn * starboard, sn * ahead + c * starboard])
        off = place - self._target
        self._error = np.array([c * off[0] + sn * off[1], -sn * off[0] + c * off[1]])
        along = s.speed - max(-s.margin, min(s.margin, s.gain * self._error[0]))
        course = course_to_line(self._course, self._error[1], s.lookahead)
        ground = along / max(0.5, math.cos(course - self._course))
        water = ground * np.array([math.cos(course), math.sin(course)]) - drift
        self._speed = max(SLOWEST, float(np.hypot(*water)))
        wanted = heading_for_course(course, self._speed, (float(drift[0]), float(drift[1])))
        return Setpoints(wanted, s.depth, self._speed)

    def _drifting(self, body: Array, heading: float) -> Array:
        """Velocity over ground less the speed asked for, north and east, smoothed [m/s].

        That is the current, also where the estimate knows it only as part of the velocity over ground, and what is
        wrong with the speed that is asked for.
        """
        c, sn = math.cos(heading), math.sin(heading)
        forward = float(body[0]) - self._speed
        now = np.array([c * forward - sn * body[1], sn * forward + c * body[1]])
        self._drift = self._drift + min(1.0, self._period / SMOOTHED) * (now - self._drift)
        return self._drift

    def _look(self, time: float) -> None:
        """Whom a follower hears, and where it should stand by that."""
        s = self._s
        leaders = choice.present(self._heard, time, s.silent)
        names = tuple(leaders)
        for name in self._present:
            if name not in names:
                self.events.append(Event(time, "silent", f"{name} is not heard for {s.silent:g} s"))
        for name in names:
            if name not in self._present:
                self.events.append(Event(time, "heard", f"{name} is heard"))
        changed, self._present = names != self._present, names
        places = choice.stations(leaders, self._point(time), self._velocity, time)
        sigma = choice.deviations(leaders, s.follow)
        if len(names) < 2:
            self._choice = Choice(self._choice.station, math.inf)
            if changed or self.phase == ON_STATION:
                why = f"{len(names)} leader heard" if len(names) == 1 else "no leader heard"
                self._enter(ALONE, time, f"{why}, two are needed: keeps station by dead reckoning")
            return
        before = choice.bound_at(self._choice.station, places, sigma, s.speed, s.follow.interval, s.follow)
        best = choice.choose(self._planned, places, sigma, s.speed, s.follow.interval, s.follow)
        moves = best.bound < WORTH * before
        if self.phase == ALONE:
            self._enter(ON_STATION, time, f"goes on with {', '.join(names)}")
        elif changed and len(names) < len(s.leaders):
            self.events.append(Event(time, "goes_on", f"with {', '.join(names)}; bound {self._metres(before)}"))
        if moves:
            text = f"{self._text(best.station)}: bound {self._metres(best.bound)} instead of {self._metres(before)}"
            self.events.append(Event(time, "station", text))
        self._choice = best if moves else Choice(self._choice.station, before)

    def _enter(self, phase: int, time: float, text: str) -> None:
        self.phase = phase
        self.events.append(Event(time, self.phases[phase], text))

    @staticmethod
    def _text(station: Array) -> str:
        return f"{station[0]:.0f} m ahead, {station[1]:.0f} m to starboard"

    @staticmethod
    def _metres(value: float) -> str:
        return "none" if math.isinf(value) else f"{value:.2f} m"
