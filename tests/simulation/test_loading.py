"""Scenarios by name, file and pinned keys: the same as the command line makes of them."""

from pathlib import Path

import pytest

from auvsim.base import yaml_text
from auvsim.base.errors import InputError
from auvsim.cli import options
from auvsim.simulation.loading import SHIPPED, find, load_scenario


def test_default_plan_with_pinned_keys_is_what_the_command_line_runs() -> None:
    """`auvsim dock --seed 3 --current.speed 0.5`, and nothing else changes by what is pinned."""
    pinned = load_scenario(seed=3, trial=2, current={"speed": 0.5})
    assert pinned == options.scenario(None, None, {"current": {"speed": 0.5}}, 3, 2)
    free = load_scenario(seed=3, trial=2)
    assert pinned.water.current.speed == 0.5 != free.water.current.speed
    assert pinned.vehicles == free.vehicles


def test_file_is_pinned_on_the_default_plan_and_keys_on_the_file(tmp_path: Path) -> None:
    """Keys given win over the file, the file over the plan; where a file is wrong, the error names its line."""
    path = tmp_path / "mine.yaml"
    path.write_text("duration: 60\ncurrent: {speed: 0.2}\n")
    assert load_scenario(path, seed=3).duration == 60.0
    assert load_scenario(path, seed=3, duration=30).duration == 30.0
    assert load_scenario(path, seed=3).vehicles == load_scenario(seed=3).vehicles
    path.write_text("duration: 60\ncurrent: {sped: 0.2}\n")
    with pytest.raises(InputError, match=r"mine\.yaml:2: current\.sped"):
        load_scenario(path)


def test_shipped_scenario_says_all_there_is() -> None:
    """Every shipped one loads by name; in full form only its own distributions are drawn; an unknown one names all."""
    names = [path.stem for path in SHIPPED.glob("*.yaml")]
    assert "three_vehicles" in names
    for name in names:
        path = SHIPPED / f"{name}.yaml"
        short = "vehicles" not in yaml_text.load(path).value  # then the rest is drawn, as of `dock`
        drawn = short or "{uniform:" in path.read_text()
        assert (load_scenario(name, seed=1) == load_scenario(name, seed=2)) is not drawn
    assert (
        load_scenario("three_vehicles", vehicles={"auv_1": {"start": {"depth": 9.0}}}).vehicles["auv_1"].start.depth
        == 9.0
    )
    with pytest.raises(InputError, match="three_vehicles"):
        find("four_vehicles")
