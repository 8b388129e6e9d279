"""The agent of one vehicle: its sensors, estimator, mission and controller, and one step of each."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.random import Generator

from auvsim.acoustics.message import Delivery, Outgoing
from auvsim.acoustics.payload import StateReport
from auvsim.base import plugins
from auvsim.base.reading import Reading
from auvsim.control import registry as controllers
from auvsim.control.controller import ControllerSetup
from auvsim.data.variables import PAYLOAD, Group, Table, Variable, vehicle_groups
from auvsim.missions import registry as missions
from auvsim.missions.fixes import FixSource, fix_sources
from auvsim.missions.mission import Mission, MissionSetup, Place, Situation
from auvsim.navigation import registry as estimators
from auvsim.navigation.estimate import Estimate, estimator_events
from auvsim.navigation.gate import Gate
from auvsim.navigation.measurements import of_kind
from auvsim.navigation.message_gate import MessageGate
from auvsim.navigation.navigator import Navigator
from auvsim.navigation.sonar_log import sonar_log
from auvsim.navigation.state_report import state_report
from auvsim.physics.propulsion import propulsion
from auvsim.physics.truth import Truth
from auvsim.sensors import registry as sensors
from auvsim.sensors.altimeter import AltimeterSettings
from auvsim.sensors.range import RangeSettings
from auvsim.sensors.sensor import Surroundings
from auvsim.simulation import parts
from auvsim.simulation.gate_events import gate_events
from auvsim.simulation.parts import Part
from auvsim.simulation.scenario import Scenario
from auvsim.simulation.sensor_settings import on_board
from auvsim.simulation.setups import model_speed, navigator_setup, usbl_dock
from auvsim.simulation.stretches import Stretches
from auvsim.vehicles.library import Vehicle
from estimators.core.types import Outcome


class Log(Protocol):
    """What an agent logs to; `data.recorder.Recorder` is one."""

    def append(self, group: str, row: Sequence[Any]) -> None:
        """A row of a group."""
        ...

    def reading(self, vehicle: str, reading: Reading, *extra: Any) -> None:
        """A reading of a sensor."""
        ...

    def event(self, time: float, vehicle: str, kind: str, text: str) -> None:
        """Something that happened."""
        ...


class Agent:
    """A vehicle that senses, navigates and acts.

    Args:
        name: of the vehicle.
        plan: the scenario.
        vehicle: its model.
        places: the structures that are charted, by name.
        noise: gives the generator of each source of noise of this vehicle.
        navigator: in place of the scenario's.
        mission: likewise.

    Raises:
        InputError: one of its parts cannot be made.
    """

    def __init__(
        self,
        name: str,
        plan: Scenario,
        vehicle: Vehicle,
        places: Mapping[str, Place],
        noise: Callable[[str], Generator],
        *,
        navigator: Navigator | None = None,
        mission: Mission | None = None,
    ) -> None:
        self.name, self.vehicle = name, vehicle
        settings, rates, density = plan.vehicles[name], plan.rates, plan.water.density
        start = settings.start
        # The drive of a command is always that of the vehicle's own model, so that runs differ in nothing but the
        # estimator.
        ahead, holds = propulsion(settings.model, model_speed(settings.estimator), density)
        self.holds = holds  # whether the vehicle can hold a speed through the water [m/s]
        heading = math.radians(start.heading_deg)
        self.dock = usbl_dock(plan, name)
        self.serves = bool(self.dock) and settings.sensors.usbl.enabled  # whether its USBL does
        self.mission = mission or missions.build(
            settings.mission.kind,
            MissionSetup(
                name=name,
                settings=settings.mission,
                vehicle=vehicle,
                heading=heading,
                depth=start.depth,
                period=1.0 / rates.control,
                holds=holds,
                structures=places,
                usbl=self.serves,
                ranges=tuple(of_kind(dict(on_board(settings.sensors)), RangeSettings)),
                altimeters=tuple(of_kind(dict(on_board(settings.sensors)), AltimeterSettings)),
                fixes=self._fixes(plan, places),
            ),
        )
        setup = navigator_setup(plan, name, vehicle)
        self.navigator = navigator or estimators.build(setup)
        self._sonar_log = sonar_log(self.navigator)
        self.messages = MessageGate(name, setup.others) if setup.modem else None  # the gate for them
        self.controller = controllers.build(
            settings.control.kind,
            ControllerSetup(
                settings=settings.control,
                actuation=vehicle.actuation,
                ahead=ahead,
                period=1.0 / rates.control,
            ),
        )
        self._locate = getattr(self.controller, "locate", None)  # of one that steers by the estimate
        self.sensors = [
            (
                _sensor(key, found, noise(key), vehicle),
                round(rates.control / found.rate),
                Part("sensor", getattr(found, "kind", key), name),
            )
            for key, found in on_board(settings.sensors)
        ]
        self.gate = Gate(dict(on_board(settings.sensors)), vehicle.actuation)
        self._gated: list[Outcome] = []  # refused by it since the last update of the estimator
        # Whatever is given in place of the scenario's part is the caller's, who sees what it raises.
        self._estimator = Part("estimator", "" if navigator else settings.estimator.kind, name)
        self._mission = Part("mission", "" if mission else settings.mission.kind, name)
        self._controller = Part("controller", settings.control.kind, name)
        self.estimate: Estimate | None = None
        self.commands: Any = ahead(start.speed)
        self._filter_ticks = round(rates.control / rates.filter)
        self._readings: list[Reading] = []  # of this control period
        self._on_their_way: list[Reading] = []  # taken, and received later
        self._messages: list[Delivery] = []
        self._to_filter: list[Reading] = []  # since the last update of the estimator
        self._messages_to_filter: list[Delivery] = []
        self._to_mission: list[Reading] = []  # since the last update of the mission
        self._end = math.inf
        self._stretches = Stretches()
        self.over = False
        self._running = self._controller  # the part whose code runs now, to blame for what it raises
        self._demands = tuple(demand.name for demand in vehicle.actuation.demands)
        self._received = f"vehicles/{name}/received"
        groups = ("estimate", "measurements", "mission", "command")
        self._estimates, self._measurements, self._decisions, self._commands = (f"vehicles/{name}/{g}" for g in groups)

    def _fixes(self, plan: Scenario, places: Mapping[str, Place]) -> tuple[FixSource, ...]:
        sensors = plan.vehicles[self.name].sensors
        dock = places.get(self.dock or "") if self.serves else None
        served = (sensors.usbl, (dock.pose.north, dock.pose.east, dock.pose.depth)) if dock else None
        return fix_sources((found for _, found in on_board(sensors)), served, plan.network.acoustics)

    def blame(self, error: BaseException) -> BaseException:
        """What to raise in place of an error from within this agent: a user's own part is named."""
        return self._running.blamed(error)

    def groups(self, usbl: tuple[Table, Mapping[str, int]] | None) -> dict[str, Group]:
        """The groups of the vehicle in the log.

        Args:
            usbl: variables and sizes of the dock's USBL, if one serves the vehicle.
        """
        actuation = self.vehicle.actuation
        of_sensors = {s.name: ({"value": s.value}, s.sizes) for s, _, _ in self.sensors}
        of_sensors |= {"usbl": usbl} if usbl else {}
        groups = vehicle_groups(
            sensors=of_sensors,
            mission=(self.mission.phases, self.mission.variables),
            demands={d.name: Variable((), "float64", d.units, d.long_name) for d in actuation.demands},
            channels=dict(zip(actuation.channels, actuation.units, strict=True)),
            states=self.navigator.states,
            modem=self.messages is not None,
        )
        return groups | (self._sonar_log.groups if self._sonar_log else {})

    def sense(self, ticks: int, truth: Truth, world: Surroundings, log: Log) -> None:
        """Takes the readings that are due at a control tick."""
        taken, self._messages = [], []
        for sensor, every, part in self.sensors:
            if ticks % every:
                continue
            self._running = part
            reading = sensor.measure(truth, world)
            if reading is not None:
                if part.own:
                    parts.reading(reading, sensor)
                log.reading(self.name, reading)
                (taken if reading.received <= truth.time else self._on_their_way).append(reading)
        if self._on_their_way:
            taken += [reading for reading in self._on_their_way if reading.received <= truth.time]
            self._on_their_way = [reading for reading in self._on_their_way if reading.received > truth.time]
        suspects = set(self.gate.refused)
        self._readings, refused = self.gate.passed(taken)
        self._gated += refused
        heard = (reading.sensor for reading in self._readings)
        for kind, text in gate_events("reading", self.gate.refused, suspects, refused, heard):
            log.event(truth.time, self.name, kind, text)

    def receive(self, deliveries: Sequence[Delivery], time: float, log: Log) -> None:
        """Takes what the network delivers now; a fix of the dock's USBL is a reading, too."""
        heard = []
        for delivery in deliveries:
            if delivery.message.kind == "usbl":
                self._messages.append(delivery)
                self._readings.append(delivery.message.payload.reading._replace(received=delivery.received))
            else:
                log.append(self._received, received_row(delivery))
                heard.append(delivery)
        if not heard or self.messages is None:
            return
        suspects = set(self.messages.refused)
        good, refused = self.messages.passed(heard)
        self._messages += good
        self._gated += refused
        sources = (delivery.message.source for delivery in good)
        for kind, text in gate_events("message", self.messages.refused, suspects, refused, sources):
            log.event(time, self.name, kind, text)

    def report(self, time: float, stamp: float) -> StateReport | None:
        """What the vehicle tells others: its estimate, moved on to a time [s] and stamped; None before there is one."""
        e = self.estimate
        if e is None or not e.initialised:
            return None
        return state_report(e, [*self.navigator.states], time, stamp)

    def outgoing(self) -> list[Outgoing]:
        """Takes what the mission wants to send."""
        outbox = getattr(self.mission, "outbox", None)  # a mission of the user's own may have none
        if not outbox:
            return []
        sent = list(outbox)
        outbox.clear()
        return sent

    def navigate(self, ticks: int, time: float, log: Log) -> None:
        """Hands all that arrived to the controller and, when it is due, to the estimator."""
        self._running = self._controller
        self.controller.observe(self._readings)
        self._to_filter += self._readings
        self._to_mission += self._readings
        self._messages_to_filter += self._messages
        # In a latch the vehicle does not move as a model of free motion predicts: nothing is estimated.
        self._running = self._mission
        if self.mission.at_rest or ticks % self._filter_ticks:
            return
        self._running = self._estimator
        e = self.navigator.update(time, self._to_filter, self._messages_to_filter, self.commands)
        if self._estimator.own:
            parts.estimate(e, len(self.navigator.states))
        self._to_filter, self._messages_to_filter = [], []
        for kind, text in estimator_events(self.estimate, e):
            log.event(time, self.name, kind, text)
        self.estimate = e
        if self._locate is not None:
            self._running = self._controller
            self._locate(e)
        views = (e.position, e.heading, e.velocity, e.current)
        log.append(self._estimates, (e.time, e.state, e.covariance, *views, e.initialised, e.refused))
        outcomes, self._gated = (*self._gated, *e.outcomes), []
        for o in outcomes:
            row = (time, o.source or o.kind, o.stamp, o.sequence, o.accepted, o.reason, o.nis)
            log.append(self._measurements, row)
        for group, values in self._sonar_log.rows(time) if self._sonar_log else ():
            log.append(f"vehicles/{self.name}/{group}", values)

    def log_path(self, log: Log) -> None:
        """Logs the path given all that was measured, of an estimator that keeps it, when the run ends."""
        for group, values in self._sonar_log.path() if self._sonar_log else ():
            log.append(f"vehicles/{self.name}/{group}", values)

    def act(self, time: float, latched: str | None, log: Log) -> Any:
        """The demand on the actuators now, or None where nothing is measured yet: the vehicle goes on as it started."""
        mission, controller = self.mission, self.controller
        self._running = self._controller
        heading, depth = controller.heading, controller.depth
        if self._controller.own:
            parts.smoothed(heading, depth)
        if heading is None or depth is None:
            return None
        readings, self._to_mission = self._to_mission, []
        self._running = self._mission
        wanted = mission.update(Situation(time, self.estimate, heading, depth, latched, readings, self._messages))
        if self._mission.own:
            parts.mission(mission, wanted)
        row = mission.row()
        self._running = self._controller
        self.commands = controller.command(wanted)
        if self._controller.own:
            parts.demand(self.commands, self._demands)
        log.append(self._decisions, (time, mission.phase, *wanted[:3], *row))
        log.append(self._commands, (time, *self.commands))
        self._warn(time, log)
        self._running = self._mission
        for event in mission.events:
            log.event(event.time, self.name, event.kind, event.text)
        mission.events.clear()
        if mission.finished and self._end == math.inf:
            self._end = time + mission.aftermath
        self.over = time >= self._end
        return self.commands

    def _warn(self, time: float, log: Log) -> None:
        """Logs the controller's warning where one begins; a controller of the user's own may have none."""
        warning = getattr(self.controller, "warning", None)
        if warning is not None and self._stretches.begins(time, "authority"):
            log.event(time, self.name, "authority", str(warning))

    @property
    def approach(self) -> int | None:
        """Number of the mission's approach under way, see `Mission`."""
        self._running = self._mission
        return self.mission.approach

    def overdue(self, duration: float) -> str:
        """What the log says when the time limit [s] of the run ends the mission."""
        try:
            return str(self.mission.overdue(duration))
        except Exception as error:
            raise self._mission.blamed(error) from error.__cause__


def received_row(delivery: Delivery) -> tuple[Any, ...]:
    """The row of the group `received` for a message of a modem."""
    m = delivery.message
    payload = np.full(PAYLOAD, math.nan)
    payload[: len(m.payload)] = m.payload
    nothing = math.nan
    return (
        delivery.received, m.source, m.destination or "", m.kind, m.sequence, -1 if m.answers is None else m.answers,
        m.sent, delivery.arrived, nothing if delivery.range is None else delivery.range,
        nothing if delivery.bearing is None else delivery.bearing, m.bits, len(m.payload), payload,
    )  # fmt: skip


def _sensor(name: str, settings: Any, generator: Generator, vehicle: Vehicle) -> sensors.Sensor:
    """A sensor by its name and settings; a standard one's kind is its name."""
    kind = getattr(settings, "kind", name)
    if plugins.is_own(kind):
        settings = plugins.settings_of(sensors.find(kind), settings.settings, f"sensor '{name}': settings")
    return sensors.build(kind, settings, generator, name=name, vehicle=vehicle)
