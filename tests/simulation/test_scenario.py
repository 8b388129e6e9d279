"""The schema: strict, its errors one line each that says where, what and what would be right."""

import math
import re

import numpy as np
import pytest
from pydantic import BaseModel

from auvsim.base import schema, yaml_text
from auvsim.base.errors import InputError
from auvsim.base.frames import rotation
from auvsim.simulation.sampling import default_plan, draw, merge
from auvsim.simulation.scenario import Scenario, from_yaml, parse, to_yaml
from auvsim.simulation.scenario_settings import Rates
from auvsim.simulation.sensor_settings import on_board
from auvsim.simulation.short import ShortScenario

CURRENTS = "none, uniform, turning, approach_turn, knots, shear, gust, boundary_layer, wake, waves, grid, sum"


def nested(key: str, value: object) -> dict:
    """{'a': {'b': value}} of a.b."""
    for part in reversed(key.split(".")):
        value = {part: value}
    assert isinstance(value, dict)
    return value


def message(values: dict, **places: str) -> str:
    """The one-line error of values that cannot be used."""
    with pytest.raises(InputError) as error:
        parse(values, places)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("sensors.compass.rate", 7, "7 Hz does not divide the control rate 10 Hz; use 5 or 10 Hz"),
        ("sensors.depth.rate", 20, "20 Hz does not divide the control rate 10 Hz; use 10 Hz"),
        ("rates.filter", 0.3, "0.3 Hz does not divide the control rate 10 Hz; use 0.25 or 0.5 Hz"),
        ("rates.log", 30, "30 Hz does not divide the control rate 10 Hz; use 10 Hz"),
        ("rates.control", 30, "30 Hz does not divide the physics rate 100 Hz; use 25 or 50 Hz"),
        ("rates.physics", 0, "0 should be greater than or equal to 0.1 (steps of the dynamics [Hz])"),
        ("rates.physics", math.nan, ".nan should be a finite number"),
        ("duration", math.inf, ".inf should be a finite number (time limit of the run [s])"),
        ("duration", "600", "'600' should be a valid number"),
        ("duration", True, "true should be a valid number"),
        ("vehicle.start.depth", -1.0, "-1.0 should be greater than or equal to 0 (depth [m])"),
        ("vehicle.start", None, "null should be a mapping"),
        ("vehicle.start.range", {"gaussian": [0, 1]}, "{gaussian: [0, 1]} should be a valid number"),
        ("vehicle.model", 3, "3 should be a valid string"),
        (
            "current",
            {"speed": 0.2},
            f"kind is not given; there are {CURRENTS}",
        ),
        ("current.kind", "unifrm", None),
        ("current.terms", None, None),
    ],
)
def test_bad_values_are_named(key: str, value: object, text: str | None) -> None:
    """Key, value, what would be right."""
    found = message(nested(key, value))
    if text is None:
        assert found.startswith("current: ")
        assert f"there are {CURRENTS}" in found
    else:
        assert found.startswith(f"{key}: {text}")


def test_errors_inside_lists_and_kinds() -> None:
    """The path counts items and leaves out the tags that pydantic puts between."""
    points = [{"depth": 1, "speed": 1}, {"depth": -1, "speed": 3}]
    assert message({"current": {"kind": "shear", "points": points}}).startswith("current.points.1.depth: -1 should")
    terms = [{"kind": "none"}, {"kind": "turning", "start": 20, "end": 10}]
    assert message({"current": {"kind": "sum", "terms": terms}}).startswith("current.terms.1: the turn ends at 10")
    assert message({"current": {"kind": "uniform", "start": 3}}).startswith("current.start: unknown key")


def test_place_is_that_of_the_nearest_key_above() -> None:
    """A default at fault is blamed on what was given above it, else on the whole file."""
    places = {"": "s.yaml", "sensors": "s.yaml:2", "sensors.compass": "s.yaml:3"}
    assert message({"sensors": {"compass": {"rate": 7}}}, **places).startswith("s.yaml:3: sensors.compass.rate: 7 Hz")
    assert message({"duration": -1}, **places).startswith("s.yaml: duration: -1")


def test_every_misspelled_key_is_recognised() -> None:
    """Any key with its last letter doubled is refused, and the right one is suggested."""
    of_kinds = ("current.", "world.terrain.", "manoeuvre.", "mission.", "estimator.", "control.", "guidance.kind")
    for key in schema.keys(ShortScenario):
        if key.startswith(of_kinds):
            continue  # which keys there are depends on the kind
        assert f"unknown key; did you mean {key}?" in message(nested(key + key[-1], 1.0))


def test_unknown_key_elsewhere_and_nowhere() -> None:
    """A key at the wrong level is found at the right one; a strange one gets the list."""
    assert "did you mean vehicle.start.speed or current.speed or " in message({"speed": 1.0})
    assert "there are physics, control, filter, log" in message({"rates": {"zzzzzz": 1.0}})


