"""The water and the world of a scenario, and the models of what is in it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from auvsim.base.errors import InputError, at_key
from auvsim.base.randomness import stream
from auvsim.physics import scenes, soundness
from auvsim.physics.world import World
from auvsim.simulation.scenario import Scenario
from auvsim.vehicles import library
from auvsim.water.currents import CurrentField, build_current

PARTS = {"estimator": "estimator", "controller": "control", "mission": "mission", "sensor": "sensors"}  # their keys


def current(scenario: Scenario, seed: int, trial: int = 0) -> CurrentField:
    """The current of a run; its draws are from a stream of the only vehicle, or of the water."""
    names = [*scenario.vehicles]
    source = f"{names[0]}/current" if len(names) == 1 else "water/current"
    with at_key("water.current"):
        generator = stream(seed, trial, source, scenario.random.steps)
        return build_current(scenario.water.current, generator, scenario.duration + 1.0)


def check_steps(scenario: Scenario) -> None:
    """Sees that the physics step is short enough for every vehicle.

    Raises:
        InputError: it is too long; the text says which rate would do.
    """
    for name, model in {
        settings.model: (name, settings.model) for name, settings in scenario.vehicles.items()
    }.values():
        with at_key(f"vehicles.{name}.model"):
            soundness.check(model, scenario.water.density)
        soundness.check_step(model, scenario.physics.integrator, scenario.rates.physics, scenario.water.density)


def build_world(scenario: Scenario, current: CurrentField, **given: Any) -> World:
    """MuJoCo's world of a scenario.

    Args:
        scenario: what is in it.
        current: what the water does.
        **given: see `World`.
    """
    scene = scenes.scene(
        {name: settings.model for name, settings in scenario.vehicles.items()},
        {name: (settings.model, settings.pose) for name, settings in scenario.structures.items()},
        scenario.world,
        scenario.rates.physics,
        {name: settings.ballast for name, settings in scenario.vehicles.items()},
    )
    return World(scene, current, scenario.water.density, **given)


@contextmanager
def naming_part(vehicle: str) -> Iterator[None]:
    """Puts the dotted key of a vehicle's part before the text of an InputError that begins with what part it is."""
    try:
        yield
    except InputError as error:
        part = PARTS.get(str(error).split(" ", 1)[0])
        if part is None:
            raise
        raise InputError(f"vehicles.{vehicle}.{part}: {error}") from error


def vehicle_model(world: Any, name: str, model: str) -> library.Vehicle:
    """The model of a vehicle, which the world has loaded already, or else is loaded."""
    known = getattr(world, "models", {})
    return known[name] if name in known else library.vehicle(model)


def structure_model(world: Any, name: str, model: str) -> library.Structure:
    """The model of a structure, likewise."""
    return world.structures[name].structure if name in world.structures else library.structure(model)
