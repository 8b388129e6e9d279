"""`auvsim manoeuvre`: what it leaves on disk, what it prints, how it fails."""

import json
from pathlib import Path

import pytest

from auvsim import cli
from auvsim.analysis.summary import summarise
from auvsim.data import log
from auvsim.missions.manoeuvres import metrics as manoeuvre_metrics

SHORT = ("--manoeuvre.duration", "60")


def manoeuvre(out: Path, *arguments: object) -> int:
    """Runs `auvsim manoeuvre` into a folder."""
    return cli.main(["manoeuvre", *map(str, arguments), "--out", str(out)])


def files(folder: Path) -> set[str]:
    """Names in a folder."""
    return {path.name for path in folder.iterdir()}


def test_several_manoeuvres_in_one_call(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A log and a picture each, one table; metrics and plot make theirs again from a log."""
    assert manoeuvre(tmp_path, "zigzag", "circle", "--seed", 3, *SHORT) == 0
    assert files(tmp_path) == {"zigzag.nc", "zigzag.png", "circle.nc", "circle.png"}
    table = capsys.readouterr().out
    assert all(text in table for text in ("zigzag", "circle", "first overshoot [deg]", "advance [m]"))
    read = log.read(tmp_path / "zigzag.nc")
    assert read.attributes["status"] == "complete"
    assert read.vehicle()["truth"]["time"][-1] == pytest.approx(60.0, abs=1e-9)
    (tmp_path / "circle.png").unlink()
    assert cli.main(["plot", str(tmp_path / "circle.nc")]) == 0
    assert cli.main(["metrics", str(tmp_path / "zigzag.nc")]) == 0
    assert files(tmp_path) == {"zigzag.nc", "zigzag.png", "circle.nc", "circle.png", "summary.json"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary == summarise(read.vehicle())
    assert summary["manoeuvres"][0]["first_overshoot_deg"] > 0.0


def test_an_optimal_manoeuvre_is_designed_and_run(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A table of what it and the standard manoeuvres tell, then the trial, which on MuJoCo too stays in its room."""
    arguments = ("--manoeuvre.duration", 45, "--manoeuvre.approach", 10, "--manoeuvre.room", 60, "--seed", 4)
    assert manoeuvre(tmp_path, "optimal", *arguments) == 0
    assert files(tmp_path) == {"optimal.nc", "optimal.png"}
    table = capsys.readouterr().out
    assert all(text in table for text in ("log det", "N_uv", "largest rudder [deg]"))
    trial = log.read(tmp_path / "optimal.nc").vehicle()
    (figures,) = manoeuvre_metrics.figures(trial)
    assert figures.kind == "optimal"
    room = figures.numbers["room"]
    assert room is not None
    assert room < 63.0  # the planar model's turns are some per cent off
    told = [text for text in trial["event"]["text"].tolist() if "too old" not in text]  # before the first fix
    assert told == ["optimal: approach", "optimal"]


def test_a_file_pins_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keys of the same manoeuvre hold, one of another kind is left aside; options come last."""
    from auvsim.cli import manoeuvre as command

    path = tmp_path / "mine.yaml"
    path.write_text("current: {kind: none}\nmanoeuvre: {kind: zigzag, heading_deg: 15.0, rudder_deg: 5.0}\n")
    plans = command.plans(["zigzag", str(path), "circle"], {"manoeuvre": {"approach": 5.0}}, seed=0, trial=0)
    zigzag, circle = (plans[kind].lone[1].mission.manoeuvre for kind in ("zigzag", "circle"))
    assert zigzag.model_dump() | {"heading_deg": 15.0, "rudder_deg": 5.0, "approach": 5.0} == zigzag.model_dump()
    assert (circle.kind, circle.duration) == ("circle", 300.0)
    assert plans["circle"].water.current.kind == "none"
    sensors = plans["zigzag"].lone[1].sensors
    assert sensors.dvl.enabled
    assert sensors.gyro.enabled


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ("zigzag --manoeuvre.rudder_deg 20", "manoeuvre zigzag: rudder 20 deg is beyond the fins' 15 deg"),
        ("multisine --manoeuvre.highest 6", "highest 6 Hz must be below half the control rate, 5 Hz"),
        ("zigzag --manoeuvre.duration 0", "manoeuvre.duration: 0 should be greater than 0"),
        ("zigzig", "no manoeuvre 'zigzig'; there are circle, "),
        ("zigzag optimal --manoeuvre.speed 3", "speed is 3 m/s, it must be from 1 to 1.8 m/s"),
        ("optimal --manoeuvre.rudder_deg 20", "manoeuvre optimal: rudder 20 deg is beyond the fins' 15 deg"),
        ("optimal --manoeuvre.fastest 4", "the shaft of 'remus100' cannot hold 4 m/s"),
        ("optimal --manoeuvre.room 3 --manoeuvre.duration 30", "nothing was found that stays within a room of 3 m"),
        ("zigzag zigzag", "zigzag is given more than once"),
        ("circle --manoeuvre.speed 5", "the shaft of 'remus100' cannot hold 5 m/s"),
        ("zigzag --manoeuvre.kind prbs", "--manoeuvre.kind prbs contradicts the manoeuvre zigzag"),
        ("a.yaml", "no manoeuvre; there are straight, "),
        ("circle a.yaml b.yaml", "2 scenario files; give one at most"),
        ("table", "manoeuvre.points: not given"),
        ("prbs multisine --manoeuvre.rudder_deg 18", "rudder 18 deg is beyond"),  # before the first runs
        ("zigzag circle --manoeuvre.heading_deg 20", "manoeuvre.heading_deg: unknown key"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    arguments: str, text: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Exit code 2, what is wrong, no folder."""
    assert manoeuvre(tmp_path / "out", *arguments.split()) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_dock_refuses_a_manoeuvre(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """It says which command is meant."""
    assert cli.main(["dock", "--manoeuvre.kind", "zigzag", "--out", str(tmp_path / "out")]) == 2
    assert "run it with `auvsim manoeuvre zigzag`" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_divergence_is_diagnosed(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A physics step of half a second diverges: exit code 1, the log up to there, no picture."""
    monkeypatch.setattr("auvsim.simulation.run.check_steps", lambda scenario: None)  # would refuse it
    names = ("compass", "depth", "feedback", "dvl", "gyro")
    sensors = [part for name in names for part in (f"--sensors.{name}.rate", "2")]
    assert manoeuvre(tmp_path, "circle", "--rates.physics", 2, "--rates.control", 2, "--rates.log", 2, *sensors) == 1
    assert files(tmp_path) == {"circle.nc"}
    assert capsys.readouterr().err.startswith("auvsim: diverged at ")
