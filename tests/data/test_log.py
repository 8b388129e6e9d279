import dataclasses
import os
from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import pytest
import xarray
from log_samples import PHASES, STATES, record, recorder, sample_log

from auvsim.base.errors import InputError
from auvsim.data.attributes import RUN_ATTRIBUTES, STRUCTURE_ATTRIBUTES, VEHICLE_ATTRIBUTES
from auvsim.data.description import table_markdown
from auvsim.data.log import Log, differences, pack, read, write
from auvsim.data.variables import ROOT_TABLES, VEHICLE_TABLES, Variable, vehicle_groups

OWN = "vehicles/remus100"


@pytest.fixture(scope="module")
def log() -> Log:
    return sample_log()


@pytest.fixture
def file(log: Log, tmp_path: Path) -> Path:
    path = tmp_path / "trial.nc"
    write(log, path)
    return path


def changed(log: Log, path: str, values: np.ndarray | None, **description) -> Log:
    """The log with one variable replaced, or left out; `description` changes what the log says of it."""
    group, name = path.rsplit("/", 1)
    columns, table = dict(log.groups[group]), dict(log.tables[group])
    if values is None:
        del columns[name], table[name]
    else:
        columns[name], table[name] = values, dataclasses.replace(table[name], **description)
    return dataclasses.replace(log, groups={**log.groups, group: columns}, tables={**log.tables, group: table})


def with_attribute(log: Log, path: str, name: str, value) -> Log:
    """The log with one attribute of a group ("" for the run) replaced, or left out for None."""
    old = log.group_attributes[path] if path else log.attributes
    new = {key: item for key, item in old.items() if key != name} | ({} if value is None else {name: value})
    if not path:
        return dataclasses.replace(log, attributes=new)
    return dataclasses.replace(log, group_attributes={**log.group_attributes, path: new})


def two_vehicles() -> Log:
    """A log of a vehicle that docks and one of which only its truth at one instant was logged."""
    kept = recorder(vehicles=("auv_1", "auv_2"))
    record(kept, "auv_1")
    kept.event(3.0, "auv_2", "leg", "second leg")
    kept.event(4.0, "", "timeout", "for all")
    return kept.finish("complete")


def test_round_trip_is_bit_for_bit(log: Log, file: Path):
    again = read(file)
    assert differences(log, again) == []
    assert again.attributes == log.attributes
    assert again.group_attributes == log.group_attributes
    assert again.tables == log.tables
    for path, table in log.tables.items():
        assert {name: again.groups[path][name].dtype for name in table} == {
            name: np.dtype(object if variable.dtype in ("str", "category") else variable.dtype)
            for name, variable in table.items()
        }
    assert np.isnan(again.groups[f"{OWN}/sensors/usbl"]["received"]).any()  # lost packets keep their NaN
    assert str(again.attributes["scenario"]).endswith("Strömung\n")


def test_a_log_in_which_nothing_happened_round_trips(tmp_path: Path):
    empty = recorder().finish("interrupted", wall_time=0.5)
    write(empty, tmp_path / "empty.nc")
    again = read(tmp_path / "empty.nc")
    assert differences(empty, again) == []
    assert again.tables == empty.tables
    vehicle = again.vehicle()
    assert vehicle["truth"]["actuators"].shape == (0, 5)
    assert vehicle["feedback"]["value"].shape == (0, 5)
    assert vehicle["estimate"]["covariance"].shape == (0, 8, 8)


def test_other_netcdf_readers_find_names_units_and_dimensions(log: Log, file: Path):
    with h5netcdf.File(file, "r") as other:
        for path, table in log.tables.items():
            for name, variable in table.items():
                found = other[path][name]
                assert found.dimensions == ("time", *variable.dimensions)
                assert found.attrs["long_name"] == variable.long_name
                assert found.attrs.get("units", "") == variable.units
                if variable.dtype == "float64":
                    np.testing.assert_array_equal(found[...], log.groups[path][name])
        phase = other[f"{OWN}/mission/phase"]
        assert phase.attrs["flag_meanings"] == " ".join(PHASES)
        assert np.array_equal(np.asarray(phase.attrs["flag_values"]), range(len(PHASES)))
        assert other[f"{OWN}/estimate/mean"].attrs["labels"] == ",".join(STATES)
        assert other[f"{OWN}/truth"].dimensions["time"].isunlimited()
        assert other[f"{OWN}/sensors/usbl/lost"].dtype == np.int8  # NetCDF has no booleans
        assert other.attrs["status"] == "complete"
        assert other[OWN].attrs["nose"] == 0.8
        assert other["structures/dock"].attrs["throat_length"] == 0.7
        reason = other[f"{OWN}/measurements/reason"]
        texts = np.array([*reason.attrs["categories"]], dtype=object)[reason[...]]
        assert texts.tolist() == log.groups[f"{OWN}/measurements"]["reason"].tolist()
        assert reason.attrs["flag_meanings"] == "none gate"


