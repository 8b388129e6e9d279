"""The command line with real trials: what is left on disk, and the same bits from the same seed."""

import json
import signal
from pathlib import Path

import pytest

from auvsim import cli
from auvsim.cli import products, report
from auvsim.data import log

SHORT = ("--no-video", "--duration", "30")


def files(folder: Path) -> set[str]:
    """Names in a folder."""
    return {path.name for path in folder.iterdir()}


def dock(out: Path, *arguments: object) -> int:
    """Runs `auvsim dock` into a folder."""
    return cli.main(["dock", "--out", str(out), *map(str, arguments)])


def test_same_seed_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A trial replays; so does one from the definite scenario that the first one's log holds."""
    assert dock(tmp_path / "a", "--seed", 4, *SHORT) == 0
    assert files(tmp_path / "a") == {"trial.nc", "summary.json", "track.png", "estimates.png"}
    first = log.read(tmp_path / "a" / "trial.nc")
    monkeypatch.setattr(products, "plots", lambda *arguments: None)  # seen once; they take longer than the trial
    (tmp_path / "definite.yaml").write_text(str(first.attributes["scenario"]))
    assert dock(tmp_path / "b", "--seed", 4, *SHORT) == 0
    assert dock(tmp_path / "c", "--seed", 4, "--no-video", tmp_path / "definite.yaml") == 0
    assert dock(tmp_path / "d", "--seed", 5, *SHORT) == 0
    assert log.differences(first, log.read(tmp_path / "b" / "trial.nc")) == []
    assert log.differences(first, log.read(tmp_path / "c" / "trial.nc")) == []
    assert "vehicles/remus100/truth/position" in log.differences(first, log.read(tmp_path / "d" / "trial.nc"))


def test_summary_again_from_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`auvsim metrics` writes what the trial wrote."""
    monkeypatch.setattr(products, "plots", lambda *arguments: None)
    assert dock(tmp_path, *SHORT) == 0
    summary = tmp_path / "summary.json"
    before = summary.read_text()
    summary.unlink()
    assert cli.main(["metrics", str(tmp_path / "trial.nc")]) == 0
    assert summary.read_text() == before
    assert json.loads(before)["failure_reason"] == "timeout"


def test_ctrl_c_keeps_the_log_up_to_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A real signal in the middle of a trial: 130, one whole file."""
    monkeypatch.setattr(
        report.TrialProgress, "__call__", lambda self, state: state.time > 10.0 and signal.raise_signal(signal.SIGINT)
    )
    assert dock(tmp_path, "--no-video", "--duration", "60") == 130
    assert files(tmp_path) == {"trial.nc"}
    partial = log.read(tmp_path / "trial.nc")
    assert partial.attributes["status"] == "interrupted"
    assert partial.vehicle()["truth"]["time"][-1] == pytest.approx(12.0, abs=1e-9)  # progress comes every 6 s


def test_divergence_is_diagnosed(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A physics step of half a second is beyond any stability limit: 1, what diverged and what to do, the log."""
    monkeypatch.setattr("auvsim.simulation.run.check_steps", lambda scenario: None)  # would refuse it
    sensors = [part for name in ("compass", "depth", "feedback") for part in (f"--sensors.{name}.rate", "2")]
    rates = ["--rates.physics", "2", "--rates.control", "2", "--rates.log", "2", *sensors]
    assert dock(tmp_path, *rates) == 1
    assert files(tmp_path) == {"trial.nc", "summary.json"}
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("auvsim: diverged at ")
    assert "raise rates.physics above 2 Hz" in error
    assert log.read(tmp_path / "trial.nc").attributes["status"] == "diverged"
    assert json.loads((tmp_path / "summary.json").read_text())["failure_reason"] == "diverged"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--vehicle.model", "remus"], "command line: vehicle.model: no vehicle 'remus'; there are "),
        (["--vehicle.model", "broken.xml"], "command line: vehicle.model: model broken.xml: "),
        (["--vehicle.model", "none.xml"], "command line: vehicle.model: model none.xml: "),
        (["--dock.model", "remus100"], "command line: dock.model: model remus100 lacks "),
        (
            ["--estimator", "kalman"],
            "command line: estimator: no kind 'kalman'; there are robust, augmented_ekf, ukf, imm",
        ),
        (
            ["--estimator", "nowhere:factory"],
            "command line: estimator: estimator 'nowhere:factory': ModuleNotFoundError",
        ),
        (
            ["--vehicle.start.depth", "100"],
            "command line: vehicle.start.depth: 100 m is not between the surface and the",
        ),
    ],
)
def test_what_cannot_be_loaded_is_named(
    arguments: list[str], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Exit code 2, one line, no folder left."""
    monkeypatch.chdir(tmp_path)
    Path("broken.xml").write_text("<mujoco><broken")
    assert dock(Path("out"), *arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"auvsim: {text}")
    assert error.count("\n") == 1
    assert files(tmp_path) == {"broken.xml"}


ESTIMATOR = """
from dataclasses import replace

from auvsim.navigation import docking
from auvsim.navigation.settings import AugmentedSettings

calls = []

class Counting:
    def __init__(self, inner):
        self.inner, self.states = inner, inner.states
    def update(self, time, readings, messages, commands):
        calls.append(time)
        return self.inner.update(time, readings, messages, commands)
    def reset(self):
        self.inner.reset()

def factory(setup):
    return Counting(docking.augmented_ekf(replace(setup, settings=AugmentedSettings())))
"""


def test_estimator_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--estimator package.module:factory` navigates the trial, at the filter's rate, and the log says so."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(products, "plots", lambda *arguments: None)
    monkeypatch.syspath_prepend(tmp_path)
    Path("counting_estimator.py").write_text(ESTIMATOR)
    assert dock(Path("out"), "--estimator", "counting_estimator:factory", *SHORT) == 0
    import counting_estimator  # pyright: ignore[reportMissingImports]

    own = log.read("out/trial.nc").vehicle()
    assert counting_estimator.calls == own["estimate"]["time"].tolist()
    assert len(counting_estimator.calls) == 60  # 30 s at 2 Hz
    assert "kind: counting_estimator:factory" in str(own.log.attributes["scenario"])
