"""A run as a dm_env environment (`dm_control.rl.control`): true state observed, commands given, each control period.

For learning and for controllers of one's own. There are no sensors or estimators: the observation is the true state.
"""

import collections
import math
from typing import Any

import dm_env
import numpy as np
from dm_control import mjcf
from dm_control.rl import control
from dm_env import specs

from auvsim.base.errors import DivergenceError, InputError
from auvsim.base.frames import rotation
from auvsim.physics import scenery, scenes
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.physics.world import World
from auvsim.simulation.building import current
from auvsim.simulation.run import Simulation
from auvsim.simulation.scenario import Scenario
from auvsim.vehicles import library
from auvsim.vehicles.actuation import Commands
from auvsim.vehicles.library import Vehicle


class CommandedAgent:
    """An agent without sensors, estimator and mission, which carries out commands from outside."""

    dock, mission, over, serves = None, None, False, False

    def __init__(self, name: str, plan: Scenario, vehicle: Vehicle, *_: Any, **__: Any) -> None:
        start = plan.vehicles[name].start
        fitted = fit_planar_model(plan.vehicles[name].model, 1.0, plan.water.density)
        self.name, self.vehicle = name, vehicle
        self.commands: Any = vehicle.actuation.at_speed(fitted.shaft_speed_for(start.speed))

    def blame(self, error: BaseException) -> BaseException:
        """The error itself."""
        return error

    def sense(self, *_: Any) -> None:
        """Takes no readings."""

    def receive(self, *_: Any) -> None:
        """Receives no messages."""

    def outgoing(self) -> list[Any]:
        """Sends nothing."""
        return []

    def navigate(self, *_: Any) -> None:
        """Knows nothing."""

    def act(self, *_: Any) -> Any:
        """The demand that was given from outside."""
        return self.commands


