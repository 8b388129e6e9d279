"""The parts of a user's own in docs/extending.md: they are found, run in a scenario, and do their work."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from auvsim.analysis.summary import summarise
from auvsim.base.errors import InputError
from auvsim.base.frames import wrap
from auvsim.cli import report
from auvsim.data.log import VehicleLog, read, write
from auvsim.simulation import scenario
from auvsim.simulation.run import run

PAGE = Path(__file__).parents[1] / "docs" / "extending.md"
# The page's files by the name in the first line of each block.
BLOCKS = dict(re.findall(r"^```\w+\n# (\S+)\n(.*?)^```", PAGE.read_text(), re.DOTALL | re.MULTILINE))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A working folder that holds the page's files."""
    path = tmp_path_factory.mktemp("user")
    for name, text in BLOCKS.items():
        (path / name).parent.mkdir(exist_ok=True)
        (path / name).write_text(text)
    before = list(sys.path)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path)
        yield path
    sys.path[:] = before
    for module in [module for module in sys.modules if module.partition(".")[0] == "mine"]:
        del sys.modules[module]


@pytest.fixture(scope="module")
def profile(folder: Path) -> VehicleLog:
    """The vehicle of the page's scenario after a run, read from its file."""
    write(run(scenario.from_yaml((folder / "profile.yaml").read_text()), seed=5), folder / "trial.nc")
    return read(folder / "trial.nc").vehicle()


def test_every_example_is_short() -> None:
    """Each of the four parts is an example of at most 40 lines, its first line with the file name included."""
    assert {name.partition("/")[0] for name in BLOCKS} == {"mine", "profile.yaml"}
    parts = [text for name, text in BLOCKS.items() if name.startswith("mine/")]
    assert len(parts) == 4
    assert max(text.count("\n") + 1 for text in parts) <= 40


def test_sensor_measures_at_its_rate_and_is_logged_with_its_units(profile: VehicleLog) -> None:
    """Its error has the noise that the scenario gives: sd 0.01 within 5 standard errors."""
    readings, truth = profile["temperature"], profile["truth"]
    assert np.allclose(np.diff(readings["time"]), 0.5)
    error = readings["value"][:, 0] - (18.0 - 0.2 * np.interp(readings["time"], truth["time"], truth["position"][:, 2]))
    assert abs(error.std() - 0.01) < 5 * 0.01 / np.sqrt(2 * len(error))
    assert abs(error.mean()) < 5 * 0.01 / np.sqrt(len(error))
    assert profile.table("temperature")["value"].units == "degC"


def test_estimator_reckons_and_its_states_are_logged(profile: VehicleLog) -> None:
    """Its two states are logged under their names; its error is below 3 % of the distance run: compass bias of 0.5 deg
    (sd), mounting of 0.3 deg, velocity held for half a second."""
    estimate, truth = profile["estimate"], profile["truth"]
    assert profile.table("estimate")["mean"].labels == ("north", "east")
    assert estimate["mean"].shape[1:] == (2,)
    assert estimate["covariance"].shape[1:] == (2, 2)
    position = np.column_stack([np.interp(estimate["time"], truth["time"], c) for c in truth["position"][:, :2].T])
    way = np.linalg.norm(np.diff(truth["position"][:, :2], axis=0), axis=1).sum()
    assert way > 60.0
    assert np.linalg.norm(estimate["mean"] - position, axis=1).max() < 0.03 * way
    assert profile.attributes["estimator"] == "mine.reckoning:DeadReckoning"


def test_controller_turns_to_the_heading_and_holds_it(profile: VehicleLog) -> None:
    """From 60 deg the vehicle turns to 0.5 rad and stays within 5 deg of it, of which the compass has 1.5 (3 sd)."""
    heading = np.degrees([wrap(yaw) for yaw in profile["truth"]["attitude"][:, 2]])
    assert abs(heading[0] - 60.0) < 1.0
    settled = heading[len(heading) // 2 :]
    assert np.abs(settled - np.degrees(0.5)).max() < 5.0
    assert profile["command"]["rudder"][0] < 0.0  # to port


def test_mission_visits_its_depths_and_its_metrics_are_in_the_summary(
    profile: VehicleLog, capsys: pytest.CaptureFixture[str]
) -> None:
    """Phases, variables, events and metrics are all read off the log; it ends before the time limit."""
    mission, depth = profile["mission"], profile["truth"]["position"][:, 2]
    assert profile.phases == ("dive", "climb")
    assert mission["phase"][0] == 0
    reached = profile["event"]["time"][profile["event"]["kind"] == "reached"]
    for time, wanted in zip(reached, (13.0, 8.0, 12.0, 8.0), strict=True):  # to 0.5 m of the gauge, bias 0.1 m (sd)
        assert abs(np.interp(time, profile["truth"]["time"], depth) - wanted) < 1.0
    assert np.array_equal(mission["reached"], np.searchsorted(reached, mission["time"], side="right"))
    assert profile["truth"]["time"][-1] < 240.0
    summary = summarise(profile)
    assert summary["reached"] == 4
    assert summary["deepest"] == depth.max()
    report.show(summary)
    printed = capsys.readouterr().out
    assert "Profile trial" in printed
    assert re.search(rf"largest true depth \[m\] .* {depth.max():.3g} ", printed)


@pytest.mark.parametrize(
    ("key", "part", "settings"),
    [
        ("sensors", "temperature", {"noise": -1.0}),
        ("control", "Helm", {"heading_gian": 1.0}),
        ("mission", "Profile", {"heading": 0.5}),
    ],
)
def test_mistakes_in_settings_of_ones_own_are_one_line(folder: Path, key: str, part: str, settings: dict) -> None:
    """A class `Settings` of the user's refuses what does not fit, with the part's name."""
    values = yaml.safe_load(BLOCKS["profile.yaml"])
    (values[key][part] if key == "sensors" else values[key])["settings"] = settings
    with pytest.raises(InputError, match=part) as caught:
        run(scenario.parse(values))
    assert "\n" not in str(caught.value)
    assert {"sensors": "noise", "control": "heading_gian", "mission": "depths"}[key] in str(caught.value)


def test_a_part_that_is_not_there_is_named(folder: Path) -> None:
    """Neither a module nor a class that is missing passes."""
    values = yaml.safe_load(BLOCKS["profile.yaml"])
    values["mission"]["kind"] = "mine.profile:Nothing"
    with pytest.raises(InputError, match=r"mission 'mine\.profile:Nothing': AttributeError"):
        run(scenario.parse(values))


def test_a_part_that_raises_ends_the_run_as_diverged_with_its_traceback(folder: Path) -> None:
    """The log up to there is kept, and names the part."""
    (folder / "mine" / "broken.py").write_text(
        BLOCKS["mine/reckoning.py"].replace("        c, s = np", "        assert time < 5.0\n        c, s = np")
    )
    values = yaml.safe_load(BLOCKS["profile.yaml"])
    values["estimator"]["kind"] = "mine.broken:DeadReckoning"
    log = run(scenario.parse(values))
    event = log.groups["event"]
    assert log.attributes["status"] == "diverged"
    assert 4.0 < log.vehicle()["truth"]["time"][-1] <= 5.0
    assert any("mine.broken:DeadReckoning" in text for text in event["text"][event["kind"] == "diverged"])
    assert any("assert time < 5.0" in text for text in event["text"][event["kind"] == "traceback"])
