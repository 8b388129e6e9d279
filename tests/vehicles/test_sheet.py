"""A vehicle from a data sheet: its estimates against the REMUS-100's numbers, and that it does what the sheet says."""

import math
from pathlib import Path

import numpy as np
import pytest

from auvsim.base import yaml_text
from auvsim.cli import main
from auvsim.physics import hydrodynamics, soundness
from auvsim.physics.planar_fit import Level
from auvsim.simulation import sea_trials
from auvsim.vehicles import estimates, from_sheet, sheet

REMUS = {
    "name": "mine", "length": 1.6, "diameter": 0.19, "mass": 31.0, "top_speed": 2.3, "shaft_rpm": 1525.0,
    "centre_of_gravity": 0.02, "fins": {"span": 0.086, "chord": 0.077, "place": 0.69},
}  # fmt: skip


def written(folder: Path, **changes) -> Path:
    values = REMUS | changes
    path = folder / "sheet.yaml"
    path.write_text(yaml_text.dump({k: v for k, v in values.items() if v is not None}))
    return path


def model(folder: Path, **changes) -> str:
    made = sheet.read(written(folder, **changes))
    path = folder / "mine.xml"
    path.write_text(from_sheet.mjcf(made))
    return str(path)


def test_estimates_are_near_the_published_numbers():
    """Of the REMUS-100 (its README): Lamb's exactly, the lift of fins to 1 %, of the hull to 10 %.

    Its drag is 2.8 times what a bare hull has: the sheet's own is to be given where it is known.
    """
    found = estimates.estimate(sheet.Sheet.model_validate(REMUS))
    assert found.added_mass == pytest.approx((0.839, 29.44), rel=0.01)
    assert found.added_inertia == pytest.approx(3.426, rel=0.01)
    assert found.inertia == pytest.approx((0.112, 4.03), rel=0.01)
    assert found.fin_slope == pytest.approx(3.12, rel=0.01)
    assert found.body_lift == pytest.approx(28.6, rel=0.1)
    assert 0.3 < found.surge_drag / 5.84 < 0.5


def test_lambs_factors_of_a_sphere_and_a_needle():
    """1/2 and 1/2 and none of a sphere; 0, 1 and 1 of a needle."""
    assert estimates.lamb(1.0, 0.999)[:2] == pytest.approx((0.5, 0.5), abs=1e-3)
    assert estimates.lamb(1.0, 0.002) == pytest.approx((0.0, 1.0, 1.0), abs=1e-3)


@pytest.mark.parametrize("tail", ["cross", "x"])
def test_it_runs_at_the_sheets_speed_and_steers_as_it_is_told(tmp_path, tail):
    path = model(tmp_path, fins=REMUS["fins"] | {"tail": tail}, buoyancy=4.0)
    soundness.check(path, hydrodynamics.SEA_WATER)
    soundness.check_step(path, "implicitfast", 100.0, hydrodynamics.SEA_WATER)
    level = Level(path, hydrodynamics.SEA_WATER)
    assert sea_trials.straight_speed(level, 1525.0 * math.pi / 30.0) == pytest.approx(2.3, rel=2e-3)
    assert level.mass == pytest.approx(31.0)
    assert level.x_g == pytest.approx(0.0, abs=1e-5)
    assert 9.81 * (1026.0 * level.volume - level.mass) == pytest.approx(4.0, abs=0.01)
    level.data.qpos[:] = level.model.qpos0
    assert level.inertia[2, 2] == pytest.approx(4.03 + 3.426, rel=0.01)
    # Two upright fins at 0.69 m, slope 3.13, whatever the tail.
    straight = level.forces(1.0, shaft_speed=60.0)
    turned = level.forces(1.0, rudder=0.02, shaft_speed=60.0) - straight
    assert turned[5] == pytest.approx(1026.0 * 0.086 * 0.077 * 3.13 * 0.69 * 0.02, rel=0.02)
    dived = level.forces(1.0, elevator=0.02, shaft_speed=60.0) - straight
    assert dived[4] == pytest.approx(-turned[5], rel=0.01)


