"""A vehicle's own controller settings lie between the defaults and what a scenario gives."""

import pytest

from auvsim.base.errors import InputError
from auvsim.campaign import plan
from auvsim.control.torpedo import AutopilotSettings
from auvsim.simulation import controllers, loading
from auvsim.vehicles import model_files

LAUV = {"vehicle": {"model": "lauv"}}


def test_they_replace_defaults_and_give_way_to_a_scenario():
    control = loading.load_scenario(**LAUV).lone[1].control
    assert control == AutopilotSettings(heading_gain=0.7, yaw_rate_gain=0.5, pitch_gain=1.0, pitch_rate_gain=0.5)
    pinned = loading.load_scenario(**LAUV, control={"heading_gain": 1.1}).lone[1].control
    assert (pinned.heading_gain, pinned.yaw_rate_gain) == (1.1, 0.5)
    assert loading.load_scenario().lone[1].control == AutopilotSettings()


def test_a_file_that_gives_gains_keeps_them_when_the_model_is_an_option(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("control: {pitch_gain: 9.0}\n")
    control = loading.load_scenario(path, **LAUV).lone[1].control
    assert (control.pitch_gain, control.heading_gain) == (9.0, 0.7)


def test_each_vehicle_in_full_has_its_own():
    start = {"north": 0.0, "east": 0.0}
    vehicles = {name: {"model": name, "start": start} for name in ("lauv", "remus100", "bluerov2_heavy")}
    found = controllers.in_full({"vehicles": vehicles})["vehicles"]
    assert found["lauv"]["control"]["heading_gain"] == 0.7
    assert found["remus100"]["control"] == AutopilotSettings().model_dump(mode="json")
    assert found["bluerov2_heavy"]["control"] == {"kind": "hovering"}


def test_a_variant_of_another_vehicle_has_that_vehicles():
    made = plan.parse(
        {"seed": 1, "trials": 2, "base": LAUV, "variants": {"a": {}, "b": {"vehicle": {"model": "remus100"}}}}
    )
    gains = [made.values(variant, 0)["control"]["heading_gain"] for variant in ("a", "b")]
    assert gains == [0.7, AutopilotSettings().heading_gain]


def test_a_users_own_file_stands_beside_the_model(tmp_path):
    (tmp_path / "mine.xml").write_text(model_files.source("vehicle", "remus100")[1])
    (tmp_path / "controller.yaml").write_text("heading_gain: 3.5\n")
    mine = str(tmp_path / "mine.xml")
    assert loading.load_scenario(vehicle={"model": mine}).lone[1].control.heading_gain == 3.5
    (tmp_path / "controller.yaml").write_text("- 1\n")
    with pytest.raises(InputError, match=r"controller.yaml: settings of a controller are a mapping"):
        loading.load_scenario(vehicle={"model": mine})
