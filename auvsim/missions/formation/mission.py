"""A formation as a mission: each vehicle keeps a station by its own estimate; a follower chooses its own by the bound."""

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
WORTH = 0.95  # share of the bound at the present station below which another is worth the way


class Formation(Mission):
    """Keeps a station about a moving point, and says whom it hears.

    A follower looks every `choice.period` at which of its leaders it hears and where they are. If one is gone or there
    again it says so, and goes on with the others where two or more are left; with fewer it keeps its station by dead
    reckoning and says that. Where it may, it moves to the station of the least bound.
    """

    Settings = FormationSettings
    phases = ("search", "on_station", "alone", "leaving", "done")
    variables: ClassVar = {
        "station": Variable((2,), "float64", "m", "station ahead and to starboard of the moving point"),
        "target": Variable((2,), "float64", "m", "north and east of the station"),
        "station_error": Variable(
            (2,), "float64", "m", "estimated position less the station, along the course, across"
        ),
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
        self._s, self._hold, self._holds = s, setup.heading, setup.holds
        course = math.radians(s.course_deg)
        self._course = course
        self._velocity = s.speed * np.array([math.cos(course), math.sin(course)])
        self._planned = np.array([s.ahead, s.starboard])
        self._heard: dict[str, Heard] = {}
        self._present: tuple[str, ...] = ()
        self._next = 0.0  # look at what is heard [s]
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
            self._next = now.time + s.choice.period
            self._look(now.time)
        return self._keep(now)

    def row(self) -> tuple[Any, ...]:
        """Station, its place, the error, leaders heard and the bound."""
        return self._choice.station, self._target, self._error, len(self._present), self._choice.bound

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
        place, _, _ = estimate.at(now.time)
        c, sn = math.cos(self._course), math.sin(self._course)
        ahead, starboard = self._choice.station
        self._target = self._point(now.time) + np.array([c * ahead - sn * starboard, sn * ahead + c * starboard])
        off = place - self._target
        self._error = np.array([c * off[0] + sn * off[1], -sn * off[0] + c * off[1]])
        along = s.speed - max(-s.margin, min(s.margin, s.gain * self._error[0]))
        course = course_to_line(self._course, self._error[1], s.lookahead)
        ground = along / max(0.5, math.cos(course - self._course))
        current = estimate.current
        water = ground * np.array([math.cos(course), math.sin(course)]) - current
        speed = max(SLOWEST, float(np.hypot(*water)))
        heading = heading_for_course(course, speed, (float(current[0]), float(current[1])))
        return Setpoints(heading, s.depth, speed)

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
        sigma = choice.deviations(leaders, s.choice)
        if len(names) < 2:
            self._choice = Choice(self._choice.station, math.inf)
            if changed or self.phase == ON_STATION:
                why = f"{len(names)} leader heard" if len(names) == 1 else "no leader heard"
                self._enter(ALONE, time, f"{why}, two are needed: keeps station by dead reckoning")
            return
        before = choice.bound_at(self._choice.station, places, sigma, s.speed, s.choice.period, s.choice)
        best = choice.choose(self._planned, places, sigma, s.speed, s.choice.period, s.choice)
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
