"""One docking trial: truth -> sensors -> estimator -> guidance -> control -> truth, and a log of all of it."""

import math
import time as wall
from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np

from auvsim.acoustics.link import Channel
from auvsim.acoustics.usbl import Usbl
from auvsim.base.errors import DivergenceError, InputError
from auvsim.base.randomness import stream
from auvsim.base.reading import Reading
from auvsim.control.torpedo import Autopilot
from auvsim.data.log import TrialLog
from auvsim.data.recorder import LogWriter
from auvsim.missions.docking.guidance import Geometry, Guidance, Phase
from auvsim.missions.manoeuvres import laws as manoeuvres
from auvsim.navigation import navigator as navigation
from auvsim.navigation.navigator import Commands, Estimate, Navigator
from auvsim.physics import planar_fit, planar_sets, scenes
from auvsim.physics.truth import DockPose, Truth
from auvsim.physics.world import World
from auvsim.sensors.compass import Compass
from auvsim.sensors.depth import Depth
from auvsim.sensors.dvl import Dvl
from auvsim.sensors.feedback import Feedback
from auvsim.sensors.gyro import Gyro
from auvsim.simulation import scenario
from auvsim.vehicles import library
from auvsim.water.currents import build_current, listeners

APPROACHING = (Phase.APPROACH, Phase.FINAL)
AFTERMATH = 5.0  # how long a trial runs on after its verdict, so that the end can be seen [s]


class ProgressState(NamedTuple):
    """How far a running trial is."""

    time: float  # [s]
    duration: float  # its time limit [s]
    phase: str
    range: float  # true distance to the dock's mouth [m]


def run_trial(
    plan: scenario.Scenario, *, seed: int = 0, trial: int = 0, progress: Callable[[ProgressState], None] | None = None
) -> TrialLog:
    """Runs one trial and returns its log, also when it diverges or is interrupted.

    Args:
        plan: the scenario, every number definite.
        seed: of all random streams.
        trial: number of the trial under that seed.
        progress: called about ten times a simulated minute.

    Raises:
        InputError: a model, an estimator or a number of the scenario cannot be used.
    """
    started = wall.perf_counter()
    loop = Loop(plan, seed, trial)
    status = "complete"
    try:
        last = math.ceil(plan.duration * plan.rates.control - 1e-6)
        while loop.ticks < last and not loop.over:
            loop.step()
            if progress and loop.ticks % loop.progress_ticks == 0:
                progress(loop.progress())
    except DivergenceError as error:
        status = "diverged"
        loop.log.event(loop.time, "diverged", str(error))
    except KeyboardInterrupt:
        status = "interrupted"
        loop.log.event(loop.time, "interrupted", "stopped by the user")
    if status == "complete" and not loop.over:
        loop.log.event(loop.time, "timeout", f"not docked within {plan.duration:g} s")
    return loop.finish(status, wall.perf_counter() - started)


