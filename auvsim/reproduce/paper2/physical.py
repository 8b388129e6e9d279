"""The follower of paper 2 as a physical vehicle: a REMUS-100 that MuJoCo carries through the weave in the current."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.frames import rotation
from auvsim.base.reading import Reading
from auvsim.control.controller import Setpoints
from auvsim.missions.mission import Mission, Situation
from auvsim.navigation.estimate import PLANAR_STATES, Estimate
from auvsim.physics.truth import Truth
from auvsim.reproduce.paper2.runs import (
    BEGIN,
    CURRENT,
    CYCLE,
    CYCLES,
    DEPTH,
    SPEED,
    TRACKS,
    Conditions,
    Motion,
    planar_motion,
)
from auvsim.simulation.building import build_world
from auvsim.simulation.run import Simulation
from auvsim.simulation.scenario import Scenario
from auvsim.vehicles.actuation import Commands
from auvsim.water.currents import Uniform

VEHICLE = "remus100"
TRACK = "weave"


def motion(seed: int, seconds: int = CYCLES * CYCLE) -> Motion:
    """True motion of the vehicle, whose autopilot steers the weave by its own compass and depth gauge.

    Args:
        seed: Of the sensors' noise.
        seconds: How long.
    """
    scenario = _scenario()
    world = build_world(scenario, Uniform((*CURRENT.tolist(), 0.0)))
    parts: dict[str, Any] = {"navigators": {VEHICLE: _Silent()}, "missions": {VEHICLE: _Weave()}}
    simulation = Simulation(scenario, seed, world=world, record=False, **parts)
    truths = [simulation.truths[VEHICLE]]
    rate = round(scenario.rates.control)
    while simulation.ticks < seconds * rate:
        simulation.step()
        truths.append(simulation.truths[VEHICLE])
    positions = np.array([truth.position for truth in truths])
    # The mean over each second, of what a speed log and a compass show that are read faster.
    mean = np.array([_through_water(truth) for truth in truths])
    mean[:, 2] = np.unwrap(mean[:, 2])
    mean = 0.5 * (mean[1:] + mean[:-1])
    planar = planar_motion(Conditions(tracks=TRACK))
    shift = BEGIN - positions[0, :2]
    return Motion(
        follower=positions[::rate, :2] + shift,
        current=planar.current[: seconds + 1],
        through_water=mean.reshape(seconds, rate, 3).mean(axis=1),
        leader=planar.leader[: seconds + 1],
        depth=positions[::rate, 2],
    )


def _through_water(truth: Truth) -> tuple[float, float, float]:
    """Level speed ahead and to starboard of the heading [m/s], and the heading [rad]."""
    over_ground = rotation(*truth.attitude.tolist()) @ truth.nu[:3]
    north, east, _ = (over_ground - truth.current).tolist()
    heading = float(truth.attitude[2])
    c, s = math.cos(heading), math.sin(heading)
    return c * north + s * east, c * east - s * north, heading


def _scenario() -> Scenario:
    heading = math.degrees(float(TRACKS[TRACK].follower_heading(np.zeros(1))[0]))
    start = {"north": BEGIN[0], "east": BEGIN[1], "depth": DEPTH, "speed": SPEED, "heading_deg": heading}
    vehicle = {"model": VEHICLE, "start": start, "mission": {"kind": "track"}}
    return Scenario.model_validate({"duration": CYCLES * CYCLE, "vehicles": {VEHICLE: vehicle}})


class _Silent:
    """Takes the place of an estimator, since the autopilot needs none to weave."""

    states = PLANAR_STATES

    def update(
        self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Commands
    ) -> Estimate:
        nothing = np.zeros(3)
        return Estimate(
            time=time, position=nothing, heading=0.0, velocity=nothing, current=nothing[:2],
            covariance=np.zeros((8, 8)), initialised=False,
        )  # fmt: skip

    def reset(self) -> None:
        pass


class _Weave(Mission):
    """Asks for the heading of the follower's track."""

    phases = ("weave",)

    def __init__(self) -> None:
        self.phase, self.finished, self.events, self.dock = 0, False, [], None

    def update(self, now: Situation) -> Setpoints:
        heading = TRACKS[TRACK].follower_heading(np.array([now.time]))
        return Setpoints(float(heading[0]), DEPTH, SPEED)
