"""What a time step costs: position after a minute, open loop, by integrator and rate; contact with a dock by rate."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from auvsim.base.frames import Array
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.physics import scenes
from auvsim.physics.propulsion import propulsion
from auvsim.physics.scenes import WorldSettings
from auvsim.physics.truth import StructurePose
from auvsim.physics.world import World
from auvsim.vehicles import library
from auvsim.water.currents import Uniform

INTEGRATORS = ("Euler", "implicitfast", "RK4")
RATES = (50.0, 100.0, 200.0, 500.0, 1000.0)  # [Hz]
FINEST = 4000.0  # of RK4, the reference [Hz]
SECONDS, DEPTH, DENSITY = 60.0, 20.0, 1026.0
ACROSS = (0.4, 0.55)  # places at which the nose meets the cone, off the axis [m]
NAME = "vehicle"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    vehicle: str = "remus100"
    """Vehicle with fins and a shaft, in models/ or the path of an MJCF file."""
    dock: str = "dock_tube"
    """Dock that it runs into."""
    speed: float = 1.5
    """Its speed through the water [m/s]."""
    jobs: int | None = None
    """Processes; by default one for each core."""


def track(vehicle: str, speed: float, integrator: str, rate: float) -> Array:
    """Where a vehicle is (3,) after a minute of weaving and diving: rudder and stern plane follow sines [m]."""
    world = _world(vehicle, {}, integrator, rate)
    actuation, ahead = library.vehicle(vehicle).actuation, propulsion(vehicle, 1.0, DENSITY).ahead(speed)
    world.place(NAME, np.array([0.0, 0.0, DEPTH]), 0.0, speed, actuation.allocate(ahead))
    for k in range(round(10.0 * SECONDS)):
        time = 0.1 * k
        demand = ahead._replace(rudder=0.1 * math.sin(0.25 * time), elevator=0.04 * math.sin(0.4 * time))
        world.command(NAME, actuation.allocate(demand))
        world.advance(round(0.1 * rate))
    return world.truth(NAME).position


def contact(vehicle: str, dock: str, across: float, rate: float) -> tuple[float, float]:
    """Largest force [N] and impulse [N s] of a vehicle that runs into a dock's cone at 1 m/s, in the first second."""
    pose = StructurePose(depth=DEPTH, heading=0.0)
    world = _world(vehicle, {"dock": (dock, pose)}, "implicitfast", rate)
    model = library.vehicle(vehicle)
    ahead = propulsion(vehicle, 1.0, DENSITY).ahead(1.0)
    world.place(NAME, np.array([-model.nose - 0.1, across, DEPTH]), 0.0, 1.0, model.actuation.allocate(ahead))
    world.advance(round(2.0 * rate))
    found = world.contacts(NAME)
    first = [touch for touch in found if touch.time < found[0].time + 1.0]
    return max(touch.force for touch in found), sum(touch.force * touch.duration for touch in first)


def report(options: Options, progress: Progress | None = None) -> list[RenderableType]:
    """Runs the study and returns its tables.

    Raises:
        InputError: The vehicle or the dock cannot be used.
    """
    vehicle, speed, dock = options.vehicle, options.speed, options.dock
    cases = [(integrator, rate) for integrator in INTEGRATORS for rate in RATES] + [("RK4", FINEST)]
    tasks = [Task(key=case, work=partial(track, vehicle, speed, *case), weight=case[1]) for case in cases]
    tasks += [
        Task(key=(across, rate), work=partial(contact, vehicle, dock, across, rate), weight=0.1 * rate)
        for across in ACROSS
        for rate in RATES[1:]
    ]
    found = run_tasks(tasks, options.jobs, progress)
    return [_track_table(found, vehicle, speed), _contact_table(found, vehicle, dock)]


def _world(vehicle: str, structures: dict, integrator: str, rate: float) -> World:
    settings = WorldSettings.model_validate({"integrator": integrator, "sea_floor": 200.0})
    return World(scenes.scene({NAME: vehicle}, structures, settings, rate), Uniform((0.0, 0.0, 0.0)))


def _track_table(found: dict, vehicle: str, speed: float) -> Table:
    title = f"{vehicle} at {speed:g} m/s: error of the position after {SECONDS:g} s, open loop [m]"
    table = Table("integrator", *(f"{rate:g} Hz" for rate in RATES), title=title)
    for integrator in INTEGRATORS:
        errors = [math.dist(found[integrator, rate], found["RK4", FINEST]) for rate in RATES]
        table.add_row(integrator, *(_number(errors)))
    return table


def _contact_table(found: dict, vehicle: str, dock: str) -> Table:
    title = (
        f"{vehicle} meets {dock} at 1 m/s: largest force, impulse of the first second, and both less those at 1000 Hz"
    )
    rates = RATES[1:]
    table = Table("off the axis [m]", "", *(f"{rate:g} Hz" for rate in rates), title=title)
    for across in ACROSS:
        fine = found[across, rates[-1]]
        for k, (name, unit) in enumerate((("force", "N"), ("impulse", "N s"))):
            values = [found[across, rate][k] for rate in rates]
            cells = [f"{value:.3g} ({100.0 * (value / fine[k] - 1.0):+.0f} %)" for value in values]
            table.add_row(f"{across:g}", f"{name} [{unit}]", *cells)
    return table


def _number(values: Sequence[float]) -> list[str]:
    return [f"{value:.2g}" for value in values]