def test_suggested_rates_are_accepted() -> None:
    """For any rate that does not divide, what the error proposes does."""
    generator = np.random.default_rng(1)
    for _ in range(200):
        physics = float(generator.choice([50, 64, 100, 120, 1000]))
        rate = round(float(generator.uniform(0.05, physics)), 3)
        if abs(physics / rate - round(physics / rate)) < 1e-9:
            continue
        rates = {"physics": physics, "control": physics, "filter": physics}
        fast = {"compass": {"rate": physics}, "depth": {"rate": physics}, "feedback": {"rate": physics}}
        text = message({"rates": {**rates, "log": rate}, "sensors": fast})
        proposed = re.findall(r"[\d.]+", text.split("; use ")[1])
        assert proposed
        for value in proposed:
            # The default sensors divide any control rate that is a multiple of theirs.
            assert parse({"rates": {**rates, "log": float(value)}, "sensors": fast}).rates.log == float(value)


def test_rates_below_one_hertz_divide() -> None:
    """A rate may be a whole number of seconds, and rates that are no binary fractions divide too."""
    assert parse({"rates": {"filter": 0.2, "log": 0.1}}).rates == Rates(filter=0.2, log=0.1)


def test_scenario_survives_yaml() -> None:
    """Text and back gives an equal scenario, drawn numbers to the last bit."""
    for seed in range(20):
        scenario = parse(draw(default_plan(), seed))
        assert from_yaml(to_yaml(scenario)) == scenario
    shear = parse({"current": {"kind": "sum", "terms": [{"kind": "shear"}, {"kind": "gust", "intensity": 1e-7}]}})
    assert from_yaml(to_yaml(shear)) == shear


def test_text_that_is_no_scenario_is_refused() -> None:
    """Lists and empty texts are no scenarios."""
    for text in ("- 1\n- 2\n", "", "3"):
        with pytest.raises(InputError, match="a scenario is a mapping"):
            from_yaml(text)


@pytest.mark.parametrize("heading_deg", [0.0, 37.0, 180.0, -95.0])
@pytest.mark.parametrize("bearing_deg", [0.0, 60.0, -60.0])
def test_start_is_where_its_range_and_bearing_say(heading_deg: float, bearing_deg: float) -> None:
    """In the dock's frame (x the course of entry, y starboard) a start of bearing 0 is straight astern of the mouth.

    Clockwise from there, seen from the dock, is towards its port side, because the look is astern.
    """
    start = {"range": 250.0, "bearing_deg": bearing_deg, "depth": 12.0}
    scenario = parse({"vehicle": {"start": start}, "dock": {"heading_deg": heading_deg}})
    in_dock_frame = rotation(0.0, 0.0, math.radians(heading_deg)).T @ np.array(scenario.start_position("remus100"))
    bearing = math.radians(bearing_deg)
    # Rounding of a few operations on numbers of 250.
    np.testing.assert_allclose(
        in_dock_frame, [-250 * math.cos(bearing), -250 * math.sin(bearing), 12.0], atol=1e-12 * 250
    )


def test_commented_yaml_reads_back() -> None:
    """The printed default plan is the default plan, and a definite scenario prints likewise."""
    text = schema.commented(ShortScenario, default_plan())
    assert yaml_text.read(text).value == default_plan()
    whole = parse(draw(default_plan(), 3))
    assert from_yaml(schema.commented(Scenario, whole.model_dump(mode="json"))) == whole
    assert max(map(len, text.splitlines())) <= schema.WIDTH


def settings_classes(model: type[BaseModel]) -> set[type[BaseModel]]:
    """The class and all classes of settings below it."""
    below = [member for field in model.model_fields.values() for member in schema.members(field.annotation)]
    return {model}.union(*(settings_classes(member) for member in below))


def test_every_key_is_described_and_has_its_unit() -> None:
    """Each number's description ends in its unit, or says what stands in brackets; each section has a sentence."""
    for model in settings_classes(Scenario):
        assert model.__doc__, model
        for name, field in model.model_fields.items():
            if schema.members(field.annotation) or name == "kind":
                continue
            assert field.description, f"{model.__name__}.{name}"
            if field.annotation is float:
                assert re.search(r"\[[^\]]+\]", field.description), f"{model.__name__}.{name} has no unit"


def test_other_kinds_are_shown() -> None:
    """Every kind of current stands in the text, those not in use as comments that hold their own keys."""
    text = schema.commented(ShortScenario, default_plan())
    for kind in ("none", "uniform", "turning", "shear", "gust", "sum"):
        assert f"kind: {kind}" in text
    assert "# correlation_time:" in text


FLEET = {
    "structures": {"west": {"east": -200.0, "heading_deg": 30.0}, "east": {"east": 200.0, "depth": 15.0}},
    "vehicles": {
        "a": {"start": {"range": 100.0, "bearing_deg": 10.0}, "mission": {"kind": "docking", "dock": "west"}},
        "b": {
            "start": {"range": 50.0, "structure": "east"},
            "mission": {"kind": "track"},
            "sensors": {"usbl": {"dock": "east"}, "ranger": {"kind": "range", "beacon": [1.0, 2.0, 3.0]}},
        },
    },
}  # fmt: skip