def test_xarray_opens_a_group(log: Log, file: Path):
    with xarray.open_dataset(file, group=f"{OWN}/truth", engine="h5netcdf") as truth:
        np.testing.assert_array_equal(truth["nu"].values, log.groups[f"{OWN}/truth"]["nu"])
        assert truth["nu"].dims == ("time", "uvwpqr")
        assert truth["nu"].attrs["units"] == "m/s, rad/s"
        np.testing.assert_array_equal(truth["time"].values, log.groups[f"{OWN}/truth"]["time"])
    with xarray.open_dataset(file, group=f"{OWN}/sensors/usbl", engine="h5netcdf") as usbl:
        assert usbl["lost"].dtype == bool
        np.testing.assert_array_equal(usbl["lost"].values, log.groups[f"{OWN}/sensors/usbl"]["lost"])


def test_the_same_log_makes_the_same_bytes(log: Log, file: Path, tmp_path: Path):
    write(log, tmp_path / "again.nc")
    assert (tmp_path / "again.nc").read_bytes() == file.read_bytes() == pack(log)


def test_texts_of_any_length_and_alphabet(tmp_path: Path):
    kept = recorder()
    texts = ["", "Tür zu — 門", "x" * 5000, "a b", "a b"]
    for text in texts:
        kept.event(0.0, "remus100", text, text)  # as a category and as free text
    write(kept.finish("complete"), tmp_path / "events.nc")
    events = read(tmp_path / "events.nc").groups["event"]
    assert events["text"].tolist() == events["kind"].tolist() == texts


# What a log offers its readers


def test_a_vehicle_gives_its_groups_by_long_and_short_names(log: Log):
    vehicle = log.vehicle()
    assert (log.vehicles, log.structures, vehicle.name) == (("remus100",), ("dock",), "remus100")
    assert vehicle["truth"] is log.groups[f"{OWN}/truth"]
    assert vehicle["usbl"] is vehicle["sensors/usbl"] is log.groups[f"{OWN}/sensors/usbl"]
    assert "usbl" in vehicle
    assert "sensors/usbl" in vehicle
    assert "event" in vehicle
    assert "dvl" not in vehicle
    assert vehicle.table("usbl")["lost"].dtype == "bool"
    assert (vehicle.mission, vehicle.phases) == ("docking", PHASES)
    assert vehicle.number("nose") == 0.8
    with pytest.raises(InputError, match=r"'remus100' has no log group 'dvl'; there are truth, .*sensors/usbl, event$"):
        vehicle["dvl"]
    with pytest.raises(InputError, match="attribute 'tail' of 'vehicles/remus100' is not given; there are model, nose"):
        vehicle.number("tail")
    assert vehicle.number("tail", 0.25) == 0.25
    with pytest.raises(InputError, match="attribute 'model' of 'vehicles/remus100' is 'remus100', no number"):
        vehicle.number("model")


def test_a_structure_gives_its_place(log: Log):
    log = with_attribute(with_attribute(log, "structures/dock", "north", 3.0), "structures/dock", "east", -4.0)
    structure = log.vehicle().structure
    assert structure is not None
    assert structure.name == "dock"
    assert structure.position.tolist() == [3.0, -4.0, 5.0]
    assert (structure.heading, structure.number("cone_length")) == (0.6, 1.0)
    with pytest.raises(InputError, match="no structure 'pier'; there are dock"):
        log.structure("pier")


def test_one_vehicle_among_several():
    log = two_vehicles()
    assert log.vehicles == ("auv_1", "auv_2")
    with pytest.raises(InputError, match=r"2 vehicles \(auv_1, auv_2\); say which"):
        log.vehicle()
    with pytest.raises(InputError, match="no vehicle 'auv_3'; there are auv_1, auv_2"):
        log.vehicle("auv_3")
    first, second = log.vehicle("auv_1"), log.vehicle("auv_2")
    assert first["event"]["kind"].tolist() == ["docked", "timeout"]
    assert second["event"]["text"].tolist() == ["second leg", "for all"]
    assert second["event"]["time"].tolist() == [3.0, 4.0]
    assert len(second["truth"]["time"]) == 0 < len(first["truth"]["time"])
    assert (first.mission, second.mission, second.structure) == ("docking", "track", None)


