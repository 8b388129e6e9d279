"""Sees that all that a scenario places in the water is in the water."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from auvsim.base.errors import InputError
from auvsim.missions.formation.settings import FormationSettings
from auvsim.missions.track.mission import TrackSettings
from auvsim.missions.track.patterns import Circle, Weave, points
from auvsim.water.seabed import SeabedSettings
from auvsim.water.terrain_grid import GriddedFloor

if TYPE_CHECKING:
    from auvsim.simulation.scenario import Scenario


def check_depths(scenario: "Scenario") -> None:
    """Sees that structures, starts and the waypoints of tracks are between the surface and the sea floor.

    Raises:
        InputError: one is not; the text begins with its dotted key.
    """
    terrain = scenario.world.floor
    if isinstance(terrain, GriddedFloor):
        _check_floor(scenario, terrain)
    for key, north, east, depth in _places(scenario):
        floor = terrain.depth(north, east)
        if not 0.0 < depth < floor:
            raise InputError(f"{key}: {depth:g} m is not between the surface and the sea floor at {floor:g} m")


def _check_floor(scenario: "Scenario", floor: GriddedFloor) -> None:
    """Sees that something of the scenario is on or near a gridded floor, beside which the sea floor is even."""
    (south, north), (west, east) = floor.bounds
    near = 0.25 * max(north - south, east - west)
    places = [(x, y) for _, x, y, _ in _places(scenario)]
    if not places or any(south - near <= x <= north + near and west - near <= y <= east + near for x, y in places):
        return
    if isinstance(settings := scenario.water.terrain, SeabedSettings):
        away = min(math.hypot(x - settings.center[0], y - settings.center[1]) for x, y in places)
        raise InputError(
            f"water.terrain.center: the generated sea floor of {settings.extent:g} m lies {away:.0f} m from the "
            "nearest vehicle, waypoint or structure; move it there or give a larger extent"
        )
    raise InputError(
        f"water.terrain: the grid from north {south:.0f} to {north:.0f} m, east {west:.0f} to {east:.0f} m holds no "
        "vehicle, waypoint or structure; give northing and easting (or latitude and longitude) of the datum, where "
        "north and east are 0, in the grid"
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
