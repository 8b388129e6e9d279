"""Runs of paper 1's study by the physical vehicle: MuJoCo's truth, the trial's sensors, modem and autopilot.

The course about the dock is steered by the truth, since navigation is what is judged; heading, depth and speed are held
by the autopilot, from compass and depth gauge. A run is reproduced by its conditions and its seed; conditions that
differ in one thing share all the draws of the rest.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator
from pydantic import TypeAdapter

from auvsim.acoustics.link import AcousticSettings
from auvsim.acoustics.message import Delivery
from auvsim.acoustics.usbl import UsblSettings
from auvsim.base.randomness import stream
from auvsim.base.reading import Reading
from auvsim.control.controller import Setpoints
from auvsim.missions.mission import Mission, Situation
from auvsim.navigation.estimate import PLANAR_STATES, Estimate
from auvsim.navigation.navigator import Navigator, NavigatorSetup
from auvsim.navigation.settings import EstimatorSettings
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.physics.truth import StructurePose, Truth
from auvsim.reproduce.paper1.runs import DENSITIES, TRUTH_STEP, Track, course_round, heading_for
from auvsim.sensors.compass import Compass
from auvsim.simulation.building import build_world
from auvsim.simulation.planar_world import PlanarWorld, planar_state
from auvsim.simulation.run import Simulation
from auvsim.simulation.scenario import Scenario
from auvsim.simulation.scenario_settings import Rates, StructureSettings, VehicleSettings
from auvsim.simulation.sensor_settings import SensorSettings, rated
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands
from auvsim.water.currents import CurrentField, Turning, Uniform
from auvsim.water.settings import TurningSettings
from estimators.core.types import Array
from estimators.docking.usbl import UsblModel
from estimators.planar.model import PlanarParameters

VEHICLE = "remus100"
SPEED = 1.0  # through the water, as in trials; the planar model is fitted there [m/s]
POSE = StructurePose(depth=20.0, heading=0.0)  # of the dock; the vehicle keeps its depth
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
    thrust: float = 1.0  # true X_nn over the one that filters assume
    compass_bias: float | None = None  # [rad]; None: drawn, as in trials
    planar: bool = False  # truth of the fitted planar model with the planar study's process noise, not MuJoCo's


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
    parameters: PlanarParameters  # as a navigator assumes them
    usbl: UsblModel  # the fixes' noise, as it may assume it
    ticks: tuple[Tick, ...]
    times: Array  # (k,) [s]
    states: Array  # (k, 8); the heading is wrapped

    def setup(self, kind: str, **settings: Any) -> NavigatorSetup:
        """What a navigator of a kind, and of some settings that are not the defaults, is made from."""
        (name, vehicle), rates = self.plan.lone, self.plan.rates
        return NavigatorSetup(
            vehicle=name,
            settings=TypeAdapter(EstimatorSettings).validate_python({"kind": kind, **settings}),
            parameters=self.parameters,
            actuation=library.vehicle(VEHICLE).actuation,
            period=1.0 / rates.filter,
            rates=dict(rated(vehicle.sensors)),
            usbl=vehicle.sensors.usbl,
            dock=POSE,
        )


def simulate(conditions: RunConditions, seed: int) -> RunRecord:
    """The run of a seed."""
    plan, parameters = _plan(conditions), fit_planar_model(VEHICLE, SPEED).parameters
    ticks = run_ticks(conditions, plan, seed)
    usbl = plan.lone[1].sensors.usbl
    ranges, deviations = zip(*usbl.noise, strict=True)
    return RunRecord(
        plan=plan,
        parameters=replace(parameters, X_nn=parameters.X_nn / conditions.thrust),
        usbl=UsblModel(transceiver=usbl.transceiver, ranges=ranges, deviations=deviations),
        ticks=ticks,
        times=np.array([tick.time for tick in ticks]),
        states=np.array([tick.state for tick in ticks]),
    )


def track(run: RunRecord, navigator: Navigator) -> Track:
    """How a navigator follows a run."""
    count = len(run.ticks)
    means, covariances = np.full((count, 8), math.nan), np.zeros((count, 8, 8))
    estimate = None
    for k, tick in enumerate(run.ticks):
        estimate = navigator.update(tick.time, tick.readings, (), tick.commands)
        if estimate.initialised:
            means[k] = estimate.state[:8]  # biases may follow
            covariances[k] = estimate.covariance[:8, :8]
    return Track(means=means, covariances=covariances, refused=dict(estimate.reasons) if estimate else {})


def run_ticks(conditions: RunConditions, plan: Scenario, seed: int) -> tuple[Tick, ...]:
    """The ticks of a run: the closed loop of any other, but with a course by the truth, and nothing estimated."""

    def noise(source: str) -> Generator:
        return stream(seed, 0, f"{VEHICLE}/{source}")

    bearing, direction, side = noise("conditions").uniform(-math.pi, math.pi, 3).tolist()
    current = _current(conditions, direction, side)
    world = _planar_world(current, noise("process")) if conditions.planar else build_world(plan, current)
    listener, steered = _Listener(), _Steered(conditions)
    parts: dict[str, Any] = {"navigators": {VEHICLE: listener}, "missions": {VEHICLE: steered}}
    simulation = Simulation(plan, seed, world=world, record=False, **parts)
    listener.truth = steered.truth = lambda: simulation.truths[VEHICLE]
    for sensor, *_ in simulation.agents[0].sensors:
        if isinstance(sensor, Compass) and conditions.compass_bias is not None:
            sensor.heading_bias = conditions.compass_bias
    distance = conditions.approach or conditions.radius
    place = np.array((distance * math.cos(bearing), distance * math.sin(bearing), POSE.depth))
    water = current.evaluate(0.0, place).velocity
    heading = _heading(conditions, np.array((*place[:2], 0.0, SPEED, 0.0, 0.0, *water[:2])))
    fitted, agent = fit_planar_model(VEHICLE, SPEED), simulation.agents[0]
    agent.commands = agent.vehicle.actuation.at_speed(fitted.shaft_speed)  # steady from the begin
    world.reset()
    simulation.place(VEHICLE, place, heading, SPEED)
    while simulation.ticks < round(conditions.duration * plan.rates.control) and not simulation.over:
        simulation.step()
    return tuple(listener.ticks)


class _Listener:
    """Takes the place of an estimator: it keeps what one would be told."""

    states = PLANAR_STATES
    truth: Callable[[], Truth]

    def __init__(self) -> None:
        self.ticks: list[Tick] = []

    def update(
        self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Commands
    ) -> Estimate:
        self.ticks.append(Tick(time, tuple(readings), commands, planar_state(self.truth())))
        return Estimate.unknown(time)

    def reset(self) -> None:
        self.ticks.clear()


class _Steered(Mission):
    """Keeps the course by the truth, since navigation is what is judged."""

    phases = ("steered",)
    truth: Callable[[], Truth]

    def __init__(self, conditions: RunConditions) -> None:
        self.phase, self.finished, self.events, self.dock = 0, False, [], None
        self._conditions = conditions

    def update(self, now: Situation) -> Setpoints:
        state = planar_state(self.truth())
        self.finished = bool(self._conditions.approach) and math.hypot(*state[:2]) < REACHED
        return Setpoints(_heading(self._conditions, state), POSE.depth, SPEED)


def _plan(conditions: RunConditions) -> Scenario:
    low, high = conditions.interval
    usbl = {"interval": 0.5 * (low + high), "jitter": 0.5 * (high - low), "outlier_probability": 0.0, **conditions.usbl}
    acoustics = {"dropout_probability": 0.0, "late_probability": 0.0, **conditions.acoustics}
    if conditions.fixes_of is not None:
        usbl["noise"] = ((conditions.fixes_of, UsblModel().deviation(conditions.fixes_of)),)
        link = AcousticSettings()
        acoustics |= {"delay": link.delay + link.per_metre * conditions.fixes_of, "per_metre": 0.0}
    return Scenario.model_validate(
        {
            "duration": conditions.duration,
            "rates": Rates(physics=1.0 / TRUTH_STEP) if conditions.planar else Rates(),
            "network": {"acoustics": AcousticSettings(**acoustics)},
            "structures": {"dock": StructureSettings(depth=POSE.depth)},
            "vehicles": {VEHICLE: VehicleSettings(sensors=SensorSettings(usbl=UsblSettings(**usbl)))},
        }
    )


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


def _planar_world(current: CurrentField, generator: Generator) -> PlanarWorld:
    """The truth of the fitted planar model; a step of it is a physics tick of its scenario."""
    parameters, actuation = fit_planar_model(VEHICLE, SPEED).parameters, library.vehicle(VEHICLE).actuation
    return PlanarWorld(VEHICLE, parameters, actuation, current, 1.0 / TRUTH_STEP, DENSITIES, generator)