@pytest.mark.parametrize(("given", "diameter"), [(None, None), (0.16, 0.16)])
def test_the_screw_drives_the_given_drag(tmp_path, given, diameter):
    """12 N at 2.3 m/s, by a screw of the sheet's size or of one that is found."""
    path = model(tmp_path, drag=12.0, propeller_diameter=given)
    level = Level(path, hydrodynamics.SEA_WATER)
    assert sea_trials.straight_speed(level, 1525.0 * math.pi / 30.0) == pytest.approx(2.3, rel=2e-3)
    found = estimates.estimate(sheet.read(written(tmp_path, drag=12.0, propeller_diameter=given)))
    assert found.surge_drag * 2.3**2 + 4 * 0.5 * 1026.0 * found.fin_area * 0.01 * 2.3**2 == pytest.approx(12.0)
    assert diameter is None or found.propeller_diameter == diameter


def test_every_estimate_is_marked():
    made = sheet.Sheet.model_validate(REMUS)
    sources = {number.name: number.source for number in from_sheet.numbers(made)}
    given = {
        "length, diameter",
        "mass, net buoyancy",
        "centre of gravity below the axis",
        "area of a fin",
        "shaft limit",
    }
    assert all(sources[name] == "sheet" for name in given)
    rest = {name for name, source in sources.items() if source.startswith(("estimate: ", "assumed"))}
    assert {"added mass along, across", "lift slope of a fin", "surge drag X_uu", "propeller diameter"} <= rest
    assert all(f"| {name} |" in from_sheet.readme(made) for name in sources)
    assert (
        sheet.Sheet.model_validate(yaml_text.read(from_sheet.readme(made).split("```yaml\n")[1][:-4], "x").value)
        == made
    )


def test_its_autopilot_settles(tmp_path):
    """Without the swing that the default gains give: in a dive of 5 m, pitch is still at its end."""
    made = sheet.Sheet.model_validate(REMUS)
    path = tmp_path / "mine.xml"
    path.write_text(from_sheet.mjcf(made))
    ranges = []
    for text in ("", from_sheet.controller(made)):
        (tmp_path / "controller.yaml").write_text(text or "{}")
        ranges.append(np.ptp(sea_trials.run(str(path)).dive_series[-200:, 2]))
    assert ranges[1] < math.radians(0.1)
    assert ranges[0] > math.radians(3.0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"mass": 300.0}, "mass: 300 kg does not float in a hull of 1.6 x 0.19 m; give 25.6 to 46.5 kg"),
        ({"length": -1.0}, "length: -1.0 should be greater than 0 (of the hull [m])"),
        ({"diameter": 1.0}, "diameter: the hull is 1.6 times as long as wide; estimates hold for 3 to 20"),
        ({"fins": REMUS["fins"] | {"place": 0.9}}, "fins.place: 0.9 m is behind the hull's end at 0.8 m"),
        ({"buoyancy": 90.0}, "buoyancy: 90 N is more than 5 % of the weight"),
        ({"shaft_rpm": 60.0}, "shaft_rpm: no propeller up to twice the hull's diameter drives 2.3 m/s at 60 rpm"),
        ({"propeller_diameter": 0.03}, "propeller_diameter: a screw of 0.03 m at 1525 rpm does not drive 2.3 m/s"),
        ({"drag": 0.3}, "drag: 0.3 N at 2.3 m/s is less than that of the fins alone"),
        ({"fins": REMUS["fins"] | {"place": 0.3}}, "fins.place: 0.3 m is no place of tail fins"),
        ({"fins": REMUS["fins"] | {"span": 0.4}}, "fins.span: 0.4 m is more than 2 times the hull's diameter"),
        ({"fins": REMUS["fins"] | {"chord": 1e-3}}, "fins.chord: the span is 86 times the chord of 0.001 m"),
        ({"propeller_diameter": 0.5}, "propeller_diameter: 0.5 m is more than 2 times the hull's diameter"),
        ({"top_speed": 1e-6}, "should be greater than or equal to 0.1 (through the water"),
        ({"displacement": 4.0}, "displacement"),
        ({"mass": None}, "mass"),
    ],
)
def test_a_bad_sheet_is_one_line(tmp_path, capsys, changes, said):
    assert main(["vehicle", "--from", str(written(tmp_path, **changes)), "--out", str(tmp_path / "new")]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert text.startswith(f"auvsim: {tmp_path / 'sheet.yaml'}:")
    assert said in text
    assert not (tmp_path / "new").exists()


def test_an_empty_sheet_is_named_as_such(tmp_path, capsys):
    (tmp_path / "sheet.yaml").write_text("")
    assert main(["vehicle", "--from", str(tmp_path / "sheet.yaml"), "--out", str(tmp_path / "new")]) == 2
    assert "a data sheet is a mapping of keys to values" in capsys.readouterr().err
