"""A physical vehicle that MuJoCo carries and whose autopilot steers a given heading, for studies on physical truth."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.base.frames import Array
from auvsim.base.reading import Reading
from auvsim.control.controller import Setpoints
from auvsim.missions.mission import Mission, Situation
from auvsim.navigation.estimate import PLANAR_STATES, Estimate
from auvsim.physics.truth import Truth
from auvsim.simulation.building import build_world
from auvsim.simulation.run import Simulation
from auvsim.simulation.scenario import Scenario
from auvsim.vehicles.actuation import Commands
from auvsim.water.currents import Uniform

VEHICLE = "remus100"


def steered(
    heading: Callable[[Array], Array],
    *,
    start: tuple[float, float],
    depth: float,
    speed: float,
    current: Sequence[float],
    seconds: int,
    seed: int,
    duration: float | None = None,
) -> tuple[list[Truth], int]:
    """True states of a REMUS-100 at each tick of its autopilot, and how many of these a second has.

    Args:
        heading: Asked for at times (k,) [s]: (k,) [rad].
        start: North and east [m].
        depth: Of the start and asked for [m].
        speed: Through the water, likewise [m/s].
        current: North, east [m/s].
        seconds: How long.
        seed: Of the sensors' noise.
        duration: Of the scenario, if it is longer [s].
    """
    first = np.degrees(float(heading(np.zeros(1))[0]))
    begin = {"north": start[0], "east": start[1], "depth": depth, "speed": speed, "heading_deg": float(first)}
    vehicle = {"model": VEHICLE, "start": begin, "mission": {"kind": "track"}}
    scenario = Scenario.model_validate({"duration": duration or float(seconds), "vehicles": {VEHICLE: vehicle}})
    world = build_world(scenario, Uniform((*current, 0.0)))
    parts: dict[str, Any] = {
        "navigators": {VEHICLE: _Silent()},
        "missions": {VEHICLE: _Steers(heading, depth, speed)},
    }
    simulation = Simulation(scenario, seed, world=world, record=False, **parts)
    truths = [simulation.truths[VEHICLE]]
    rate = round(scenario.rates.control)
    while simulation.ticks < seconds * rate:
        simulation.step()
        truths.append(simulation.truths[VEHICLE])
    return truths, rate


class _Silent:
    """Takes the place of an estimator, since the autopilot needs none to steer a heading."""

    states = PLANAR_STATES

    def update(
        self, time: float, readings: Sequence[Reading], messages: Sequence[Delivery], commands: Commands
    ) -> Estimate:
        return Estimate.unknown(time)

    def reset(self) -> None:
        pass


class _Steers(Mission):
    """Asks for a heading that depends on time alone."""

    phases = ("under_way",)

    def __init__(self, heading: Callable[[Array], Array], depth: float, speed: float) -> None:
        self.phase, self.finished, self.events, self.dock = 0, False, [], None
        self._heading, self._depth, self._speed = heading, depth, speed

    def update(self, now: Situation) -> Setpoints:
        return Setpoints(float(self._heading(np.array([now.time]))[0]), self._depth, self._speed)
