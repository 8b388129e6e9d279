"""Whether a run can begin as its scenario says: nothing inside something else, no vehicle faster than its shaft."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.missions.formation.settings import FormationSettings
from auvsim.missions.mission import Place
from auvsim.missions.track.mission import TrackSettings
from auvsim.simulation.depths import check_depths
from auvsim.simulation.scenario import Scenario

ALONG = np.linspace(0.0, 1.0, 41)  # places along a dock's axis, from its mouth to its end, as shares of its length


def check(scenario: Scenario, world: Any, agents: Sequence[Any], places: Mapping[str, Place]) -> None:
    """Refuses a run that cannot begin.

    Args:
        scenario: of the run.
        world: in which its vehicles have been placed.
        agents: of its vehicles.
        places: its structures, by name.

    Raises:
        InputError: one line that begins with the dotted key at fault.
    """
    if scenario.water.terrain.kind == "grid":  # the others were seen to by the scenario itself
        check_depths(scenario)
    for agent in agents:
        settings = scenario.vehicles[agent.name]
        _check_speed(agent, "start", settings.start.speed)
        if isinstance(settings.mission, TrackSettings | FormationSettings):
            _check_speed(agent, "mission", settings.mission.speed)
    for one, other in combinations(places.values(), 2):
        if _docks_overlap(one, other):
            raise InputError(f"structures.{other.name}: it overlaps with '{one.name}'; place them apart")
    for one, other, depth in world.overlaps() if hasattr(world, "overlaps") else ():
        key = next((f"vehicles.{name}.start: " for name in (one, other) if name in scenario.vehicles), "")
        raise InputError(f"{key}'{one}' and '{other}' overlap by {depth:.2f} m; start them apart")
    for agent in agents:
        for place in places.values():
            if all(_is_inside(place, point) for point in _ends(scenario, agent)):
                raise InputError(f"vehicles.{agent.name}.start: it is inside '{place.name}'; start it outside")


def _check_speed(agent: Any, key: str, speed: float) -> None:
    """Sees that a vehicle can hold the speed [m/s] of its start or its mission."""
    if not hasattr(agent, "holds") or agent.holds(speed):
        return
    slow, fast = 0.0, speed
    while fast - slow > 1e-3:
        middle = 0.5 * (slow + fast)
        slow, fast = (middle, fast) if agent.holds(middle) else (slow, middle)
    raise InputError(
        f"vehicles.{agent.name}.{key}.speed: {speed:g} m/s is more than '{agent.vehicle.model}' can hold, "
        f"{slow:.2f} m/s"
    )


def _axis(place: Place) -> Iterator[tuple[Array, float]]:
    """Points (3,) [m] along the axis of a dock, from its mouth to its end, and its inner radius [m] there."""
    length = place.structure.cone_length + place.structure.throat_length
    for along in (length * ALONG).tolist():
        yield place.pose.position + along * _direction(place.pose.heading), _radius(place, along)


def _direction(heading: float) -> Array:
    return np.array((np.cos(heading), np.sin(heading), 0.0))


def _radius(place: Place, along: float) -> float:
    """Inner radius of a dock [m] at a distance behind its mouth [m]: a cone, then a throat."""
    dock = place.structure
    return float(np.interp(along, (0.0, dock.cone_length), (dock.mouth_radius, dock.throat_radius)))


def _docks_overlap(one: Place, other: Place) -> bool:
    return any(
        float(np.linalg.norm(here - there)) < radius + another
        for here, radius in _axis(one)
        for there, another in _axis(other)
    )


def _ends(scenario: Scenario, agent: Any) -> tuple[Array, Array]:
    """Nose and tail (3,) [m] of a vehicle at its start."""
    place = np.array(scenario.start_position(agent.name))
    ahead = _direction(np.radians(scenario.vehicles[agent.name].start.heading_deg))
    nose = agent.vehicle.nose
    return place + nose * ahead, place + (nose - agent.vehicle.length) * ahead


def _is_inside(place: Place, point: Array) -> bool:
    """Whether a point (3,) [m] is in the hollow of a dock."""
    off, axis = point - place.pose.position, _direction(place.pose.heading)
    along = float(off @ axis)
    beside = float(np.linalg.norm(off - along * axis))
    return 0.0 <= along <= place.structure.cone_length + place.structure.throat_length and beside < _radius(
        place, along
    )