def changed(key: str, value: object) -> dict:
    """FLEET with one dotted key changed."""
    return merge(FLEET, nested(key, value))


def test_the_short_form_is_the_full_one_of_one_vehicle() -> None:
    """What either says of the same run is the same scenario, to the last key."""
    short = {
        "dock": {"depth": 17.0, "heading_deg": 40.0},
        "vehicle": {"start": {"range": 222.0}},
        "current": {"kind": "uniform", "speed": 0.2},
        "estimator": {"kind": "imm", "turn_interval": 99.0},
        "guidance": {"attempts": 2},
        "world": {"sea_floor": 33.0, "integrator": "RK4"},
        "acoustics": {"jitter": 0.2},
    }
    full = {
        "structures": {"dock": {"depth": 17.0, "heading_deg": 40.0}},
        "vehicles": {
            "remus100": {
                "start": {"range": 222.0},
                "estimator": {"kind": "imm", "turn_interval": 99.0},
                "mission": {"kind": "docking", "attempts": 2},
            }
        },
        "water": {"sea_floor": 33.0, "current": {"kind": "uniform", "speed": 0.2}},
        "physics": {"integrator": "RK4"},
        "network": {"acoustics": {"jitter": 0.2}},
    }
    assert parse(short) == parse(full)


def test_earlier_forms_are_read() -> None:
    """An estimator's kind as `factory` with the keys of all kinds, and a start at the top."""
    old = {"estimator": {"factory": "paper", "compass_deg": 2.0, "current_noise": 1e-6, "turn_interval": 9.0}}
    assert parse(old) == parse({"estimator": {"kind": "paper", "compass_deg": 2.0}})
    assert "unknown key" in message({"estimator": {"factory": "paper", "compas_deg": 2.0}})
    top = {"start": {"range": 77.0}, "vehicle": {"start": {"depth": 9.0}}}
    assert parse(top) == parse({"vehicle": {"start": {"range": 77.0, "depth": 9.0}}})


def test_places_of_a_fleet() -> None:
    """Starts are seen from the dock that is meant: the mission's, or the one that is named."""
    fleet = parse(FLEET)
    direction = math.radians(30.0 + 180.0 + 10.0)
    expected = (100.0 * math.cos(direction), -200.0 + 100.0 * math.sin(direction), 20.0)
    np.testing.assert_allclose(fleet.start_position("a"), expected, atol=1e-10)
    np.testing.assert_allclose(fleet.start_position("b"), (-50.0, 200.0, 20.0), atol=1e-10)
    assert from_yaml(to_yaml(fleet)) == fleet
    ranger = fleet.vehicles["b"].sensors.model_dump()["ranger"]
    assert (ranger["kind"], ranger["beacon"], ranger["noise"]) == ("range", (1.0, 2.0, 3.0), 0.2)


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("vehicles.a.mission.dock", "north", "vehicles.a.mission.dock: no structure 'north'; there are west, east"),
        ("vehicles.b.start.structure", None, "vehicles.b.start.structure: range and bearing are from a structure"),
        ("vehicles.b.sensors.usbl.dock", "x", "vehicles.b.sensors.usbl.dock: no structure 'x'"),
        ("vehicles.b.sensors.ranger.noise", -1.0, "vehicles.b.sensors: ranger.noise: -1.0 should be greater than"),
        ("vehicles.b.sensors.ranger.rate", 3.0, "vehicles.b.sensors.ranger.rate: 3 Hz does not divide the control"),
        (
            "vehicles.b.sensors.compas",
            {"rate": 5.0},
            "vehicles.b.sensors.compas: unknown key; did you mean vehicles.b.sensors.compass?",
        ),
        ("vehicles.b.sensors.sonar", {"kind": "lidar"}, "vehicles.b.sensors: sonar.kind: no sensor 'lidar'"),
        ("vehicles.a.estimator.kind", "particle", "vehicles.a.estimator: no kind 'particle'; there are robust"),
        ("vehicles.a.estimator.turn_intervals", 9.0, "vehicles.a.estimator.turn_intervals: unknown key"),
        ("vehicles.a.start.north", 3.0, "vehicles.a.start: north and east go together"),
        ("vehicles.a.mission.kind", "dock", "vehicles.a.mission: no kind 'dock'; there are docking, manoeuvre, track"),
        ("vehicles.a b.model", "remus100", "vehicles.a b: a name is 1 to 64 letters"),
        ("vehicle.model", "remus100", "vehicle: unknown key; did you mean vehicles?"),
    ],
)
def test_bad_values_of_a_fleet_are_named(key: str, value: object, text: str) -> None:
    """With the vehicle that they concern."""
    assert message(changed(key, value)).startswith(text)


@pytest.mark.parametrize("kind", ["range", "gps", "altimeter", "fix"])
def test_a_sensor_called_as_its_kind_is_there_once(kind: str) -> None:
    found = parse({"sensors": {kind: {"kind": kind}}})
    names = [name for name, _ in on_board(found.vehicles["remus100"].sensors)]
    assert names.count(kind) == 1
