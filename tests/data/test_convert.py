"""Logs of format 2 that its own writer made (4 s of a docking, 21 s of a straight manoeuvre), read as format 3."""

import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml

from auvsim.base.errors import InputError
from auvsim.data.log import Log, differences, read, write

FILES = Path(__file__).parent / "files"
PHASES = ("search", "homing", "approach", "final", "docked", "go_around", "aborted")
OWN = "vehicles/remus100"


def old_file(name: str, folder: Path) -> Path:
    """The file of an old log, unpacked."""
    path = folder / f"{name}.nc"
    path.write_bytes(gzip.decompress((FILES / f"{name}.nc.gz").read_bytes()))
    return path


@pytest.fixture
def docking(tmp_path: Path) -> Path:
    return old_file("docking_format2", tmp_path)


@pytest.fixture
def manoeuvre(tmp_path: Path) -> Path:
    return old_file("manoeuvre_format2", tmp_path)


MOVED = {  # group and variable of format 2: where they are below the vehicle
    **{f"truth/{name}": f"truth/{name}" for name in ("time", "position", "quaternion", "attitude", "nu", "current")},
    **{
        f"estimate/{name}": f"estimate/{name}"
        for name in ("time", "position", "heading", "velocity", "current", "covariance", "refused", "initialised")
    },
    **{f"guidance/{name}": f"mission/{name}" for name in ("time", "attempt", "along_track", "cross_track")},
    **{f"guidance/{name}_command": f"mission/{name}_setpoint" for name in ("heading", "depth", "speed")},
    **{f"command/{name}": f"command/{name}" for name in ("time", "rudder", "elevator", "shaft_speed")},
    **{f"contact/{name}": f"contact/{name}" for name in ("time", "force", "impulse")},
    **{
        f"{sensor}/{name}": f"sensors/{sensor}/{name}"
        for sensor in ("compass", "depth", "feedback", "usbl", "dvl", "gyro")
        for name in ("time", "received", "value", "sequence")
    },
    **{f"usbl/{name}": f"sensors/usbl/{name}" for name in ("lost", "outlier")},
}


@pytest.mark.parametrize("name", ["docking_format2", "manoeuvre_format2"])
def test_every_value_of_format_2_is_found_again(name: str, tmp_path: Path):
    path = old_file(name, tmp_path)
    log = read(path)
    truth, estimate = log.groups[f"{OWN}/truth"], log.groups[f"{OWN}/estimate"]
    seen = {
        "truth/fins",
        "truth/shaft_speed",
        "guidance/phase",
        *(f"event/{name}" for name in ("time", "kind", "text")),
    }
    with h5py.File(path) as old:
        own = {f"guidance/{name}" for name in ("attempt", "along_track", "cross_track")}  # a manoeuvre has no dock
        seen |= own if "manoeuvre" in name else set()
        for before, after in MOVED.items():
            if before in seen:
                continue
            group, variable = after.rsplit("/", 1)
            np.testing.assert_array_equal(log.groups[f"{OWN}/{group}"][variable], old[before][...], err_msg=after)
            seen.add(before)
        np.testing.assert_array_equal(truth["actuators"][:, :-1], old["truth/fins"][...])
        np.testing.assert_array_equal(truth["actuators"][:, -1], old["truth/shaft_speed"][...])
        states = [old[f"estimate/{name}"][...] for name in ("position", "heading", "velocity", "current")]
        for column, values in enumerate([*states[0].T[:2], states[1], *states[2].T, *states[3].T]):
            np.testing.assert_array_equal(estimate["mean"][:, column], values)
        for column in ("time", "kind", "text"):
            values = old[f"event/{column}"]
            values = values.asstr()[...] if column != "time" else values[...]
            assert log.groups["event"][column].tolist() == values.tolist()
        bare = np.dtype(">f4")  # dimensions without values
        assert seen == {f"{g}/{v}" for g, group in old.items() for v, item in group.items() if item.dtype != bare}
    assert len(truth["time"]) > 5
    assert len(estimate["time"]) > 5
    assert log.tables[f"{OWN}/truth"]["actuators"].labels == ("fin_1", "fin_2", "fin_3", "fin_4", "shaft")
    assert log.tables[f"{OWN}/estimate"]["mean"].labels[:3] == ("north", "east", "heading")
    assert log.tables[f"{OWN}/sensors/usbl"]["value"].dimensions == ("packet",)
    assert "manoeuvre" in name or log.tables[f"{OWN}/mission"]["along_track"].units == "m"
    assert log.groups["event"]["vehicle"].tolist() == ["remus100"] * len(log.groups["event"]["time"])
    for empty in (f"{OWN}/measurements", "network/messages"):
        assert len(log.groups[empty]["time"]) == 0
    write(log, tmp_path / "new.nc")
    again = read(tmp_path / "new.nc")
    assert differences(log, again) == []
    assert again.tables == log.tables


