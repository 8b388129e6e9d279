"""Strangers' code: a part that goes wrong ends the run as diverged, with its name and traceback in the log."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import auvsim
from auvsim.base.errors import InputError
from auvsim.cli import main
from auvsim.data import log
from auvsim.simulation import scenario
from auvsim.simulation.run import run
from auvsim.vehicles import model_files
from robustness import strangers
from robustness.models import spoiled

DURATION = 14.0  # [s]
FAULTS = {
    "estimator": ("raises", "exits", "recurses", "none", "nan", "shape", "covariance", "list", "heading"),
    "control": ("raises", "exits", "observes", "none", "nan", "shape", "text"),
    "mission": ("raises", "recurses", "none", "nan", "shape", "text", "phase", "event", "short", "word", "rests"),
    "sensor": ("raises", "exits", "tuple", "shape", "stamp", "name", "float"),
}
MADE = {"estimator": "Estimator", "control": "Controller", "mission": "Mission", "sensor": "Sensor"}
NAMES = {"control": "controller"}


def values(part: str, fault: str, made: str | None = None) -> dict:
    """A short scenario with one part of a stranger's."""
    own = {"kind": f"robustness.strangers:{made or MADE[part]}", "settings": {"fault": fault}}
    whole: dict = {"duration": DURATION, "vehicle": {"start": {"range": 150.0}}}
    if part == "sensor":
        return whole | {"sensors": {"second": own | {"rate": 10.0}}}
    return whole | {part: own}


@pytest.mark.parametrize(("part", "fault"), [(part, fault) for part, faults in FAULTS.items() for fault in faults])
def test_a_part_that_goes_wrong_ends_the_run(part: str, fault: str, tmp_path) -> None:
    """The log is whole up to there, on disk too; it names part and kind, and holds the traceback."""
    found = run(scenario.parse(values(part, fault)), seed=4, path=tmp_path / "trial.nc")
    assert found.attributes["status"] == "diverged"
    events = found.groups["event"]
    kinds, texts = events["kind"].tolist(), events["text"].tolist()
    text = texts[kinds.index("diverged")]
    name = f"{NAMES.get(part, part)} 'robustness.strangers:{MADE[part]}' of 'remus100' failed: "
    assert text.startswith(name)
    assert "\n" not in text
    trace = texts[kinds.index("traceback")]
    assert trace.startswith("Traceback (most recent call last):")
    # At the wrong time, and not before: up to a tick after it everything is there.
    times = found.groups["vehicles/remus100/truth"]["time"]
    assert times[-1] == pytest.approx(strangers.AFTER, abs=0.21)
    before = found.vehicle()["estimate"]["time"]
    assert before[-1] == pytest.approx(strangers.AFTER, abs=0.51)
    assert np.isfinite(found.vehicle()["truth"]["position"]).all()
    assert log.differences(log.read(tmp_path / "trial.nc"), found) == []


@pytest.mark.parametrize("fault", ["nan", "nothing", "none of these"])
def test_a_sensor_may_measure_nothing(fault: str) -> None:
    """A value that is NaN, and no reading at all, are not wrong."""
    assert run(scenario.parse(values("sensor", fault)), seed=4).attributes["status"] == "complete"


@pytest.mark.parametrize("part", ["estimator", "control", "mission"])
def test_a_part_that_does_as_it_should_changes_nothing(part: str) -> None:
    """The same truth as with the shipped one, bit for bit."""
    own = run(scenario.parse(values(part, "")), seed=4)
    shipped = run(scenario.parse({"duration": DURATION, "vehicle": {"start": {"range": 150.0}}}), seed=4)
    for name, truth in shipped.vehicle()["truth"].items():
        np.testing.assert_array_equal(own.vehicle()["truth"][name], truth)


@pytest.mark.parametrize(
    ("part", "made", "says"),
    [
        ("estimator", "nothing", "made a NoneType without update, reset, states"),
        ("estimator", "bare", "made a SimpleNamespace without update, reset"),
        ("estimator", "statesless", "states is {'north': 1}, not units by name"),
        ("estimator", "raising", "cannot be made: OSError: no such device"),
        ("estimator", "absent", "has no attribute 'absent'"),
        ("control", "bare", "made a SimpleNamespace without observe, command"),
        ("control", "raising", "cannot be made: OSError: no such device"),
        ("mission", "nothing", "made a NoneType without phases"),
        ("mission", "raising", "cannot be made: OSError: no such device"),
        ("sensor", "raising", "cannot be made: OSError: no such device"),
    ],
)
def test_a_part_that_cannot_be_made_is_refused(part: str, made: str, says: str) -> None:
    """Before anything runs."""
    with pytest.raises(InputError) as caught:
        run(scenario.parse(values(part, "", made)), seed=4)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_command_says_it_in_one_line_and_keeps_the_log(tmp_path, capsys) -> None:
    """Exit code 1, as of any run that diverged."""
    own = "--estimator.settings", "{fault: raises}", "--estimator.kind", "robustness.strangers:Estimator"
    assert main(["dock", "--no-video", "--duration", "14", *own, "--out", str(tmp_path)]) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith(
        "auvsim: estimator 'robustness.strangers:Estimator' of 'remus100' failed: ZeroDivisionError: of"
    )
    assert {path.name for path in tmp_path.iterdir()} == {"trial.nc", "summary.json"}


@pytest.mark.parametrize("name", ["../../../escape_here", "a/b", "..", ".hidden", "c:x", "a\\b", "", "x" * 200, "a\nb"])
def test_a_plans_name_is_no_path(tmp_path, monkeypatch, capsys, name: str) -> None:
    """Nothing is written, least of all elsewhere."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.yaml").write_text(f"name: {json.dumps(name)}\ntrials: 1\n")
    assert main(["campaign", "plan.yaml"]) == 2
    assert "plan.yaml:1: name: " in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["plan.yaml"]


@pytest.mark.parametrize("hides", ["estimators/__init__.py", "estimators.py", "estimators/core/__init__.py"])
def test_a_folder_that_hides_the_library_is_named(tmp_path, hides: str) -> None:
    """One line and exit code 2; a folder that is no package hides nothing."""
    path = tmp_path / hides
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("mine = True\n")
    places = f"{tmp_path}{os.pathsep}{Path(auvsim.__file__).parent.parent}"
    done = subprocess.run(
        [sys.executable, "-m", "auvsim", "scenario", "--default"],
        capture_output=True, text=True, cwd=tmp_path, env={**os.environ, "PYTHONPATH": places}, check=False,
    )  # fmt: skip
    if hides == "estimators/core/__init__.py":
        assert (done.returncode, done.stderr) == (0, "")
        return
    hidden = path if path.name == "estimators.py" else path.parent
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"is hidden by {hidden}; rename that" in done.stderr


def test_the_log_holds_the_text_of_its_models(tmp_path) -> None:
    """As it was when the run began, with its SHA-256, whatever becomes of the file."""
    path = spoiled(tmp_path, "vehicle", ('model="remus100"', 'model="mine"'))
    text = Path(path).read_text(encoding="utf-8")
    found = run(scenario.parse({"duration": 1.0, "vehicle": {"model": path}}), path=tmp_path / "trial.nc")
    Path(path).unlink()
    models = log.read(tmp_path / "trial.nc").groups["models"]
    assert models["kind"].tolist() == ["vehicle", "structure"]
    assert models["model"].tolist() == [path, "dock"]
    assert models["text"].tolist() == [text, model_files.source("structure", "dock")[1]]
    assert models["sha256"].tolist() == [hashlib.sha256(t.encode()).hexdigest() for t in models["text"]]
    assert found.vehicles == ("mine",)
