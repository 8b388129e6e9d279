"""Several vehicles in one loop: each senses, navigates and docks by itself, and they meet where they meet."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import auvsim
from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.data.log import Log
from auvsim.missions.docking.guidance import Phase
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import Simulation, run

SHIPPED = Path(auvsim.__file__).parent / "scenarios" / "three_vehicles.yaml"


def events(log: Log, vehicle: str) -> list[tuple[str, str]]:
    """Kind and text of each event of a vehicle."""
    event = log.vehicle(vehicle)["event"]
    return list(zip(event["kind"].tolist(), event["text"].tolist(), strict=True))


def docking(north: float, east: float, **more: Any) -> dict:
    """A vehicle that starts at a place on its way to the only dock."""
    return {"start": {"north": north, "east": east, "depth": 20.0, "heading_deg": 0.0, "speed": 1.5}, **more}


def near(**vehicles: dict) -> scenario.Scenario:
    """Vehicles on their way to a dock that looks north, 90 m north of the datum."""
    dock = {"dock": {"north": 90.0, "east": 5.0, "depth": 20.0, "heading_deg": 0.0}}
    short = {"kind": "docking", "gate_distance": 60.0}
    return scenario.parse(
        {
            "duration": 200.0,
            "structures": dock,
            "vehicles": {name: {"mission": short, **values} for name, values in vehicles.items()},
        }
    )


@pytest.fixture(scope="module")
def three() -> Log:
    """The shipped scenario."""
    values = yaml_text.load(SHIPPED).value
    return run(scenario.parse(sampling.draw(values, 4)), seed=4)


def test_two_dock_and_a_third_keeps_its_track(three: Log) -> None:
    """Each at its own dock, by its own estimate; the run ends when the last is done."""
    assert three.vehicles == ("auv_1", "auv_2", "auv_3")
    assert three.structures == ("west", "east")
    for name, dock in (("auv_1", "west"), ("auv_2", "east")):
        log = three.vehicle(name)
        assert log.structure is not None
        assert log.structure.name == dock
        assert log["mission"]["phase"][-1] == Phase.DOCKED
        assert np.linalg.norm(log["truth"]["position"][-1] - log.structure.position) < 2.0  # its length is 1.6 m
    assert [kind for kind, _ in events(three, "auv_3")].count("waypoint") == 8
    assert three.vehicle("auv_3")["truth"]["time"][-1] == three.vehicle("auv_1")["truth"]["time"][-1]


def test_vehicles_of_one_model_have_noises_of_their_own(three: Log) -> None:
    """No two compasses, gauges or links err alike."""
    for sensor in ("compass", "depth"):
        errors = []
        for name in three.vehicles:
            log = three.vehicle(name)
            count = min(1500, len(log[sensor]["time"]))
            truth = log["truth"]["attitude"][1 : count + 1, 2] if sensor == "compass" else None
            truth = log["truth"]["position"][1 : count + 1, 2] if truth is None else truth
            errors.append(np.angle(np.exp(1j * (log[sensor]["value"][:count, 0] - truth))))
        correlations = np.corrcoef(np.array(errors))
        assert np.abs(correlations[np.triu_indices(3, 1)]).max() < 4.3 / np.sqrt(count)  # 4.3 deviations of none
    pings = [three.vehicle(name)["usbl"]["time"][:5].tolist() for name in three.vehicles]
    assert pings[0] != pings[1] != pings[2] != pings[0]


def test_the_water_is_that_of_each_vehicles_place() -> None:
    """In a current that depends on depth, two at different depths drift differently, each as if alone."""
    points = [{"depth": 0.0, "speed": 0.6}, {"depth": 30.0, "speed": 0.0}]
    water = {"current": {"kind": "shear", "profile": "linear", "points": points}}
    track = {"kind": "track", "pattern": {"kind": "waypoints", "points": [[500.0, 0.0]]}}
    ways = {}
    for depths in ((5.0, 25.0), (5.0,), (25.0,)):
        vehicles = {
            f"auv_{depth:g}": {
                "start": {"north": 0.0, "east": 40.0 * depth, "depth": depth, "speed": 1.5},
                "mission": {**track, "depth": depth},
            }
            for depth in depths
        }
        values = {"duration": 20.0, "water": water, "structures": {"dock": {}}, "vehicles": vehicles}
        log = run(scenario.parse(values), seed=1)
        ways[depths] = {name: log.vehicle(name)["truth"] for name in log.vehicles}
    for depth, surface in ((5.0, 0.5), (25.0, 0.1)):
        name = f"auv_{depth:g}"
        both, alone = ways[5.0, 25.0][name], ways[(depth,)][name]
        assert both["position"].tobytes() == alone["position"].tobytes()
        np.testing.assert_allclose(both["current"][:, 0], surface, atol=0.02)  # it keeps its depth to a metre


def test_a_second_vehicle_at_an_occupied_dock_aborts_with_that_reason() -> None:
    """It is told by the dock's packets, and never touches the first."""
    log = run(near(first=docking(0.0, 5.0), second=docking(-60.0, 5.0)), seed=6)
    assert events(log, "first")[-1][0] == "docked"
    kind, text = events(log, "second")[-1]
    assert (kind, text) == ("aborted", "the dock is occupied by 'first'")
    assert len(log.vehicle("second")["contact"]["time"]) == 0


