"""The X tail: rudder and stern plane are shared by four fins; with one lift slope it is the cross tail turned."""

import math
from pathlib import Path

import numpy as np
import pytest

from auvsim.physics import soundness
from auvsim.physics.hydrodynamics import bodies
from auvsim.physics.planar_fit import Level, fit_planar_model
from auvsim.vehicles import library, model_files

SPEED, DENSITY = 1.3, 1026.0


@pytest.fixture(scope="module")
def alike(tmp_path_factory) -> str:
    """The REMUS-100 with a lift slope of 0.6 of all its movable fins."""
    text = model_files.source("vehicle", "remus100")[1]
    for fin, slope in (("rudder", "0.5"), ("plane", "0.7")):
        assert f"{fin}_" in text
        for side in ("upper", "lower", "port", "starboard"):
            text = text.replace(
                f'name="{fin}_{side}_lift_slope" data="{slope}"', f'name="{fin}_{side}_lift_slope" data="0.6"'
            )
    path = Path(tmp_path_factory.mktemp("alike")) / "remus100.xml"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize("demand", [{"rudder": 0.06}, {"elevator": 0.05}, {"rudder": -0.04, "elevator": 0.03}])
def test_a_demand_turns_as_much_as_with_upright_fins(alike, demand):
    """To 0.3 %: a fin's drag is that of its own angle."""
    shaft = fit_planar_model("remus100", SPEED).shaft_speed
    x, cross = Level("remus100_x", DENSITY), Level(alike, DENSITY)
    found = [
        level.forces(SPEED, shaft_speed=shaft, **demand) - level.forces(SPEED, shaft_speed=shaft)
        for level in (x, cross)
    ]
    assert found[0][1:] == pytest.approx(found[1][1:], abs=3e-3 * np.abs(found[1][1:]).max())


def test_fins_share_what_is_asked_of_them():
    actuation = library.vehicle("remus100_x").actuation
    assert actuation.allocate(actuation.at_speed(50.0)._replace(rudder=0.1))[:4] == pytest.approx(
        [0.1 * math.sqrt(0.5)] * 4
    )
    together = actuation.at_speed(50.0)._replace(rudder=0.1, elevator=0.04)
    assert actuation.effective(actuation.allocate(together)) == pytest.approx(together)
    angles = np.abs(actuation.allocate(together)[:4])
    assert np.sort(angles) == pytest.approx(np.sort([0.14 * math.sqrt(0.5)] * 2 + [0.06 * math.sqrt(0.5)] * 2))


def test_beyond_the_limit_the_ratio_is_kept():
    actuation = library.vehicle("remus100_x").actuation
    found = actuation.effective(actuation.allocate(actuation.at_speed(0.0)._replace(rudder=0.3, elevator=0.15)))
    assert found.rudder / found.elevator == pytest.approx(2.0)
    assert (found.rudder + found.elevator) * math.sqrt(0.5) == pytest.approx(0.2618, rel=1e-6)


def test_it_is_sound_and_stable_as_the_cross_tail(alike):
    soundness.check("remus100_x", DENSITY)
    soundness.check_step("remus100_x", "implicitfast", 100.0, DENSITY)
    names = ("Y_uv", "Y_ur", "N_uv", "N_ur", "Y_dd", "N_dd", "X_uu")
    x, cross = (fit_planar_model(model, SPEED).parameters for model in ("remus100_x", alike))
    for name in names:
        assert getattr(x, name) == pytest.approx(getattr(cross, name), rel=0.01), name


def test_numbers_of_all_fins_stand_once_and_a_fin_may_differ():
    """`fin_area` is every fin's; one that gives its own has its own."""
    model = Level("remus100", DENSITY).model
    fins = [body for body in bodies(model) if body.kind == "fin"]
    assert len(fins) == 8
    assert {body.fields["area"].item() for body in fins} == {0.00665}
    assert {body.fields["lift_slope"].item() for body in fins} == {3.12, 0.5, 0.7}
    text = model_files.source("vehicle", "remus100")[1]
    assert text.count("_stall_angle") == 1


def test_a_fin_of_its_own_number(tmp_path):
    text = model_files.source("vehicle", "remus100")[1]
    own = text.replace(
        '<numeric name="propeller_diameter"',
        '<numeric name="plane_port_area" data="0.009"/><numeric name="propeller_diameter"',
    )
    path = tmp_path / "own.xml"
    path.write_text(own)
    found = {
        body.name: body.fields["area"].item() for body in bodies(Level(str(path), DENSITY).model) if body.kind == "fin"
    }
    assert found.pop("plane_port") == 0.009
    assert set(found.values()) == {0.00665}