def test_attributes_of_the_run_the_vehicle_and_the_dock(docking: Path):
    log = read(docking)
    with h5py.File(docking) as old:
        attributes = dict(old.attrs.items())
    assert log.attributes["format_version"] == 3
    for name in ("status", "scenario", "seed", "trial", "wall_time", "numpy_version"):
        assert log.attributes[name] == attributes[name]
    assert not {"dock_depth", "dock_heading", "vehicle_nose", "mouth_radius", "cone_length"} & log.attributes.keys()
    vehicle = log.vehicle()
    assert (vehicle.name, vehicle.mission, vehicle.phases) == ("remus100", "docking", PHASES)
    assert vehicle.number("nose") == attributes["vehicle_nose"]
    assert vehicle.attributes["estimator"] == yaml.safe_load(attributes["scenario"])["estimator"]["factory"]
    assert vehicle.attributes["controller"] == "torpedo"
    dock = vehicle.structure
    assert dock is not None
    assert dock.name == "dock"
    assert dock.position.tolist() == [0.0, 0.0, attributes["dock_depth"]]
    assert dock.heading == attributes["dock_heading"]
    for name in ("mouth_radius", "throat_radius", "cone_length", "transceiver_down", "transceiver_forward"):
        assert dock.number(name) == attributes[name]
    assert dock.number("throat_length") == 0.6  # as docks were drawn of which no log said it
    with h5py.File(docking) as old:
        np.testing.assert_array_equal(vehicle["mission"]["phase"], old["guidance/phase"][...])


def test_the_phase_of_a_manoeuvre_is_the_only_one_of_its_mission(manoeuvre: Path):
    log = read(manoeuvre)
    vehicle = log.vehicle()
    assert (vehicle.mission, vehicle.phases) == ("manoeuvre", ("manoeuvre",))
    assert {*vehicle["mission"]["phase"].tolist()} == {0}
    assert vehicle["mission"]["phase"].dtype == np.int8
    assert len(vehicle["dvl"]["time"]) > 50 < len(vehicle["gyro"]["time"])


def test_a_manoeuvre_is_known_by_its_phase_or_by_its_scenario(manoeuvre: Path):
    assert renamed(manoeuvre, "manoeuvre:", "something:").vehicle().mission == "manoeuvre"
    with h5py.File(manoeuvre, "a") as content:
        for dataset in content["guidance"].values():
            dataset.resize(0, axis=0)
    assert read(manoeuvre).vehicle().mission == "docking"  # neither is left
    assert renamed(manoeuvre, "something:", "manoeuvre:").vehicle().mission == "manoeuvre"


def test_format_1_knew_neither_dvl_nor_gyro(docking: Path):
    newer = read(docking)
    with h5py.File(docking, "a") as content:
        del content["dvl"]
        del content["gyro"]
        content.attrs["format_version"] = 1
    older = read(docking)
    assert "dvl" not in older.vehicle()
    assert "dvl" in newer.vehicle()
    gone = {name.rsplit("/", 1)[0] for name in differences(newer, older)}
    assert gone == {f"{OWN}/sensors/dvl", f"{OWN}/sensors/gyro"} | {f"{OWN}/sensors"}  # variables and their tables


def renamed(path: Path, before: str, after: str) -> Log:
    """The log whose scenario has other text."""
    with h5py.File(path, "a") as content:
        text = str(content.attrs["scenario"])
        assert before in text
        content.attrs["scenario"] = text.replace(before, after)
    return read(path)


def test_instances_are_named_as_the_models(docking: Path):
    log = renamed(docking, "model: remus100", "model: /home/me/models/my_auv.xml")
    assert log.vehicles == ("my_auv",)
    assert log.group_attributes["vehicles/my_auv"]["model"] == "my_auv"
    log = renamed(docking, "model: dock", "model: cone.xml")
    assert log.structures == ("cone",)
    assert log.vehicle().attributes["dock"] == "cone"


def test_damaged_old_logs_give_one_line(docking: Path):
    faults = [
        ("guidance/phase", None, "no variable 'guidance/phase'"),
        ("truth/fins", None, "no variable 'truth/fins'"),
        ("truth/shaft_speed", np.zeros(3), r"'truth/shaft_speed' has shape \(3,\), not 9 rows as 'time'"),
        ("truth/fins", np.zeros(9), "'truth/fins' has 1 axes, not 2"),
        ("truth/nu", None, "no variable 'vehicles/remus100/truth/nu'"),
        ("truth/nu", np.zeros((9, 5)), r"'vehicles/remus100/truth/nu' has shape \(9, 5\), not \(9, 6\)"),
        ("estimate/heading", None, "no variable 'estimate/heading'"),
        ("compass/value", None, "no variable 'vehicles/remus100/sensors/compass/value'"),
        ("guidance/depth_command", None, "no variable 'vehicles/remus100/mission/depth_setpoint'"),
        ("contact", None, "no group 'contact' with a variable 'time'"),
    ]
    content = docking.read_bytes()
    for name, values, message in faults:
        docking.write_bytes(content)
        with h5py.File(docking, "a") as file:
            axes = [axis[0] for axis in file[name].attrs["DIMENSION_LIST"]] if values is not None else []
            scales = [file[reference].name for reference in axes]
            del file[name]
            if values is not None:
                file[name] = values
                for axis, scale in zip(range(values.ndim), scales, strict=False):
                    file[name].dims[axis].attach_scale(file[scale])
        with pytest.raises(InputError, match=f"^{docking}: {message}"):
            read(docking)
    docking.write_bytes(content)
    with h5py.File(docking, "a") as file:
        del file.attrs["dock_depth"]
    with pytest.raises(InputError, match="no attribute 'dock_depth', which a log of formats 1 and 2 has"):
        read(docking)
    docking.write_bytes(content)
    with pytest.raises(InputError, match=r"docking_format2\.nc: scenario:\d+: not YAML"):
        renamed(docking, "vehicle:", "vehicle: [")
