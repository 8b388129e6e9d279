"""`auvsim estimate`: tables and files of a trial and of a table of one's own; damaged files in one line."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from auvsim.cli import main
from auvsim.data import log as logs
from auvsim.simulation import scenario
from auvsim.simulation.run import run


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With the log of a minute before the dock, a table, and damaged ones."""
    path = tmp_path_factory.mktemp("estimate")
    start = {"range": 120.0, "bearing_deg": 30.0, "heading_deg": 60.0}
    logs.write(run(scenario.parse({"duration": 60.0, "vehicle": {"start": start}}), seed=2), path / "trial.nc")
    noise = np.random.default_rng(5)
    with (path / "own.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time [s]", "heading [deg]", "dvl_u [m/s]", "dvl_v [m/s]", "north [m]", "east [m]"])
        for k in range(600):
            fix = [0.13 * k + noise.normal(), 0.075 * k + noise.normal()] if k % 50 == 0 else ["", ""]
            writer.writerow([0.1 * k, 30.0 + noise.normal(), 1.5 + 0.01 * noise.normal(), 0.01 * noise.normal(), *fix])
    (path / "cut.nc").write_bytes((path / "trial.nc").read_bytes()[:20_000])
    (path / "text.csv").write_text("time [s],heading [deg]\n0,1\n1\n")
    return path


def test_estimators_side_by_side_on_a_trial(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """One table, one page, a log for each estimator; the trial's own is what it was."""
    out = tmp_path / "out"
    arguments = ["estimate", str(folder / "trial.nc"), "--estimator", "robust", "paper", "--out", str(out)]
    assert main(arguments) == 0
    shown = capsys.readouterr().out
    assert "NEES/dof" in shown
    assert "usbl" in shown
    assert sorted(path.name for path in out.iterdir()) == [
        "estimators.csv", "trial.paper.nc", "trial.png", "trial.robust.nc",
    ]  # fmt: skip
    assert logs.differences(logs.read(folder / "trial.nc"), logs.read(out / "trial.robust.nc")) == []
    with (out / "estimators.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["estimator"] for row in rows} == {"robust", "paper"}
    assert all(float(row["position_rms_m"]) > 0.0 for row in rows)


def test_what_if_changes_the_trial(folder: Path, capsys: pytest.CaptureFixture[str]):
    """With all packets lost nothing starts; with outliers alone some are refused."""
    assert main(["estimate", str(folder / "trial.nc"), "--drop", "100%"]) == 0
    assert "usbl" not in capsys.readouterr().out
    assert main(["estimate", str(folder / "trial.nc"), "--outliers", "30%", "--delay", "+3", "--seed", "3"]) == 0
    assert "usbl" in capsys.readouterr().out


def test_a_table_of_ones_own(folder: Path, tmp_path: Path):
    """Estimates with their deviations as CSV; the last lies within four of them of where the vehicle is."""
    assert main(["estimate", str(folder / "own.csv"), "--smooth", "--out", str(tmp_path)]) == 0
    for name in ("own.csv.dead_reckoning.csv", "own.csv.dead_reckoning.smoothed.csv"):
        with (tmp_path / name).open() as file:
            last = list(csv.DictReader(file))[-1]
        t = float(last["time [s]"])
        for axis, speed in (("north", 1.3), ("east", 0.75)):
            error = float(last[f"{axis} [m]"]) - speed * t
            assert abs(error) < 4.0 * float(last[f"{axis} sd [m]"])
        assert math.degrees(float(last["heading [rad]"])) == pytest.approx(30.0, abs=4.0)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["cut.nc"], "cut.nc: not a whole"),
        (["text.csv"], "text.csv: row 3 has 1 values"),
        (["nowhere.csv"], "nowhere.csv: cannot be read"),
        (["trial.nc", "--estimator", "ekf"], "no estimator 'ekf'"),
        (["trial.nc", "--drop", "most"], "--drop most: give a share such as 40% or 0.4"),
        (["trial.nc", "--drop", "140%"], "--drop 140%: give a share"),
        (["trial.nc", "--delay", "-5"], "delay"),
        (["trial.nc", "--drop", "10%", "--sensors", "sonar"], "no readings of 'sonar'"),
        (["trial.nc", "--estimator", "paper", "--smooth"], "cannot be smoothed"),
        (["own.csv", "--estimator", "augmented_ekf"], "needs the place of a dock"),
    ],
)
def test_what_is_wrong_is_one_line(
    folder: Path, arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    first, *rest = arguments
    assert main(["estimate", str(folder / first), *rest, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
