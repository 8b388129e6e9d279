"""The gap sheet: a change is named, an unchanged vehicle gets the best grade, the lag of a servo is undone."""

import math
import re
from dataclasses import replace
from pathlib import Path

import gap_study
import numpy as np
import pytest

from auvsim.cli import main
from auvsim.comparison import gap
from auvsim.comparison.simulation import _ahead, in_planar
from auvsim.identification.records import Record
from auvsim.physics import planar_sets
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.simulation.sea_trials import PERIOD


def compared(folder: Path, change: str, factor: float) -> int:
    """The command on the log of a changed vehicle, against the unchanged model."""
    model = gap_study.changed(folder, change, factor)
    gap_study.sailed(folder / "trial.nc", str(model), 6)
    return main(["compare", str(folder / "trial.nc"), "--vehicle", "remus100", "--out", str(folder / "out")])


@pytest.mark.parametrize(
    ("change", "factor", "grade", "named"),
    [
        ("equal", 1.0, "A", ""),
        ("lift", 0.7, "A", "Y_uv"),
        pytest.param("drag", 1.5, "C", "X_uu", marks=pytest.mark.slow),
        pytest.param("rudder", 0.7, "", "N_dd", marks=pytest.mark.slow),
    ],
)
def test_a_change_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: str, factor: float, grade: str, named: str
):
    """The same vehicle has the best grade and no name; a change is named, at first or as one of those alike.

    No change beyond one that makes a coefficient vanish or double is listed, and each has an interval about it.
    """
    assert compared(tmp_path, change, factor) == 0
    said = capsys.readouterr().out
    first = said.splitlines()[0]
    assert first.startswith(f"grade {grade}")
    assert named in first
    assert ("this log hides changes of" in first) == (not named)
    assert re.search(r"none of .*Y_vv, .* by up to 100 %", said)  # a multisine of 2 cm/s of sway shows no cross-flow
    if named:
        other = "YN" if named.startswith("X") else "X"
        assert not any(f"{axis}_" in first.split("explains")[0] for axis in other)
    changes = [float(text) for text in re.findall(r"^ *[XYN]_\w+ .*?([+-][0-9.]+)%", said, re.MULTILINE)]
    assert changes
    assert all(abs(one) <= 100.0 for one in changes)
    assert (tmp_path / "out" / "gap.png").stat().st_size > 20_000
    assert "<svg" in (tmp_path / "out" / "gap.html").read_text()


def test_a_planar_model_beside(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """The planar model condensed from the vehicle errs about as MuJoCo does; one with 1.5 times its drag far more."""
    gap_study.sailed(tmp_path / "trial.nc", "remus100", 6)
    errors = {}
    base = fit_planar_model("remus100", 1.5).parameters
    for name, parameters in (("own", base), ("dragged", replace(base, X_uu=1.5 * base.X_uu))):
        path = tmp_path / f"{name}.yaml"
        kept = planar_sets.PlanarSet(
            vehicle="remus100", speed=1.5, method="condensed", start="none", version="0", sources=(),
            parameters=planar_sets.coefficients(parameters, {}),
        )  # fmt: skip
        planar_sets.write(kept, path)
        beside = ["compare", str(tmp_path / "trial.nc"), "--vehicle", "remus100", "--parameters", str(path)]
        assert main([*beside, "--out", str(tmp_path / "out")]) == 0
        row = next(line for line in capsys.readouterr().out.splitlines() if line.strip().startswith("60 s"))
        errors[name] = [float(cell) for cell in re.findall(r"([0-9.]+)%", row)]
    assert errors["own"][0] == errors["dragged"][0]
    assert errors["own"][1] < 3.0
    assert errors["dragged"][1] > 4.0
    assert main(["compare", str(tmp_path / "trial.nc"), "--vehicle", "remus100", "--parameters", "none.yaml"]) == 2
    assert "none.yaml" in capsys.readouterr().err


def test_what_a_log_hides():
    """A change of the size that is told moves this log by its floor; one that does nothing is hidden whatever it is."""
    condensed = replace(fit_planar_model("remus100", 1.5).parameters, Y_rr=-1e-6)
    times = 0.1 * np.arange(900)
    inputs = np.column_stack([0.15 * np.sin(0.5 * times), np.full(900, 130.0)])
    record = Record(name="r", times=times, inputs=inputs, measured=np.zeros((900, 8)), deviations=np.ones(8))
    walked = in_planar(condensed, record, 1.5)
    measured = np.column_stack([np.zeros((900, 3)), walked, np.zeros((900, 6))])
    beside = gap.Beside(record=record, measured=measured, simulated=walked)
    found = gap.visible([beside], condensed)
    for name in ("N_dd", "N_ur", "X_uu"):
        moved = gap._made(beside, condensed, name, found[name])
        assert np.sqrt(np.mean((moved / gap.FLOOR) ** 2, axis=0)).max() == pytest.approx(1.0, rel=0.15)  # not linear
    assert found["Y_rr"] > 100.0
    assert found["X_uu"] < found["N_dd"] < 0.5


def test_constant_errors_of_sensors_are_no_change():
    """A log turned by a degree and a gyro's bias leave nothing; what goes with anything else stays."""
    n = 400
    times = 0.1 * np.arange(n)
    measured = np.zeros((n, 12))
    measured[:, 3] = 1.5 + 0.3 * np.sin(times)
    record = Record(name="r", times=times, inputs=np.zeros((n, 2)), measured=np.zeros((n, 8)), deviations=np.ones(8))
    beside = gap.Beside(record=record, measured=measured, simulated=np.zeros((n, 3)))
    faulty = np.column_stack([0.02 * np.ones(n), 0.017 * measured[:, 3], 0.005 * np.ones(n)])[beside.first :]
    left = gap.cleared(beside, faulty)
    np.testing.assert_allclose(left[:, 1:], 0.0, atol=1e-12)
    np.testing.assert_array_equal(left[:, 0], faulty[:, 0])
    swinging = faulty + np.column_stack([0.0 * times, np.cos(3.0 * times), np.cos(3.0 * times)])[beside.first :]
    assert np.std(gap.cleared(beside, swinging)[:, 1:], axis=0).min() > 0.65


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


def test_a_shaft_in_another_unit_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """A shaft at a million times its speed is no divergence of the simulation but one line on units."""
    times = 0.2 * np.arange(400)
    columns = (times, 10.0 * np.sin(0.3 * times), 1e8 + 1e4 * times, 5.0 * np.sin(0.2 * times), 1.0 + 0.0 * times)
    rows = [",".join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)]
    lines = ["time [s],rudder [deg],n [rpm],heading [deg],surge [m/s]", *rows]
    (tmp_path / "fast.csv").write_text("\n".join(lines) + "\n")
    assert main(["compare", str(tmp_path / "fast.csv"), "--vehicle", "remus100", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert "has its shaft at 1.06e+07 rad/s: see the units" in said[-1]
