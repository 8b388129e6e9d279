"""The acoustic network of a run: the docks' USBL and its links, and all modems."""

from collections.abc import Callable, Mapping
from typing import Any

from numpy.random import Generator

from auvsim.acoustics.link import Channel
from auvsim.acoustics.modems import Equipment, Modems, build_modems
from auvsim.acoustics.network import Network
from auvsim.acoustics.usbl import Usbl
from auvsim.simulation.agent import Agent
from auvsim.simulation.fixed_stations import FixedStation
from auvsim.simulation.scenario import Scenario


def build_network(
    plan: Scenario, world: Any, agents: Mapping[str, Agent], noise: Callable[[str], Generator]
) -> tuple[Network, list[Usbl]]:
    """The network, and the docks' USBL that use it.

    Args:
        plan: the scenario.
        world: see `physics.world.World`.
        agents: by the names of their vehicles.
        noise: gives the generator of each source of noise, such as `auv/usbl`.
    """
    services = [_service(plan, world, agent, noise(f"{name}/usbl")) for name, agent in agents.items() if agent.serves]
    acoustics = plan.network.acoustics
    links = {usbl.vehicle: Channel(acoustics, noise(f"{usbl.vehicle}/acoustics")) for usbl in services}
    return Network(links, services, _modems(plan, world, agents, noise)), services


def _service(plan: Scenario, world: Any, agent: Agent, generator: Generator) -> Usbl:
    """The USBL of the dock that serves a vehicle."""
    assert agent.dock is not None
    state = world.structures.get(agent.dock)
    return Usbl(
        plan.vehicles[agent.name].sensors.usbl,
        generator,
        plan.structures[agent.dock].pose,
        vehicle=agent.name,
        structure=agent.dock,
        clock_offset=plan.network.acoustics.clock_offset,
        occupant=lambda: state.latched if state else None,
    )


def _modems(
    plan: Scenario, world: Any, agents: Mapping[str, Agent], noise: Callable[[str], Generator]
) -> Modems | None:
    """The modems of vehicles, structures and beacons."""
    equipment = {name: Equipment(v.modem, v.clock) for name, v in plan.vehicles.items() if v.modem}
    fixed = {name: FixedStation(found, noise(f"{name}/chart")) for name, found in plan.fixed_modems.items()}
    equipment |= {name: station.equipment for name, station in fixed.items()}
    if not equipment:
        return None
    medium = plan.network.medium(getattr(world, "terrain", plan.world.floor).depth, plan.water.sea_floor)

    def report(name: str, time: float, stamp: float) -> Any:
        return fixed[name].report(stamp) if name in fixed else agents[name].report(time, stamp)

    return build_modems(plan.network, equipment, medium, noise, report, 1.0 / plan.rates.control)