class Docking(control.Task):
    """Bring the vehicle into the dock.

    Action (3,): rudder (positive to starboard), stern plane (positive dives) and shaft speed, each as a fraction of
    its limit. Reward: progress of the nose towards the latched place [m], and 100 when the latch closes. An episode
    ends docked, or by the time limit.
    """

    def __init__(self, plan: Scenario, seed: int) -> None:
        self._plan, self._seed, self._episode = plan, seed, 0
        self._name, settings = plan.lone
        self._dock_name = plan.dock_of(self._name)
        if not settings.ballast.is_zero:
            raise InputError("vehicle.ballast: the environment has vehicles as their models have them; leave it out")
        if self._dock_name is None:
            raise InputError("the scenario has no dock; the environment is that of a docking")
        dock = plan.structures[self._dock_name]
        self._vehicle, self._dock = library.vehicle(settings.model), library.structure(dock.model)
        self._pose = dock.pose
        self._to_dock = rotation(self._pose.roll, self._pose.pitch, self._pose.heading).T
        self._distance = math.nan
        self._simulation: Simulation | None = None

    def physics(self) -> mjcf.Physics:
        """A new physics of the scene."""
        fleet, structures = {self._name: self._vehicle}, {str(self._dock_name): (self._dock, self._pose)}
        root = scenes.compose(fleet, structures, self._plan.world, self._plan.rates.physics)
        return mjcf.Physics.from_mjcf_model(root)

    def initialize_episode(self, physics: Any) -> None:
        """Places the vehicle at the scenario's start; the current is drawn anew each episode."""
        plan, dock = self._plan, str(self._dock_name)
        scenery.shape_sea_floor(physics.model.ptr, plan.world.floor)
        scene = scenes.Scene(
            physics.model.ptr,
            {self._name: self._vehicle},
            {dock: self._dock},
            {dock: self._pose},
            plan.world.floor,
        )
        water = current(plan, self._seed, self._episode)
        world = World(scene, water, plan.water.density, data=physics.data.ptr)
        world.reset()
        self._simulation = Simulation(plan, self._seed, self._episode, world=world, agents=CommandedAgent, record=False)
        self._episode += 1
        self._distance = self._to_go()

    def before_step(self, action: Any, physics: Any) -> None:
        """Sets the demand on the actuators."""
        fractions = np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
        if not np.isfinite(fractions).all():
            raise InputError(f"action {fractions.tolist()}: must be three finite fractions between -1 and 1")
        rudder, elevator, shaft = fractions.tolist()
        actuation = self._vehicle.actuation
        agent: Any = self.simulation.agents[0]
        agent.commands = Commands(
            rudder * actuation.fin_limit, elevator * actuation.fin_limit, shaft * actuation.shaft_limit
        )
        self.world.command(self._name, actuation.allocate(agent.commands))

    @property
    def simulation(self) -> Simulation:
        """The running episode.

        Raises:
            RuntimeError: no episode has begun.
        """
        if self._simulation is None:
            raise RuntimeError("no episode has begun: call reset() first")
        return self._simulation

    @property
    def world(self) -> World:
        """The world of the running episode."""
        return self.simulation.world

    def advance(self) -> None:
        """One control period."""
        self.simulation.step()

    def _nose(self) -> np.ndarray:
        truth = self.world.truth(self._name)
        nose = rotation(*truth.attitude.tolist()) @ (self._vehicle.nose, 0.0, 0.0)
        return self._to_dock @ (truth.position + nose - self._pose.position)

    def _to_go(self) -> float:
        return float(np.linalg.norm(self._nose() - (self._dock.latched, 0.0, 0.0)))

    def get_observation(self, physics: Any) -> "collections.OrderedDict[str, np.ndarray]":
        """The truth, by name.

        nose (3,) in the dock frame [m]; attitude (3,): roll, pitch, heading off the axis [rad]; velocity (6,) over
        ground, nu [m/s, rad/s]; current (3,) in the dock's frame [m/s]; fins (n,) [rad]; shaft_speed (1,) [rad/s].
        """
        truth = self.world.truth(self._name)
        roll, pitch, yaw = truth.attitude.tolist()
        return collections.OrderedDict(
            nose=self._nose(),
            attitude=np.array([roll, pitch, math.remainder(yaw - self._pose.heading, 2 * math.pi)]),
            velocity=truth.nu,
            current=self._to_dock @ truth.current,
            fins=truth.actuators[:-1],
            shaft_speed=truth.actuators[-1:],
        )

    def observation_spec(self, physics: Any) -> "collections.OrderedDict[str, specs.Array]":
        """Shapes of the observation, known before the first reset."""
        sizes = {"nose": 3, "attitude": 3, "velocity": 6, "current": 3, "fins": len(self._vehicle.actuation.fins)}
        sizes["shaft_speed"] = 1
        return collections.OrderedDict((name, specs.Array((size,), float, name)) for name, size in sizes.items())

    def get_reward(self, physics: Any) -> float:
        """Progress since the last step [m], and 100 when the latch closes."""
        before, self._distance = self._distance, self._to_go()
        return before - self._distance + (100.0 if self._is_docked() else 0.0)

    def get_termination(self, physics: Any) -> float | None:
        """0 (the episode is over for good) when docked."""
        return 0.0 if self._is_docked() else None

    def _is_docked(self) -> bool:
        return self.world.latched(self._name) is not None

    def action_spec(self, physics: Any) -> specs.BoundedArray:
        """Three fractions in -1..1."""
        return specs.BoundedArray((3,), float, -1.0, 1.0, name="rudder, stern plane, shaft speed")


class _Environment(control.Environment):
    """Steps through the simulation's loop; a diverged episode ends with discount 0."""

    def step(self, action: Any) -> dm_env.TimeStep:
        if self._reset_next_step:
            return self.reset()
        task: Docking = self._task  # pyright: ignore[reportAssignmentType]
        task.before_step(action, self._physics)
        try:
            task.advance()
        except DivergenceError:
            self._reset_next_step = True
            return dm_env.termination(reward=0.0, observation=task.get_observation(self._physics))
        reward, observation = task.get_reward(self._physics), task.get_observation(self._physics)
        self._step_count += 1
        discount = 1.0 if self._step_count >= self._step_limit else task.get_termination(self._physics)
        if discount is None:
            return dm_env.transition(reward=reward, observation=observation)
        self._reset_next_step = True
        return dm_env.TimeStep(dm_env.StepType.LAST, reward, discount, observation)

    def observation_spec(self) -> Any:
        """Shapes of the observation, by name."""
        return self._task.observation_spec(self._physics)  # pyright: ignore[reportAttributeAccessIssue]


def load(plan: Scenario, seed: int = 0) -> control.Environment:
    """A dm_env environment of a scenario of one vehicle and a dock.

    Args:
        plan: start, dock, current and limits; its duration is the time limit.
        seed: of the random currents; episode k of a seed is always the same.

    Raises:
        InputError: the scenario has several vehicles or no dock.
    """
    task = Docking(plan, seed)
    return _Environment(
        task.physics(), task, time_limit=plan.duration, control_timestep=1.0 / plan.rates.control, legacy_step=False
    )
