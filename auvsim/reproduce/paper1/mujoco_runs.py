"""Runs of paper 1's study by the physical vehicle: MuJoCo's truth, the trial's sensors, modem and autopilot.

The course about the dock is steered by the truth, since navigation is what is judged; heading, depth and speed are held
by the autopilot, from compass and depth gauge. A run is reproduced by its conditions and its seed; conditions that
differ in one thing share all the draws of the rest.
"""

import copy
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.random import Generator

from auvsim.acoustics.link import AcousticSettings, Channel
from auvsim.acoustics.usbl import Usbl, UsblSettings
from auvsim.base.randomness import stream
from auvsim.base.reading import Reading
from auvsim.control.torpedo import Autopilot
from auvsim.navigation.navigator import Commands, EstimatorSettings, Navigator
from auvsim.physics import planar_fit
from auvsim.physics.truth import DockPose, Truth
from auvsim.physics.world import World, compile_scene, compose
from auvsim.reproduce.paper1.runs import DENSITIES, TRUTH_STEP, Track, course_round, heading_for
from auvsim.sensors.compass import Compass
from auvsim.sensors.depth import Depth
from auvsim.sensors.feedback import Feedback
from auvsim.simulation.planar_world import PlanarWorld, planar_state
from auvsim.simulation.scenario import Scenario, SensorSettings
from auvsim.vehicles import library
from auvsim.water.currents import CurrentField, Turning, Uniform
from auvsim.water.settings import TurningSettings
from estimators.core.types import Array
from estimators.docking.usbl import UsblModel
from estimators.planar.model import PlanarParameters

VEHICLE = "remus100"
SPEED = 1.0  # through the water, as in trials; the planar model is condensed there [m/s]
POSE = DockPose(depth=20.0, heading=0.0)  # of the dock; the vehicle keeps its depth
REACHED = 12.0  # distance from the dock at which an approach ends [m]


@dataclass(frozen=True, kw_only=True, slots=True)
class RunConditions:
    """What a run is like; settings left out are the trial's, but that no fix is lost, late or wrong."""

    radius: float = 40.0  # of the circle about the dock [m]
    approach: float | None = None  # distance from which it goes straight to the dock instead [m]
    duration: float = 300.0  # [s]
    current: float = 0.5  # its speed [m/s]; its direction is drawn
    turn: tuple[float, float] | None = None  # when the current turns by 90 degrees, to a side that is drawn [s]
    interval: tuple[float, float] = (4.5, 5.5)  # between fixes, drawn evenly [s]
    fixes_of: float | None = None  # distance whose noise and delay all fixes have [m]; None: that at which they are
    usbl: Mapping[str, Any] = field(default_factory=dict)  # of UsblSettings
    acoustics: Mapping[str, Any] = field(default_factory=dict)  # of AcousticSettings
    thrust: float = 1.0  # true X_nn relative to that which filters assume
    compass_bias: float | None = None  # bias of the vehicle's compass [rad]; None: drawn, as in trials
    planar: bool = False  # instead of MuJoCo's, the truth of the condensed model with the planar study's process noise


class Tick(NamedTuple):
    """What a navigator is told at a tick of its own, and the truth."""

    time: float  # [s]
    readings: tuple[Reading, ...]  # since the tick before
    commands: Commands  # in force
    state: Array  # (8,) true, see `planar_state`


@dataclass(frozen=True, kw_only=True, slots=True)
class RunRecord:
    """What happened."""

    plan: Scenario
    parameters: PlanarParameters  # that a navigator assumes
    usbl: UsblModel  # noise of the fixes that it may assume
    ticks: tuple[Tick, ...]
    times: Array  # (k,) [s]
    states: Array  # (k, 8); the heading is wrapped


def simulate(conditions: RunConditions, seed: int) -> RunRecord:
    """The run of a seed."""
    plan, parameters = _plan(conditions), planar_fit.fit_planar_model(VEHICLE, SPEED).parameters
    ticks = tuple(run_ticks(conditions, plan, seed))
    usbl = plan.sensors.usbl
    ranges, deviations = zip(*usbl.noise, strict=True)
    return RunRecord(
        plan=plan,
        parameters=replace(parameters, X_nn=parameters.X_nn / conditions.thrust),
        usbl=UsblModel(transceiver=usbl.transceiver, ranges=ranges, deviations=deviations),
        ticks=ticks,
        times=np.array([tick.time for tick in ticks]),
        states=np.array([tick.state for tick in ticks]),
    )


def track(recording: RunRecord, navigator: Navigator) -> Track:
    """How a navigator follows a run."""
    count = len(recording.ticks)
    means, covariances = np.full((count, 8), math.nan), np.zeros((count, 8, 8))
    estimate = None
    for k, tick in enumerate(recording.ticks):
        estimate = navigator.update(tick.time, tick.readings, tick.commands)
        if estimate.initialised:
            means[k] = *estimate.position[:2], estimate.heading, *estimate.velocity, *estimate.current
            covariances[k] = estimate.covariance
    return Track(means=means, covariances=covariances, refused=dict(estimate.reasons) if estimate else {})


