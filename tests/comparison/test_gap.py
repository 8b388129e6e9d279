"""The gap sheet: a changed drag is named, an unchanged vehicle gets the best grade, the lag of a servo is undone."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from auvsim.cli import main
from auvsim.comparison.simulation import _ahead
from auvsim.data import log as logs
from auvsim.simulation import scenario
from auvsim.simulation.run import run
from auvsim.simulation.sea_trials import PERIOD
from auvsim.vehicles import model_files


def sailed(path: Path, model: str, seed: int) -> None:
    """A multisine with steps of speed in a current."""
    steps = {"speed_steps": [1.2, 1.8, 1.5], "step_time": 25.0}
    settings = {"kind": "multisine", "duration": 110.0, "approach": 10.0, **steps}
    on = {"enabled": True}
    pinned = {
        "mission": {"kind": "manoeuvre", "manoeuvre": settings},
        "vehicle": {"model": model, "start": {"range": 150.0, "heading_deg": 70.0, "depth": 12.0}},
        "current": {"kind": "uniform", "speed": 0.15, "direction_deg": 100.0},
        "sensors": {"dvl": on, "gyro": on},
    }
    logs.write(run(scenario.parse(pinned), seed=seed), path)


@pytest.mark.parametrize(("factor", "grade"), [(1.0, "A"), (1.5, "C")])
def test_changed_drag_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str], factor: float, grade: str):
    """Half as much again of the hull's axial drag names X_uu; the same vehicle has the best grade and no name."""
    folder = tmp_path / "own"
    shutil.copytree(model_files.models_folder() / "remus100", folder)
    model = folder / "remus100.xml"
    text, drag = model.read_text(), 'hull_quadratic_damping" data="5.84 '
    assert drag in text
    model.write_text(text.replace(drag, f'hull_quadratic_damping" data="{5.84 * factor} '))
    sailed(tmp_path / "trial.nc", str(model), 6)
    out = tmp_path / "out"
    assert main(["compare", str(tmp_path / "trial.nc"), "--vehicle", "remus100", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"grade {grade}")
    # Three speeds hardly tell drag from thrust and its loss with speed: X_uu is named, at first or as one of these.
    assert ("X_uu" in said.splitlines()[0]) == (factor > 1.0)
    assert not any(f"{axis}_" in said.splitlines()[0] for axis in "YN")
    assert ("no one coefficient" in said) == (factor == 1.0)
    assert (out / "gap.png").stat().st_size > 20_000
    assert "<svg" in (out / "gap.html").read_text()


def test_lag_is_undone():
    """The commands that a first-order servo turns into given angles, by its exact response to held commands."""
    wanted = np.sin(np.arange(60) * 0.2)
    angle, found = wanted[0], []
    for command in _ahead(wanted, 0.3):
        found.append(angle)
        angle += (command - angle) * (1.0 - math.exp(-PERIOD / 0.3))
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """One line and exit code 2."""
    rows = "".join(f"{0.1 * k:.1f},0.1,60,0.2\n" for k in range(200))
    (tmp_path / "short.csv").write_text("time [s],rudder [rad],shaft_speed [rad/s],heading [rad]\n" + rows)
    for arguments, part in (
        ((str(tmp_path / "none.nc"), "--vehicle", "remus100"), "none.nc"),
        ((str(tmp_path / "short.csv"), "--vehicle", "nobody"), "nobody"),
        ((str(tmp_path / "short.csv"), "--vehicle", "remus100"), "the comparison needs 40 s"),
    ):
        assert main(["compare", *arguments, "--out", str(tmp_path / "out")]) == 2
        assert part in capsys.readouterr().err.strip().splitlines()[-1]