class Loop:
    """The parts of a trial and one turn of its loop, of one control period."""

    def __init__(self, plan: scenario.Scenario, seed: int, trial: int) -> None:
        pose = DockPose(depth=plan.dock.depth, heading=math.radians(plan.dock.heading_deg))
        scene = scenes.compiled(plan.vehicle.model, plan.dock.model, pose, plan.world, plan.rates.physics)
        vehicle, dock = scene.vehicle, scene.dock
        name, rates = vehicle.name, plan.rates

        def noise(sensor: str) -> np.random.Generator:
            return stream(seed, trial, f"{name}/{sensor}")

        self.current = build_current(plan.current, noise("current"), plan.duration + 1.0)
        self._listeners = listeners(self.current)
        data = mujoco.MjData(scene.model)
        self.world = World(scene.model, data, vehicle, pose, self.current, plan.world.water_density)
        estimator, density = plan.estimator, plan.world.water_density
        # What the shaft speed of a command is stays condensed, so that trials differ in nothing but the estimator.
        believed = planar_fit.fit_planar_model(plan.vehicle.model, estimator.model_speed, density)
        parameters = planar_sets.believed(estimator.model, plan.vehicle.model, estimator.model_speed, density)
        self.navigator: Navigator = navigation.build(estimator.factory, parameters, plan)
        geometry = Geometry(nose=vehicle.nose, mouth_radius=dock.mouth_radius, latched=dock.latched)
        self.guidance = (
            Guidance(plan.guidance, geometry) if plan.manoeuvre is None else _manoeuvring(plan, vehicle, believed)
        )
        self.autopilot = Autopilot(
            plan.control, believed.shaft_speed_for, vehicle.allocation.limit, vehicle.shaft_limit, 1.0 / rates.control
        )
        sensors = plan.sensors
        self._sensors = [
            (Compass(sensors.compass, noise("compass")), round(rates.control / sensors.compass.rate)),
            (Depth(sensors.depth, noise("depth")), round(rates.control / sensors.depth.rate)),
            (Feedback(sensors.feedback, noise("feedback")), round(rates.control / sensors.feedback.rate)),
        ]
        if sensors.dvl.enabled:
            dvl = Dvl(sensors.dvl, noise("dvl"), self.current, plan.world.sea_floor)
            self._sensors.append((dvl, round(rates.control / sensors.dvl.rate)))
        if sensors.gyro.enabled:
            self._sensors.append((Gyro(sensors.gyro, noise("gyro")), round(rates.control / sensors.gyro.rate)))
        self._usbl = Usbl(sensors.usbl, noise("usbl"), pose)
        self._channel = Channel(plan.acoustics, noise("acoustics"))
        self._physics_ticks = round(rates.physics / rates.control)
        self._filter_ticks = round(rates.control / rates.filter)
        self._log_ticks = max(1, round(rates.control / rates.log))
        self.progress_ticks = round(6.0 * rates.control)

        start = plan.vehicle.start
        place = np.array(scenario.start_position(plan))
        shaft = believed.shaft_speed_for(start.speed)
        self.world.place(place, math.radians(start.heading_deg), start.speed, shaft)

        self.ticks = 0
        self.over = False
        self._duration = plan.duration
        self._end = math.inf
        self._estimate: Estimate | None = None
        self._commands = Commands(0.0, 0.0, shaft)
        self._since_update: list[Reading] = []
        self._truth = self.world.truth()
        self.log = LogWriter(attributes=_attributes(plan, seed, trial, vehicle, dock, pose), fins=len(self._truth.fins))
        self.log.truth(self._truth)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._truth.time

    def step(self) -> None:
        """One control period: physics, sensors, estimator, guidance, control.

        Raises:
            DivergenceError: the simulation left the range of physical states.
        """
        self.world.advance(self._physics_ticks)
        self.ticks += 1
        previous, self._truth = self._truth, self.world.truth()
        readings = self._sense(previous, self._truth)
        self.guidance.observe(readings)
        self.autopilot.observe(readings)
        self._since_update += readings
        # In the latch nothing is to be estimated: the vehicle is where the dock is, and does not move as it believes.
        if self.ticks % self._filter_ticks == 0 and self.guidance.phase != Phase.DOCKED:
            self._navigate()
        self._act()
        if self.ticks % self._log_ticks == 0:
            self.log.truth(self._truth)

    def _sense(self, previous: Truth, now: Truth) -> list[Reading]:
        """The readings that are due or arrive now."""
        readings = [sensor.measure(now) for sensor, every in self._sensors if self.ticks % every == 0]
        for reading in readings:
            self.log.reading(reading)
        for ping in self._usbl.poll(previous, now):
            packet = self._channel.send(ping.reading, ping.slant_range, lost=ping.lost)
            self.log.reading(packet.reading, lost=packet.lost, outlier=ping.outlier)
        return readings + self._channel.receive(now.time)

    def _navigate(self) -> None:
        e = self.navigator.update(self.time, self._since_update, self._commands)
        self._since_update = []
        for mishap in navigation.estimator_events(self._estimate, e):
            self.log.event(self.time, *mishap)
        self._estimate = e
        self.log.append(
            "estimate",
            (e.time, e.position, e.heading, e.velocity, e.current, e.covariance, e.refused, e.initialised),
        )

    def _act(self) -> None:
        guidance, autopilot, time = self.guidance, self.autopilot, self.time
        heading, depth = autopilot.heading, autopilot.depth
        if heading is None or depth is None:  # nothing measured yet: go on as started
            return
        wanted = guidance.update(time, self._estimate, heading, depth, self.world.latched)
        if self._listeners and guidance.phase in APPROACHING:
            for listener in self._listeners:
                listener.approach(guidance.attempt, float(np.hypot(*self._truth.position[:2])), time)
        self._commands = autopilot.command(*wanted, guidance.rudder)
        self.world.command(*self._commands)
        self.log.append("guidance", (time, guidance.phase, guidance.attempt, *wanted, guidance.along, guidance.cross))
        self.log.append("command", (time, *self._commands))
        for event in guidance.events:
            self.log.event(*event)
        guidance.events.clear()
        if guidance.finished and self._end == math.inf:
            self._end = time + (AFTERMATH if guidance.phase != Phase.MANOEUVRE else 0.0)
        self.over = time >= self._end

    def progress(self) -> ProgressState:
        """How far the trial is."""
        x, y, z = self._truth.position.tolist()
        distance = math.hypot(x, y, z - self.world.pose.depth)
        return ProgressState(self.time, self._duration, self.guidance.phase.name.lower(), distance)

    def finish(self, status: str, wall_time: float) -> TrialLog:
        """The log of all that happened."""
        impulse, tick = 0.0, self.world.model.opt.timestep
        for contact in self.world.contacts:
            impulse += contact.force * tick
            self.log.append("contact", (contact.time, contact.force, impulse))
        return self.log.finish(status, wall_time=wall_time)


def _manoeuvring(
    plan: scenario.Scenario, vehicle: library.Vehicle, believed: planar_fit.PlanarFit
) -> manoeuvres.Manoeuvring:
    """What stands in for the guidance to a dock in a manoeuvre."""
    assert plan.manoeuvre is not None
    fastest = max(manoeuvres.speeds(plan.manoeuvre))
    if believed.shaft_speed_for(fastest) > vehicle.shaft_limit:
        raise InputError(f"manoeuvre {plan.manoeuvre.kind}: the shaft of '{vehicle.name}' cannot hold {fastest:g} m/s")
    start = plan.vehicle.start
    steering = manoeuvres.Steering(
        plan.manoeuvre, limit=vehicle.allocation.limit, rate=plan.rates.control, course=math.radians(start.heading_deg)
    )
    return manoeuvres.Manoeuvring(steering, start.depth)


def _attributes(
    plan: scenario.Scenario, seed: int, trial: int, vehicle: library.Vehicle, dock: library.Dock, pose: DockPose
) -> dict[str, str | int | float]:
    """What the log says of the trial as a whole."""
    forward, starboard, down = plan.sensors.usbl.transceiver
    return {
        "scenario": scenario.to_yaml(plan),
        "seed": seed,
        "trial": trial,
        "dock_depth": pose.depth,
        "dock_heading": pose.heading,
        "vehicle_nose": vehicle.nose,
        "transceiver_forward": forward,
        "transceiver_starboard": starboard,
        "transceiver_down": down,
        "mouth_radius": dock.mouth_radius,
        "throat_radius": dock.throat_radius,
        "cone_length": dock.cone_length,
    }