def test_groups_follow_the_parts_of_a_vehicle():
    found = vehicle_groups(
        sensors={"range_1": ({"value": Variable(("range",), "float64", "m", "range")}, {"range": 1})},
        mission=(("leg", "turn"), {}),
        demands={},
        channels={"thruster_1": "rad/s", "thruster_2": "rad/s"},
        states={"north": "m", "east": "m", "heading": "rad"},
    )
    estimate, truth = found["estimate"], found["truth"]
    assert (estimate.shape(4, "mean"), estimate.shape(4, "covariance")) == ((4, 3), (4, 3, 3))
    assert estimate.table["mean"].labels == estimate.table["covariance"].labels == ("north", "east", "heading")
    assert (estimate.table["mean"].units, truth.table["actuators"].units) == ("m, m, rad", "rad/s, rad/s")
    assert truth.shape(4, "actuators") == (4, 2)
    assert found["mission"].table["phase"].flags == ("leg", "turn")
    assert list(found["sensors/range_1"].table) == ["time", "received", "value", "sequence"]
    assert found["sensors/range_1"].shape(4, "value") == (4, 1)


# Files that are no logs


def test_missing_file(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.nc: no such file"):
        read(tmp_path / "none.nc")


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
def test_truncated_file(file: Path, share: float):
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"trial\.nc: not a whole NetCDF-4 file: [^\n]+$"):
        read(file)


def test_files_with_damaged_bytes_give_one_line_or_are_read(log: Log, file: Path):
    """No error but InputError, whatever part of the file 64 wrong bytes hit; most of the structure is at its start."""
    content = file.read_bytes()
    rng = np.random.default_rng(3)
    refusals = []
    for start in rng.integers(0, 200_000, size=60):
        file.write_bytes(content[:start] + rng.bytes(64) + content[start + 64 :])
        try:
            read(file)
        except InputError as error:
            refusals.append(str(error))
    assert len(refusals) > 3  # of sixty; wrong numbers in the arrays cannot be seen
    assert all("trial.nc: " in text and "\n" not in text for text in refusals)


def test_not_netcdf(tmp_path: Path):
    (tmp_path / "text.nc").write_text("no log\n" * 100)
    with pytest.raises(InputError, match=r"text\.nc: not a whole NetCDF-4 file"):
        read(tmp_path / "text.nc")


def test_netcdf_that_is_no_log(file: Path):
    with h5py.File(file, "a") as content:
        del content[f"{OWN}/truth/nu"]
    with pytest.raises(InputError, match=rf"trial\.nc: no variable '{OWN}/truth/nu'; there are time, position"):
        read(file)
    with h5py.File(file, "a") as content:
        del content[f"{OWN}/estimate"]
    with pytest.raises(InputError, match=rf"trial\.nc: no (group '{OWN}/estimate'|variable)"):
        read(file)
    with h5py.File(file, "a") as content:
        del content.attrs["seed"]
    with pytest.raises(InputError, match=r"no attribute 'seed' \(seed of the random streams\)"):
        read(file)
    with h5py.File(file, "a") as content:
        content.attrs["format_version"] = 99
    with pytest.raises(InputError, match="log format 99; this auvsim reads 1 to 3"):
        read(file)
    with h5py.File(file, "a") as content:
        content.attrs["format_version"] = [3, 3]
    with pytest.raises(InputError, match=r"log format \[3 3\]; this auvsim reads 1 to 3"):
        read(file)
    with h5py.File(file, "a") as content:
        del content.attrs["format_version"]
    with pytest.raises(InputError, match="no attribute 'format_version'; it is no log of auvsim"):
        read(file)


def test_codes_without_category_are_refused(file: Path):
    with h5py.File(file, "a") as content:
        content[f"{OWN}/measurements/reason"][3] = 2  # there are 0 and 1
    with pytest.raises(InputError, match=r"'/vehicles/remus100/measurements/reason' has a code without category"):
        read(file)