def test_two_that_meet_head_on_touch_and_bounce() -> None:
    """On one line at one depth towards each other: contact with each other, and neither passes through."""
    straight = {"kind": "manoeuvre", "manoeuvre": {"kind": "straight", "duration": 30.0, "speed": 1.0}}
    vehicles = {
        name: {
            "start": {"north": north, "east": 0.0, "depth": 15.0, "heading_deg": heading, "speed": 1.0},
            "mission": straight,
            "sensors": {"compass": {"heading_noise_deg": 0.0, "heading_bias_deg": 0.0}, "depth": {"bias": 0.0}},
        }
        for name, north, heading in (("south", -8.0, 0.0), ("north", 8.0, 180.0))
    }
    values = {"duration": 30.0, "structures": {"dock": {"north": 500.0}}, "vehicles": vehicles}
    log = run(scenario.parse(values), seed=2)
    ways = {name: log.vehicle(name)["truth"] for name in log.vehicles}
    apart = ways["north"]["position"] - ways["south"]["position"]
    assert np.linalg.norm(apart, axis=1).min() > 0.18  # two radii of 0.095 m: they slide past, never through
    for name, other in (("south", "north"), ("north", "south")):
        contact = log.vehicle(name)["contact"]
        assert set(contact["other"].tolist()) == {other}
        first = contact["time"][0]
        before = ways[name]["nu"][np.searchsorted(ways[name]["time"], first - 0.2), 0]
        after = ways[name]["nu"][np.searchsorted(ways[name]["time"], first + 0.5), 0]
        assert before > 0.8
        assert after < 0.5 * before


def test_a_fleet_replays_bit_for_bit() -> None:
    """And one vehicle's sensors change nothing of another's run."""
    from auvsim.data.log import differences

    plan = near(first=docking(0.0, 5.0), second=docking(-60.0, 40.0))
    quiet = {"depth": {"noise": 0.3}}
    changed = near(first=docking(0.0, 5.0), second=docking(-60.0, 40.0, sensors=quiet))
    short, other = (made.model_copy(update={"duration": 15.0}) for made in (plan, changed))
    first, again, third = run(short, seed=3), run(short, seed=3), run(other, seed=3)
    assert differences(first, again) == []
    assert not [name for name in differences(first, third) if "vehicles/first/" in name]
    assert "vehicles/second/sensors/depth/value" in differences(first, third)


def test_a_dock_that_is_not_named_where_there_are_two_is_refused() -> None:
    """Before anything runs."""
    two = {"a": {"north": 100.0}, "b": {"north": -100.0}}
    vehicle = {"start": {"north": 0.0, "east": 0.0}}
    with pytest.raises(InputError, match="no dock is given; name one of a, b"):
        Simulation(scenario.parse({"structures": two, "vehicles": {"auv": vehicle}}), 0)


@pytest.mark.parametrize(
    ("second", "pair"),
    [
        ({"north": 0.0, "east": 5.0, "depth": 20.0}, "'first' and 'second'"),  # where the first one is
        ({"north": 0.9, "east": 5.05, "depth": 20.0}, "'first' and 'second'"),  # its stern in the other's bow
        (
            {"north": 90.0, "east": 5.7, "depth": 20.0},
            "'second' and 'dock'|'dock' and 'second'",
        ),  # in the funnel's wall
        ({"north": -50.0, "east": 5.0, "depth": 39.95}, "'sea_floor' and 'second'"),
    ],
)
def test_nothing_starts_inside_something_else(second: dict, pair: str) -> None:
    plan = near(first=docking(0.0, 5.0), second={"start": {"heading_deg": 0.0, "speed": 1.5, **second}})
    with pytest.raises(InputError, match=rf"start: ({pair}) overlap by 0\.\d\d m; start them apart"):
        Simulation(plan, 0)


def test_what_nearly_touches_starts() -> None:
    """Two hulls of 0.095 m radius side by side, 0.2 m apart."""
    near_each_other = near(first=docking(0.0, 5.0), second=docking(0.0, 5.35))
    assert len(Simulation(near_each_other, 0).agents) == 2