def _plan(conditions: RunConditions) -> Scenario:
    low, high = conditions.interval
    usbl = {"interval": 0.5 * (low + high), "jitter": 0.5 * (high - low), "outlier_probability": 0.0, **conditions.usbl}
    acoustics = {"dropout_probability": 0.0, "late_probability": 0.0, **conditions.acoustics}
    if conditions.fixes_of is not None:
        usbl["noise"] = ((conditions.fixes_of, UsblModel().deviation(conditions.fixes_of)),)
        link = AcousticSettings()
        acoustics |= {"delay": link.delay + link.per_metre * conditions.fixes_of, "per_metre": 0.0}
    return Scenario(
        duration=conditions.duration,
        sensors=SensorSettings(usbl=UsblSettings(**usbl)),
        acoustics=AcousticSettings(**acoustics),
        estimator=EstimatorSettings(model_speed=SPEED),
    )


def run_ticks(conditions: RunConditions, plan: Scenario, seed: int) -> Iterator[Tick]:
    """The ticks of a run: truth -> sensors -> autopilot -> truth, with a course by the truth."""

    def noise(source: str) -> Generator:
        return stream(seed, 0, f"{VEHICLE}/{source}")

    assumed, vehicle, rates = planar_fit.fit_planar_model(VEHICLE, SPEED), library.vehicle(VEHICLE), plan.rates
    bearing, direction, side = noise("conditions").uniform(-math.pi, math.pi, 3).tolist()
    current = _current(conditions, direction, side)
    world, steps = _world(conditions, plan, vehicle, current, noise("process"))
    instruments = _Instruments(conditions, plan, noise)
    limits = vehicle.allocation.limit, vehicle.shaft_limit
    autopilot = Autopilot(plan.control, assumed.shaft_speed_for, *limits, 1.0 / rates.control)

    distance = conditions.approach or conditions.radius
    place = np.array((distance * math.cos(bearing), distance * math.sin(bearing), POSE.depth))
    water = current.evaluate(0.0, place).velocity
    state = np.array((*place[:2], 0.0, SPEED, 0.0, 0.0, *water[:2]))
    commands = Commands(0.0, 0.0, assumed.shaft_speed)
    world.place(place, _heading(conditions, state), SPEED, commands.shaft_speed)
    truth, since = world.truth(), []
    for tick in range(1, round(conditions.duration * rates.control) + 1):
        world.advance(steps)
        before, truth = truth, world.truth()
        readings = instruments.read(before, truth)
        since += readings
        autopilot.observe(readings)
        state = planar_state(truth)
        if tick % round(rates.control / rates.filter) == 0:
            yield Tick(truth.time, tuple(since), commands, state)
            since = []
        if conditions.approach and math.hypot(*state[:2]) < REACHED:
            return
        commands = autopilot.command(_heading(conditions, state), POSE.depth, SPEED)
        world.command(*commands)


class _Instruments:
    """The sensors and the modem of a trial; those on board measure at every control tick."""

    def __init__(self, conditions: RunConditions, plan: Scenario, noise: Callable[[str], Generator]) -> None:
        settings = plan.sensors
        compass = Compass(settings.compass, noise("compass"))
        if conditions.compass_bias is not None:
            compass.heading_bias = conditions.compass_bias
        self._on_board = (
            compass,
            Depth(settings.depth, noise("depth")),
            Feedback(settings.feedback, noise("feedback")),
        )
        self._usbl = Usbl(settings.usbl, noise("usbl"), POSE)
        self._channel = Channel(plan.acoustics, noise("acoustics"))

    def read(self, before: Truth, now: Truth) -> list[Reading]:
        """What is measured or arrives now."""
        for ping in self._usbl.poll(before, now):
            self._channel.send(ping.reading, ping.slant_range)
        return [*(sensor.measure(now) for sensor in self._on_board), *self._channel.receive(now.time)]


def _heading(conditions: RunConditions, state: Array) -> float:
    """Where to head [rad], from the true planar state (8,)."""
    north, east = state[:2].tolist()
    course = math.atan2(-east, -north) if conditions.approach else course_round(state, conditions.radius)
    return heading_for(course, state)


def _current(conditions: RunConditions, direction: float, side: float) -> CurrentField:
    """The current, in a direction [rad] before it turns to the `side` of that sign."""
    speed, direction_deg = conditions.current, math.degrees(direction)
    if conditions.turn is None:
        return Uniform((speed * math.cos(direction), speed * math.sin(direction), 0.0))
    start, end = conditions.turn
    angle = math.copysign(90.0, side)
    return Turning(TurningSettings(speed=speed, direction_deg=direction_deg, angle_deg=angle, start=start, end=end))


def _world(
    conditions: RunConditions, plan: Scenario, vehicle: library.Vehicle, current: CurrentField, generator: Generator
) -> tuple[World | PlanarWorld, int]:
    """The truth, and its steps in a control period."""
    if conditions.planar:
        parameters = planar_fit.fit_planar_model(VEHICLE, SPEED).parameters
        world = PlanarWorld(parameters, vehicle.allocation, current, 1.0 / TRUTH_STEP, DENSITIES, generator)
        return world, round(1.0 / (TRUTH_STEP * plan.rates.control))
    model = copy.copy(_scene())
    world = World(model, mujoco.MjData(model), vehicle, POSE, current, plan.world.water_density)
    return world, round(plan.rates.physics / plan.rates.control)


@cache
def _scene() -> mujoco.MjModel:
    """The compiled scene, the same for all runs."""
    plan = Scenario()
    root = compose(library.vehicle(VEHICLE), library.dock(plan.dock.model), POSE, plan.world, plan.rates.physics)
    return compile_scene(root)
