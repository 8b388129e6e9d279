"""A place and a heading to be held, on the estimate."""

import math
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from auvsim.base import yaml_text
from auvsim.base.frames import wrap
from auvsim.base.settings import Settings
from auvsim.control.controller import Setpoints, Station
from auvsim.data.log import VehicleLog
from auvsim.data.variables import Variable
from auvsim.missions.hovering.carrot import Carrot, require_thrusters
from auvsim.missions.mission import Event, Metric, Mission, MissionSetup, Situation

SEARCH, TRANSIT, HOLDING = range(3)


class HoldSettings(Settings):
    """A place and a heading to be held until the run ends."""

    kind: Literal["hold"] = "hold"
    north: float = Field(default=0.0, description="place north of the datum [m]")
    east: float = Field(default=0.0, description="place east of the datum [m]")
    depth: float = Field(default=10.0, gt=0, description="depth [m]")
    heading_deg: float = Field(default=0.0, description="heading, clockwise from north [deg]")
    speed: float = Field(default=0.4, gt=0, description="speed over ground on the way there [m/s]")
    radius: float = Field(default=0.5, gt=0, description="distance at which the place counts as reached [m]")


class Hold(Mission):
    """Goes to a place, turns to a heading there and stays.

    Raises:
        InputError: the vehicle cannot hover.
    """

    Settings = HoldSettings
    phases = ("search", "transit", "holding")
    variables: ClassVar = {"distance": Variable((), "float64", "m", "estimated horizontal distance from the place")}
    columns: ClassVar = {
        "held": Metric("bool", "1", "whether the place was reached"),
        "time": Metric("float", "s", "when it was"),
        "position_rms": Metric("float", "m", "true horizontal distance from the place from then on, rms"),
        "depth_rms": Metric("float", "m", "true error of depth from then on, rms"),
        "heading_rms_deg": Metric("float", "deg", "true error of heading from then on, rms"),
    }

    def __init__(self, setup: MissionSetup) -> None:
        super().__init__(setup)
        require_thrusters(setup)
        self._s: HoldSettings = setup.settings
        self._start = setup.heading, setup.depth
        self._carrot, self.distance = Carrot(setup.period), math.nan
        self._goal = np.array((self._s.north, self._s.east))

    def update(self, now: Situation) -> Setpoints | Station:
        """The setpoints now."""
        s, estimate = self._s, now.estimate
        heading = math.radians(s.heading_deg)
        if estimate is None or not estimate.initialised:
            return Setpoints(*self._start, 0.0)
        if self.phase == SEARCH:
            self._enter(TRANSIT, now.time, "position known")
        here, _, _ = estimate.at(now.time)
        self.distance = float(np.hypot(*(self._goal - here)))
        if self.phase == TRANSIT and self.distance < s.radius and abs(now.depth - s.depth) < s.radius:
            self._enter(HOLDING, now.time, f"{self.distance:.2f} m from the place")
        return Station(heading, s.depth, s.speed, tuple(self._carrot.move(self._goal, here, s.speed).tolist()))

    def row(self) -> tuple[Any, ...]:
        """Distance from the place."""
        return (self.distance,)

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """How well the place was held."""
        mission, truth, settings = (
            log["mission"],
            log["truth"],
            yaml_text.read(str(log.attributes["mission_settings"]), "log").value,
        )
        reached = mission["time"][mission["phase"] == HOLDING]
        names = ("time", "position_rms", "depth_rms", "heading_rms_deg")
        if not len(reached):
            return {"held": False} | dict.fromkeys(names)
        late = truth["time"] >= reached[0]
        north, east, down = (truth["position"][late] - (settings["north"], settings["east"], settings["depth"])).T
        turned = [wrap(psi - math.radians(settings["heading_deg"])) for psi in truth["attitude"][late, 2].tolist()]
        values = (float(reached[0]), _rms(np.hypot(north, east)), _rms(down), math.degrees(_rms(np.array(turned))))
        return {"held": True} | dict(zip(names, values, strict=True))

    def _enter(self, phase: int, time: float, text: str) -> None:
        self.phase = phase
        self.events.append(Event(time, self.phases[phase], text))


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
