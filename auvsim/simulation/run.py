"""The one closed loop: the world moves; every agent senses, navigates and acts; all of it is logged."""

import math
import os
import time as wall
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from auvsim.acoustics.message import Fate, Outgoing
from auvsim.base.errors import DivergenceError
from auvsim.base.frames import Array
from auvsim.base.garbage import frozen_garbage
from auvsim.base.interruption import HeldInterrupt
from auvsim.base.randomness import stream
from auvsim.data.log import Log
from auvsim.missions.mission import Mission, Place
from auvsim.navigation.navigator import Navigator
from auvsim.physics.truth import Truth
from auvsim.simulation import starts
from auvsim.simulation.agent import Agent
from auvsim.simulation.building import (
    build_world,
    check_steps,
    current,
    naming_part,
    structure_model,
    vehicle_model,
)
from auvsim.simulation.network_building import build_network
from auvsim.simulation.parts import PartError
from auvsim.simulation.recording import Unrecorded, recorder
from auvsim.simulation.reports import Reports
from auvsim.simulation.scenario import Scenario
from auvsim.water.currents import listeners


class ProgressState(NamedTuple):
    """Progress of a running simulation."""

    time: float  # [s]
    duration: float  # its time limit [s]
    phase: str  # of the vehicle's mission; of several, each with its name
    range: float  # true distance of the first vehicle from its dock's mouth [m]; NaN without one


def run(
    scenario: Scenario,
    *,
    seed: int = 0,
    trial: int = 0,
    progress: Callable[[ProgressState], None] | None = None,
    path: str | os.PathLike[str] | None = None,
    check_step: bool = True,
) -> Log:
    """Runs a scenario and returns its log, also when it diverges or is interrupted.

    Args:
        scenario: every number definite.
        seed: of all random streams.
        trial: number of the run under that seed.
        progress: called about ten times a simulated minute.
        path: file of the log, which grows during the run; None keeps the log in memory.
        check_step: whether a physics step that is too long is refused; else it runs, most likely until it diverges.

    Raises:
        InputError: a model, a part or a number of the scenario cannot be used.
    """
    started = wall.perf_counter()
    if check_step:
        check_steps(scenario)
    simulation, status = Simulation(scenario, seed, trial, path=path), "complete"
    log: Any = simulation.log
    with log, HeldInterrupt() as interrupt, frozen_garbage():
        try:
            last = math.ceil(scenario.duration * scenario.rates.control - 1e-6)
            while simulation.ticks < last and not simulation.over:
                interrupt.check()
                simulation.step()
                if progress and simulation.ticks % simulation.progress_ticks == 0:
                    progress(simulation.progress())
            for agent in simulation.agents:
                if not agent.over:
                    log.event(simulation.time, agent.name, "timeout", agent.overdue(scenario.duration))
        except DivergenceError as error:
            status = "diverged"
            log.event(simulation.time, "", "diverged", str(error))
            if isinstance(error, PartError):
                log.event(simulation.time, "", "traceback", error.trace)
        except KeyboardInterrupt:
            status = "interrupted"
            log.event(simulation.time, "", "interrupted", "stopped by the user")
        simulation.log_contacts()
        simulation.log_under_way()
        for agent in simulation.agents:
            agent.log_path(log)
        return log.finish(status, wall_time=wall.perf_counter() - started)


