"""The dm_env face of a trial, through `dm_control.rl.control`: truth in, commands out, once a control period.

For learning and for controllers of one's own. No sensors or estimators stand between: the observation is the truth.
"""

import collections
import math
from typing import Any

import dm_env
import numpy as np
from dm_control import mjcf
from dm_control.rl import control
from dm_env import specs

from auvsim.base.errors import DivergenceError
from auvsim.base.frames import rotation
from auvsim.base.randomness import stream
from auvsim.physics import planar_fit
from auvsim.physics.truth import DockPose
from auvsim.physics.world import World, compose
from auvsim.simulation import scenario
from auvsim.vehicles import library
from auvsim.water.currents import build_current


class Docking(control.Task):
    """Bring the vehicle into the dock.

    Action (3,): rudder (positive to starboard), stern plane (positive dives) and shaft speed, each as a fraction of
    its limit. Reward: progress of the nose towards the latched place [m], and 100 when the latch closes. An episode
    ends docked, or by the time limit.
    """

    def __init__(self, plan: scenario.Scenario, seed: int) -> None:
        self._plan, self._seed, self._episode = plan, seed, 0
        self._vehicle = library.vehicle(plan.vehicle.model)
        self._dock = library.dock(plan.dock.model)
        self._pose = DockPose(depth=plan.dock.depth, heading=math.radians(plan.dock.heading_deg))
        self._ticks = round(plan.rates.physics / plan.rates.control)
        believed = planar_fit.fit_planar_model(plan.vehicle.model, plan.estimator.model_speed, plan.world.water_density)
        self._shaft = believed.shaft_speed_for(plan.vehicle.start.speed)
        self._to_dock = rotation(self._pose.roll, self._pose.pitch, self._pose.heading).T
        self._distance = math.nan
        self._world: World | None = None

    def physics(self) -> mjcf.Physics:
        """A new physics of the scene."""
        rate = self._plan.rates.physics
        return mjcf.Physics.from_mjcf_model(compose(self._vehicle, self._dock, self._pose, self._plan.world, rate))

    def initialize_episode(self, physics: Any) -> None:
        """Places the vehicle at the scenario's start; the current is drawn anew each episode."""
        plan = self._plan
        generator = stream(self._seed, self._episode, f"{self._vehicle.name}/current")
        self._episode += 1
        current = build_current(plan.current, generator, plan.duration + 1.0)
        self._world = World(
            physics.model.ptr, physics.data.ptr, self._vehicle, self._pose, current, plan.world.water_density
        )
        start = plan.vehicle.start
        place = np.array(scenario.start_position(plan))
        self._world.place(place, math.radians(start.heading_deg), start.speed, self._shaft)
        self._distance = self._to_go()

    def before_step(self, action: Any, physics: Any) -> None:
        """Sets the actuators and brings the water up to date."""
        rudder, elevator, shaft = np.clip(np.asarray(action, dtype=float), -1.0, 1.0).tolist()
        limit = self._vehicle.allocation.limit
        self.world.command(rudder * limit, elevator * limit, shaft * self._vehicle.shaft_limit)

    @property
    def world(self) -> World:
        """The world of the running episode.

        Raises:
            RuntimeError: no episode has begun.
        """
        if self._world is None:
            raise RuntimeError("no episode has begun: call reset() first")
        return self._world

    def advance(self) -> None:
        """One control period of physics."""
        self.world.advance(self._ticks)

    def _nose(self) -> np.ndarray:
        truth = self.world.truth()
        nose = rotation(*truth.attitude.tolist()) @ (self._vehicle.nose, 0.0, 0.0)
        return self._to_dock @ (truth.position + nose - (0.0, 0.0, self._pose.depth))

    def _to_go(self) -> float:
        return float(np.linalg.norm(self._nose() - (self._dock.latched, 0.0, 0.0)))

    def get_observation(self, physics: Any) -> "collections.OrderedDict[str, np.ndarray]":
        """The truth, by name.

        nose (3,) in the dock frame [m]; attitude (3,): roll, pitch, heading off the axis [rad]; velocity (6,) over
        ground, nu [m/s, rad/s]; current (3,) in the dock's frame [m/s]; fins (n,) [rad]; shaft_speed (1,) [rad/s].
        """
        truth = self.world.truth()
        roll, pitch, yaw = truth.attitude.tolist()
        return collections.OrderedDict(
            nose=self._nose(),
            attitude=np.array([roll, pitch, math.remainder(yaw - self._pose.heading, 2 * math.pi)]),
            velocity=truth.nu,
            current=self._to_dock @ truth.current,
            fins=truth.fins,
            shaft_speed=np.array([truth.shaft_speed]),
        )

    def get_reward(self, physics: Any) -> float:
        """Metres come nearer since the last step, and 100 when the latch closes."""
        before, self._distance = self._distance, self._to_go()
        return before - self._distance + (100.0 if self.world.latched else 0.0)

    def get_termination(self, physics: Any) -> float | None:
        """0 (the episode is over for good) when docked."""
        return 0.0 if self.world.latched else None

    def action_spec(self, physics: Any) -> specs.BoundedArray:
        """Three fractions in -1..1."""
        return specs.BoundedArray((3,), float, -1.0, 1.0, name="rudder, stern plane, shaft speed")


class _Environment(control.Environment):
    """Steps through `World`, which looks for contact and closes the latch; a diverged episode ends with discount 0."""

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


def load(plan: scenario.Scenario, seed: int = 0) -> control.Environment:
    """A dm_env environment of a scenario.

    Args:
        plan: start, dock, current and limits; its duration is the time limit.
        seed: of the random currents; episode k of a seed is always the same.
    """
    task = Docking(plan, seed)
    return _Environment(
        task.physics(), task, time_limit=plan.duration, control_timestep=1.0 / plan.rates.control, legacy_step=False
    )
