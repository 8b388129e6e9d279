"""What the log of a run is made of before its first row: groups, attributes and the text of every model."""

import hashlib
import os
from collections.abc import Mapping, Sequence
from typing import Any

from auvsim.acoustics.usbl import Usbl
from auvsim.base import yaml_text
from auvsim.base.reading import Reading
from auvsim.data.recorder import Recorder
from auvsim.data.variables import run_groups
from auvsim.missions.mission import Place
from auvsim.physics.truth import Truth
from auvsim.simulation.agent import Agent
from auvsim.simulation.scenario import Scenario, to_yaml


def recorder(
    scenario: Scenario,
    agents: Sequence[Agent],
    places: Mapping[str, Place],
    services: Sequence[Usbl],
    *,
    seed: int,
    trial: int,
    path: str | os.PathLike[str] | None,
) -> Recorder:
    """The empty log of a run, with the text of every model, since its file may change before the log is read.

    Args:
        scenario: that is run.
        agents: its vehicles.
        places: its structures, by name.
        services: the USBL of each vehicle that has one.
        seed: of the run.
        trial: its number under that seed.
        path: file of the log; None keeps it in memory.

    Raises:
        InputError: the file cannot be written.
    """
    served = {usbl.vehicle: ({"value": usbl.value, **usbl.columns}, usbl.sizes) for usbl in services}
    groups = run_groups({agent.name: agent.groups(served.get(agent.name)) for agent in agents})
    attributes: dict[str, Any] = {"scenario": to_yaml(scenario), "seed": seed, "trial": trial}
    if scenario.datum.latitude is not None and scenario.datum.longitude is not None:
        attributes |= {"latitude": scenario.datum.latitude, "longitude": scenario.datum.longitude}
    of_groups = {f"vehicles/{agent.name}": _of_vehicle(scenario, agent) for agent in agents}
    of_groups |= {f"structures/{name}": _of_structure(scenario, agents, place) for name, place in places.items()}
    log = Recorder(groups, attributes, of_groups, path)
    texts = {("vehicle", scenario.vehicles[agent.name].model): agent.vehicle.source for agent in agents}
    texts |= {("structure", scenario.structures[name].model): p.structure.source for name, p in places.items()}
    for (kind, model), text in texts.items():
        log.append("models", (0.0, kind, model, hashlib.sha256(text.encode()).hexdigest(), text))
    return log


def _of_vehicle(scenario: Scenario, agent: Agent) -> dict[str, Any]:
    """Attributes of a vehicle in the log."""
    settings = scenario.vehicles[agent.name]
    return {
        "model": settings.model,
        "nose": agent.vehicle.nose,
        "length": agent.vehicle.length,
        "estimator": settings.estimator.kind,
        "controller": settings.control.kind,
        "mission": settings.mission.kind,
        "mission_settings": yaml_text.dump(settings.mission.model_dump(mode="json")),
        "dock": agent.mission.dock.name if agent.mission.dock else "",
        "usbl_structure": (agent.dock if agent.serves else None) or "",
    }


def _of_structure(scenario: Scenario, agents: Sequence[Agent], found: Place) -> dict[str, Any]:
    """Attributes of a structure in the log; its transceiver is that of the first vehicle that it serves."""
    settings = scenario.structures[found.name]
    place = {"north": settings.north, "east": settings.east, "depth": settings.depth}
    served = next((agent.name for agent in agents if agent.dock == found.name), None)
    transceiver = scenario.vehicles[served].sensors.usbl.transceiver if served else ()
    axes = ("transceiver_forward", "transceiver_starboard", "transceiver_down")
    return {
        "model": settings.model,
        **place,
        "heading": settings.pose.heading,
        **found.structure.dimensions,
        **dict(zip(axes, transceiver, strict=False)),
    }


class Unrecorded:
    """Takes the place of a recorder where nothing is to be kept."""

    def append(self, group: str, row: Sequence[Any]) -> None:
        """Keeps nothing."""

    def truth(self, vehicle: str, truth: Truth) -> None:
        """Keeps nothing."""

    def reading(self, vehicle: str, reading: Reading, *extra: Any) -> None:
        """Keeps nothing."""

    def event(self, time: float, vehicle: str, kind: str, text: str) -> None:
        """Keeps nothing."""
