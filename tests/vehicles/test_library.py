"""Finding and loading models: what is shipped, the user's own files, and one clear line for what is wrong."""

import mujoco
import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.vehicles import library, model_files


def test_every_shipped_model_is_found_and_compiles():
    folder = model_files.models_folder()
    names = sorted(path.stem for path in folder.glob("*/*.xml") if path.stem == path.parent.name)
    assert {"remus100", "dock"} <= set(names)
    for name in names:
        path = folder / name / f"{name}.xml"
        mujoco.MjModel.from_xml_path(str(path))
        assert (path.parent / "README.md").is_file()


def test_remus100():
    vehicle = library.vehicle("remus100")
    assert vehicle.model == "remus100"
    assert vehicle.actuation.fins == ("rudder_upper", "rudder_lower", "plane_port", "plane_starboard")
    assert vehicle.actuation.channels == (*vehicle.actuation.fins, "shaft")
    assert vehicle.nose == 0.8
    assert vehicle.length == pytest.approx(0.8 + 0.815)  # nose to propeller
    # README of the model: servos lag by damping / kp = 2 / 20, the shaft by armature / kv = 10 / 10.
    assert vehicle.actuation.lags == pytest.approx([0.1, 0.1, 0.1, 0.1, 1.0])
    assert vehicle.actuation.limits == pytest.approx(np.array([[-0.2618, 0.2618]] * 4 + [[-159.7, 159.7]]))
    assert vehicle.actuation.shaft_limit == pytest.approx(1525 * np.pi / 30, rel=1e-3)


def test_dock():
    dock = library.structure("dock")
    assert (dock.mouth_radius, dock.throat_radius, dock.cone_length) == (0.75, 0.15, 1.03923)
    assert dock.cone_length == pytest.approx((0.75 - 0.15) / np.tan(np.radians(30.0)), rel=1e-5)  # printed digits
    assert dock.throat_length == 0.6
    assert dock.cone_length < dock.latched < dock.cone_length + dock.throat_length
    # The stop closes the throat: its near face is where the throat ends.
    stop = dock.root.find("geom", "stop")
    assert stop.pos[0] - stop.size[1] == pytest.approx(dock.cone_length + dock.throat_length, abs=1e-9)


def test_each_load_is_a_fresh_copy():
    first, second = library.vehicle("remus100"), library.vehicle("remus100")
    first.root.find("body", "hull").remove()
    assert second.root.find("body", "hull") is not None
    assert library.vehicle("remus100").root.find("body", "hull") is not None


def test_an_unknown_name_lists_what_there_is():
    with pytest.raises(InputError, match=r"^no vehicle 'remus'; there are .*remus100") as caught:
        library.vehicle("remus")
    assert "dock" not in str(caught.value)
    with pytest.raises(
        InputError, match=r"^no structure 'remus100x'; there are dock, dock_cage, dock_lauv, dock_tube$"
    ):
        library.structure("remus100x")


def source():
    return (model_files.models_folder() / "remus100" / "remus100.xml").read_text(encoding="utf-8")


def test_a_users_own_file_is_loaded_by_its_path(tmp_path):
    path = tmp_path / "mine.xml"
    path.write_text(source().replace('model="remus100"', 'model="mine"'), encoding="utf-8")
    assert library.vehicle(str(path)).model == "mine"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('<body name="hull">', '<body name="body">', "lacks the body 'hull'"),
        ("allocation_rudder", "allocation_ruder", "lacks the numeric 'allocation_rudder'"),
        ('data="1 1 0 0"', 'data="0 0 1 1"', "the allocation of 4 fins must be (4, 2) of rank 2"),
        ('<velocity name="shaft"', '<velocity name="motor"', "lacks the actuator 'shaft'"),
        ('ctrlrange="-0.2618 0.2618"', 'ctrlrange="0.1 0.2618"', "the limits of 'rudder_upper' are 0.1 and 0.2618"),
        ('kv="10" ctrlrange="-159.7 159.7"', 'kv="10"', "actuator 'shaft' needs a ctrlrange"),
        ('<site name="nose"', '<site name="tip"', "lacks the site 'nose'"),
        ("</worldbody>", "", "tag mismatch: worldbody line 65"),
    ],
)
def test_a_file_that_breaks_the_contract_is_refused(tmp_path, old, new, expected):
    text = source()
    assert old in text
    path = tmp_path / "mine.xml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        library.vehicle(str(path))
    message = str(caught.value)
    assert expected.lower() in message.lower()
    assert "\n" not in message


def test_a_dock_is_no_vehicle_and_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="model dock lacks the body 'hull'"):
        library.vehicle("dock")
    with pytest.raises(InputError, match="model remus100 lacks the site 'capture'"):
        library.structure("remus100")
    with pytest.raises(InputError, match=r"absent\.xml"):
        library.vehicle(str(tmp_path / "absent.xml"))
    binary = tmp_path / "binary.xml"
    binary.write_bytes(b"\xff\xfe\x00\x9f")
    with pytest.raises(InputError, match=r"binary\.xml"):
        library.vehicle(str(binary))