def test_wrong_arrays_are_refused(log: Log, tmp_path: Path):
    """Each fault is one line that names the file, the variable, what is wrong and what would be right."""
    rows = len(log.groups[f"{OWN}/truth"]["time"])
    time = log.groups[f"{OWN}/truth"]["time"].copy()
    time[4] = np.nan
    phase = log.groups[f"{OWN}/mission"]["phase"].copy()
    phase[9] = 7
    mission = len(phase)
    faults = [
        ("truth/nu", np.zeros((rows, 5)), {}, rf"shape \({rows}, 5\), not \({rows}, 6\) for \(time, uvwpqr\)"),
        ("truth/nu", np.zeros((rows, 6), dtype=np.float32), {}, "has type float32, not float64"),
        (
            "truth/nu",
            np.zeros((rows, 6), np.float32),
            {"dtype": "float32"},
            r"is float32 \(time, uvwpqr\), not float64",
        ),
        ("truth/actuators", np.zeros(rows), {}, rf"has shape \({rows},\), not \({rows}, channel\)"),
        ("truth/actuators", np.zeros((rows, 4)), {}, r"has 5 labels \(rudder_upper, .*, shaft\) for 4 columns"),
        ("truth/time", time, {}, "is nan in row 4; times are finite"),
        ("command/rudder", np.zeros(3), {}, rf"has shape \(3,\), not \({mission - 1}\)"),
        ("estimate/covariance", np.zeros((1, 8, 8)), {}, r"has shape \(1, 8, 8\), not \(\d+, 8, 8\)"),
        ("mission/phase", phase, {}, "has the value 7; there are 0 search, .*, 6 aborted"),
        ("mission/phase", phase, {"flags": ()}, "has no flags that name the phases"),
        ("mission/attempt", phase - 9.0, {"dtype": "complex128"}, "has type complex128; a log has float64, int8"),
        ("measurements/sensor", np.full(86, 3, dtype=object), {}, "has values that are no texts"),
        ("sensors/usbl/value", None, {}, "no variable .*; there are time, received, sequence, lost, outlier"),
        ("measurements/nis", None, {}, "no variable .*; there are time, sensor, stamp, sequence, accepted, reason"),
    ]
    path = tmp_path / "wrong.nc"
    for name, values, description, message in faults:
        with pytest.raises(InputError, match=message) as caught:
            write(changed(log, f"{OWN}/{name}", values, **description), path)
        assert str(caught.value).startswith(f"{path}: ")
        assert f"{OWN}/{name}" in str(caught.value)
        assert "\n" not in str(caught.value)
    assert not path.exists()


def test_states_and_covariance_agree(log: Log):
    rows = len(log.groups[f"{OWN}/estimate"]["time"])
    wrong = changed(log, f"{OWN}/estimate/mean", np.zeros((rows, 7)), labels=tuple("abcdefg"))
    with pytest.raises(InputError, match=rf"covariance' has shape \({rows}, 8, 8\), not \({rows}, 7, 8\)"):
        write(wrong, "never.nc")


def test_wrong_attributes_are_refused(log: Log):
    own, dock = OWN, "structures/dock"
    faults = [
        ("", "status", "done", "status 'done'; there are complete, diverged, interrupted"),
        ("", "scenario", None, r"no attribute 'scenario' \(the full scenario as YAML\)"),
        ("", "trial", 1.5, "attribute 'trial' is 1.5, not an integer"),
        ("", "seed", True, "attribute 'seed' is True, not an integer"),
        ("", "note", [1, 2], "attribute 'note' is a list, not a text or number"),
        ("", "latitude", float("nan"), "attribute 'latitude' is nan, not a finite number"),
        (own, "nose", "long", "attribute 'nose' of 'vehicles/remus100' is 'long', not a finite number"),
        (own, "mission", None, r"no attribute 'mission' of 'vehicles/remus100' \(kind of the mission\)"),
        (own, "dock", "pier", "attribute 'dock' of 'vehicles/remus100' is 'pier'; there are the structures dock"),
        (dock, "throat_length", None, r"no attribute 'throat_length' of 'structures/dock' \(length of the throat"),
        (dock, "depth", float("inf"), "attribute 'depth' of 'structures/dock' is inf, not a finite number"),
    ]
    for path, name, value, message in faults:
        with pytest.raises(InputError, match=rf"^never\.nc: {message}"):
            write(with_attribute(log, path, name, value), "never.nc")


def test_groups_without_table_or_vehicle_are_refused(log: Log):
    stray = {"time": np.zeros(1)}
    ghost = dataclasses.replace(log, groups={**log.groups, "vehicles/ghost/truth": stray})
    with pytest.raises(InputError, match="'vehicles/ghost/truth' is of no vehicle; there are remus100"):
        write(ghost, "never.nc")
    with pytest.raises(InputError, match=r"'weather/time' is not described"):
        write(dataclasses.replace(log, groups={**log.groups, "weather": stray}), "never.nc")
    with pytest.raises(InputError, match="no vehicle; each has a group"):
        write(dataclasses.replace(log, group_attributes={}), "never.nc")
    groups = {path: columns for path, columns in log.groups.items() if path != "network/messages"}
    with pytest.raises(InputError, match="no group 'network/messages'; there are vehicles/remus100/truth"):
        write(dataclasses.replace(log, groups=groups), "never.nc")
    other = changed(log, "event/vehicle", np.array(["auv_9"], dtype=object))
    with pytest.raises(InputError, match="'event/vehicle' has 'auv_9'; there are remus100"):
        write(other, "never.nc")


