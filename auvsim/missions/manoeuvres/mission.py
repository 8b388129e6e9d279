"""A manoeuvre as a mission: rudder and speed in time at a constant depth, from the compass alone."""

import math
from typing import Any

from auvsim.base.errors import InputError
from auvsim.control.controller import Setpoints
from auvsim.data.log import VehicleLog
from auvsim.missions.manoeuvres import laws
from auvsim.missions.manoeuvres.metrics import COLUMNS, manoeuvre_metrics
from auvsim.missions.manoeuvres.settings import ManoeuvreMissionSettings
from auvsim.missions.mission import Event, Mission, MissionSetup, Situation


class Manoeuvre(Mission):
    """Performs one manoeuvre, or several in a sequence.

    Raises:
        InputError: it asks for more speed or rudder than the vehicle has, or changes faster than it is updated.
    """

    Settings = ManoeuvreMissionSettings
    phases = ("manoeuvre",)
    columns = COLUMNS

    def __init__(self, setup: MissionSetup) -> None:
        super().__init__(setup)
        settings, vehicle = setup.settings.manoeuvre, setup.vehicle
        fastest = max(laws.speeds(settings))
        if not setup.holds(fastest):
            raise InputError(f"manoeuvre {settings.kind}: the shaft of '{vehicle.model}' cannot hold {fastest:g} m/s")
        limit = getattr(vehicle.actuation, "fin_limit", 0.0)
        self._steering = laws.Steering(settings, limit=limit, rate=1.0 / setup.period, course=setup.heading)
        self._depth, self._part = setup.depth, ""

    def update(self, now: Situation) -> Setpoints:
        """The setpoints now, from time and smoothed heading alone."""
        order = self._steering.order(now.time, now.heading)
        if order.part != self._part:
            self._part = order.part
            self.events.append(Event(now.time, "manoeuvre", order.part))
        self.finished = now.time >= self._steering.duration - 1e-9
        course = order.course if order.rudder is None else math.nan
        return Setpoints(course, self._depth, order.speed, order.rudder)

    @classmethod
    def metrics(cls, log: VehicleLog) -> dict[str, Any]:
        """Metrics of the manoeuvre."""
        return manoeuvre_metrics(log)