class Simulation:
    """The parts of a run, and its loop, one control period a step.

    Args:
        scenario: every number definite.
        seed: of all random streams.
        trial: number of the run under that seed.
        world: replaces MuJoCo's world; anything with the methods of `World`.
        navigators: replace the scenario's estimators, by vehicle.
        missions: replace the scenario's missions, by vehicle.
        agents: makes the agent of a vehicle, see `Agent`.
        record: whether anything is logged.
        path: see `run`.

    Raises:
        InputError: a model, a part or a number of the scenario cannot be used.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        trial: int = 0,
        *,
        world: Any = None,
        navigators: Mapping[str, Navigator] | None = None,
        missions: Mapping[str, Mission] | None = None,
        agents: Callable[..., Any] = Agent,
        record: bool = True,
        path: str | os.PathLike[str] | None = None,
    ) -> None:
        self.scenario, rates = scenario, scenario.rates

        def drawn(source: str) -> Generator:
            return stream(seed, trial, source, scenario.random.steps)

        def noise(vehicle: str) -> Callable[[str], Generator]:
            return lambda source: drawn(f"{vehicle}/{source}")

        self.world = world or build_world(scenario, current(scenario, seed, trial))
        self._places = {
            name: Place(name=name, pose=settings.pose, structure=structure_model(self.world, name, settings.model))
            for name, settings in scenario.structures.items()
        }
        self.agents = []
        for name, settings in scenario.vehicles.items():
            model = vehicle_model(self.world, name, settings.model)
            own = {"navigator": (navigators or {}).get(name), "mission": (missions or {}).get(name)}
            with naming_part(name):
                self.agents.append(agents(name, scenario, model, self._places, noise(name), **own))
        named = {agent.name: agent for agent in self.agents}
        self.network, self._usbl = build_network(scenario, self.world, named, drawn)
        self._physics_ticks = round(rates.physics / rates.control)
        self._log_ticks = max(1, round(rates.control / rates.log))
        self.progress_ticks = round(6.0 * rates.control)
        self._listeners = listeners(self.world.current)
        self.ticks = 0
        self.truths: dict[str, Truth] = {}
        for name, settings in scenario.vehicles.items():
            start = settings.start
            place = np.array(scenario.start_position(name))
            self.place(name, place, math.radians(start.heading_deg), start.speed)
        starts.check(scenario, self.world, self.agents, self._places)
        self.log: Any = Unrecorded()
        if record:
            self.log = recorder(scenario, self.agents, self._places, self._usbl, seed=seed, trial=trial, path=path)
        self._reports = Reports(self.log, self.truths)
        self._record_truths()

    @property
    def time(self) -> float:
        """Simulated time of the last truths [s]."""
        return next(iter(self.truths.values())).time

    @property
    def over(self) -> bool:
        """Whether every vehicle has come to the end of its mission."""
        return all(agent.over for agent in self.agents)

    def place(self, name: str, position: Array, heading: float, speed: float) -> None:
        """Puts a vehicle at another start, before the first step; its actuators already do what is demanded.

        Args:
            name: of the vehicle.
            position: (3,) NED [m].
            heading: [rad].
            speed: through the water [m/s].
        """
        agent = next(agent for agent in self.agents if agent.name == name)
        channels = agent.vehicle.actuation.allocate(agent.commands)
        self.world.place(name, position, heading, speed, channels)
        self.truths[name] = self.world.truth(name)

    def step(self) -> None:
        """One control period: physics, sensors, network, estimators, missions, control.

        Raises:
            DivergenceError: the simulation left the range of physical states.
        """
        world, log = self.world, self.log
        world.advance(self._physics_ticks)
        self.ticks += 1
        before, self.truths = self.truths, {agent.name: world.truth(agent.name) for agent in self.agents}
        time = world.time
        self._reports.limits(world, self.truths, time - 1.0 / self.scenario.rates.control)
        agent: Any = None
        try:
            for agent in self.agents:
                agent.sense(self.ticks, self.truths[agent.name], world, log)
        except (Exception, SystemExit) as error:
            raise agent.blame(error) from error.__cause__
        for ping, fate in self.network.poll(before, self.truths):
            log.reading(
                fate.destination, ping.reading._replace(received=fate.received), fate.fate != "delivered", ping.outlier
            )
            self._reports.packet(fate)
        if self.network.modems:
            for fate in self.network.modems.advance(before, self.truths):
                self._reports.packet(fate)
                self._reports.loss(fate, time)
        try:
            for agent in self.agents:
                agent.receive(self.network.deliver(agent.name, time), time, log)
                agent.navigate(self.ticks, time, log)
                demand = agent.act(time, world.latched(agent.name), log)
                if demand is not None:
                    if self._listeners:
                        self._report_approach(agent)
                    world.command(agent.name, agent.vehicle.actuation.allocate(demand))
                for outgoing in agent.outgoing():
                    self._post(agent.name, outgoing, time)
        except (Exception, SystemExit) as error:
            raise agent.blame(error) from error.__cause__
        if self.ticks % self._log_ticks == 0:
            self._record_truths()

    def log_under_way(self) -> None:
        """Logs the packets that are still under way."""
        for fate in self.network.modems.under_way() if self.network.modems else ():
            self._reports.packet(fate)

    def _post(self, name: str, outgoing: Outgoing, time: float) -> None:
        fate: Fate | None = None
        if self.network.modems:
            fate = self.network.modems.post(name, outgoing)
        else:
            self._reports.mute(time, name)
        if fate is not None:
            self._reports.packet(fate._replace(message=fate.message._replace(sent=time)))
            self._reports.loss(fate, time)

    def progress(self) -> ProgressState:
        """Progress of the run."""
        phases = [(agent.name, agent.mission.phases[agent.mission.phase]) for agent in self.agents]
        text = phases[0][1] if len(phases) == 1 else ", ".join(f"{name} {phase}" for name, phase in phases)
        first = self.agents[0]
        distance = math.nan
        if first.dock:
            distance = math.dist(self.truths[first.name].position, self.scenario.structures[first.dock].pose.position)
        return ProgressState(self.time, self.scenario.duration, text, distance)

    def log_contacts(self) -> None:
        """Logs the contacts of every vehicle, and their impulse so far."""
        for agent in self.agents:
            impulse = 0.0
            for contact in self.world.contacts(agent.name):
                impulse += contact.force * contact.duration
                self.log.append(f"vehicles/{agent.name}/contact", (contact.time, contact.force, impulse, contact.other))

    def _record_truths(self) -> None:
        for name, truth in self.truths.items():
            self.log.truth(name, truth)

    def _report_approach(self, agent: Agent) -> None:
        """Reports the first vehicle's distance from its dock to currents that turn in approaches."""
        if agent.mission is None:
            return
        attempt, dock = agent.approach, agent.mission.dock
        if attempt is not None and dock is not None and agent is self.agents[0]:
            away = self.truths[agent.name].position[:2] - dock.pose.position[:2]
            for listener in self._listeners:
                listener.approach(attempt, float(np.hypot(*away)), self.time)