@pytest.mark.parametrize("failing", ["fsync", "rename"])
@pytest.mark.parametrize("before", [None, b"the older log"])
def test_a_failing_write_changes_nothing(log: Log, tmp_path: Path, monkeypatch, failing: str, before: bytes | None):
    path = tmp_path / "trial.nc"
    if before is not None:
        path.write_bytes(before)

    def fail(*_):
        raise OSError(28, "No space left on device")

    target, name = (os, "fsync") if failing == "fsync" else (Path, "replace")
    monkeypatch.setattr(target, name, fail)
    with pytest.raises(InputError, match=r"trial\.nc: cannot be written: No space left"):
        write(log, path)
    assert [entry.name for entry in tmp_path.iterdir()] == ([] if before is None else ["trial.nc"])
    assert before is None or path.read_bytes() == before


def test_writing_where_there_is_no_folder(log: Log, tmp_path: Path):
    with pytest.raises(InputError, match="cannot be written: No such file or directory"):
        write(log, tmp_path / "none" / "trial.nc")


def test_differences_see_one_bit_and_ignore_clocks_and_versions(log: Log):
    nu = log.groups[f"{OWN}/truth"]["nu"].copy()
    nu[7, 2] = np.nextafter(nu[7, 2], np.inf)
    assert differences(log, changed(log, f"{OWN}/truth/nu", nu)) == [f"{OWN}/truth/nu"]
    initial, later = changed(log, f"{OWN}/truth/time", np.zeros(2)), changed(log, f"{OWN}/truth/time", np.zeros(2, int))
    assert differences(initial, later) == [f"{OWN}/truth/time"]  # the same bytes, other types
    text = np.array(["else"], dtype=object)
    assert differences(log, changed(log, "event/text", text)) == ["event/text"]
    later = {**log.attributes, "wall_time": 99.0, "mujoco_version": "0"}
    assert differences(log, dataclasses.replace(log, attributes=later)) == []
    assert differences(log, dataclasses.replace(log, attributes={**later, "seed": 8})) == ["seed"]
    assert differences(log, with_attribute(log, OWN, "nose", 0.9)) == [f"{OWN}/nose"]
    assert differences(log, changed(log, f"{OWN}/truth/nu", None)) == [f"{OWN}/truth/nu", f"{OWN}/truth (tables)"]
    assert differences(changed(log, f"{OWN}/truth/nu", None), log) == [f"{OWN}/truth/nu", f"{OWN}/truth (tables)"]
    less = {path: columns for path, columns in log.groups.items() if path != "network/messages"}
    found = differences(log, dataclasses.replace(log, groups=less))
    assert found == [f"network/messages/{name}" for name in log.tables["network/messages"]]


# The documentation


def test_the_printed_format_has_every_variable_and_attribute():
    own = {"Sensor `gyro`": {"value": Variable(("pqr",), "float64", "rad/s", "angular velocity p, q, r", "body")}}
    lines = table_markdown(own).splitlines()
    for tables in (VEHICLE_TABLES, ROOT_TABLES):
        for group, table in tables.items():
            path = group if tables is ROOT_TABLES else f"vehicles/<name>/{group}"
            start = next(i for i, line in enumerate(lines) if line.startswith(f"Group `{path}`"))
            rows = lines[start + 4 : start + 4 + len(table)]
            assert [row.split("|")[1].strip() for row in rows] == list(table)
            assert all(row.count("|") == 7 for row in rows)  # no cell breaks the table
    for name in (*RUN_ATTRIBUTES, *VEHICLE_ATTRIBUTES, *STRUCTURE_ATTRIBUTES):
        assert any(line.startswith(f"| {name} |") for line in lines)
    assert lines[-1] == "| value | time, pqr | float64 | rad/s | body | angular velocity p, q, r |"
    assert lines[-5] == "Sensor `gyro`:"


def test_the_documentation_is_what_is_printed():
    text = (Path(__file__).parents[2] / "docs" / "log_format.md").read_text(encoding="utf-8")
    assert text.startswith(table_markdown())  # what follows are the tables of sensors and missions
