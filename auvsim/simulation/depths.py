"""Sees that all that a scenario places in the water is in the water."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from auvsim.base.errors import InputError
from auvsim.missions.formation.settings import FormationSettings
from auvsim.missions.track.mission import TrackSettings
from auvsim.missions.track.patterns import Circle, Weave, points
from auvsim.water.seabed import SeabedSettings

if TYPE_CHECKING:
    from auvsim.simulation.scenario import Scenario


def check_depths(scenario: "Scenario") -> None:
    """Sees that structures, starts and the waypoints of tracks are between the surface and the sea floor.

    Raises:
        InputError: one is not; the text begins with its dotted key.
    """
    terrain = scenario.world.floor
    if isinstance(scenario.water.terrain, SeabedSettings):
        _check_floor(scenario, scenario.water.terrain)
    for key, north, east, depth in _places(scenario):
        floor = terrain.depth(north, east)
        if not 0.0 < depth < floor:
            raise InputError(f"{key}: {depth:g} m is not between the surface and the sea floor at {floor:g} m")


def _check_floor(scenario: "Scenario", floor: SeabedSettings) -> None:
    """Sees that something of the scenario is on or near a generated floor, beside which the sea floor is even."""
    (x, y), near = floor.center, 1.5 * 0.5 * floor.extent
    places = [(north, east) for _, north, east, _ in _places(scenario)]
    if places and all(max(abs(north - x), abs(east - y)) > near for north, east in places):
        away = min(math.hypot(north - x, east - y) for north, east in places)
        raise InputError(
            f"water.terrain.center: the generated sea floor of {floor.extent:g} m lies {away:.0f} m from the nearest "
            "vehicle, waypoint or structure; move it there or give a larger extent"
        )


def _places(scenario: "Scenario") -> Iterator[tuple[str, float, float, float]]:
    """Dotted key of its depth, north, east, down [m] of all that a scenario places in the water."""
    for name, structure in scenario.structures.items():
        yield f"structures.{name}.depth", structure.north, structure.east, structure.depth
    for name, beacon in scenario.network.beacons.items():
        yield f"network.beacons.{name}.depth", beacon.north, beacon.east, beacon.depth
    for name, vehicle in scenario.vehicles.items():
        yield f"vehicles.{name}.start.depth", *scenario.start_position(name)
        if isinstance(vehicle.mission, FormationSettings):
            yield f"vehicles.{name}.mission.depth", *scenario.start_position(name)[:2], vehicle.mission.depth
        if isinstance(vehicle.mission, TrackSettings):
            pattern = vehicle.mission.pattern
            north, east, _ = scenario.start_position(name)
            ways = [[north, east]] if isinstance(pattern, Weave | Circle) else points(pattern).tolist()
            for north, east in ways:
                yield f"vehicles.{name}.mission.depth", north, east, vehicle.mission.depth
