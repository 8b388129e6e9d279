"""The water and the world of a scenario, and the models of what is in it."""

from typing import Any

from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.physics import scenes, soundness
from auvsim.physics.world import World
from auvsim.simulation.scenario import Scenario
from auvsim.vehicles import library
from auvsim.water.currents import CurrentField, build_current


def current(scenario: Scenario, seed: int, trial: int = 0) -> CurrentField:
    """The current of a run; its draws are from a stream of the only vehicle, or of the water."""
    names = [*scenario.vehicles]
    source = f"{names[0]}/current" if len(names) == 1 else "water/current"
    return build_current(scenario.water.current, stream(seed, trial, source), scenario.duration + 1.0)


def check_steps(scenario: Scenario) -> None:
    """Sees that the physics step is short enough for every vehicle.

    Raises:
        InputError: it is too long; the text says which rate would do.
    """
    for model in {settings.model: None for settings in scenario.vehicles.values()}:
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


def vehicle_model(world: Any, name: str, model: str) -> library.Vehicle:
    """The model of a vehicle, which the world has loaded already, or else is loaded."""
    known = getattr(world, "models", {})
    return known[name] if name in known else library.vehicle(model)


def structure_model(world: Any, name: str, model: str) -> library.Structure:
    """The model of a structure, likewise."""
    return world.structures[name].structure if name in world.structures else library.structure(model)


def refuse_overlaps(world: Any) -> None:
    """Sees that nothing starts inside something else.

    Raises:
        InputError: two things overlap where they start.
    """
    for one, other, depth in world.overlaps() if hasattr(world, "overlaps") else ():
        raise InputError(
            f"start: '{one}' and '{other}' overlap by {depth:.2f} m; start them apart (vehicles.NAME.start, structures)"
        )
