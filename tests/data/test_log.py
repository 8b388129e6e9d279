import dataclasses
import os
from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import pytest
from synthetic import GO_AROUND, empty_log, trial_log, truth, writer

from auvsim.base.errors import InputError
from auvsim.base.reading import Reading
from auvsim.data.log import PHASES, TABLE, TrialLog, differences, read, table_markdown, write


@pytest.fixture(scope="module")
def log() -> TrialLog:
    return trial_log(GO_AROUND)


@pytest.fixture
def file(log: TrialLog, tmp_path: Path) -> Path:
    path = tmp_path / "trial.nc"
    write(log, path)
    return path


def changed(log: TrialLog, group: str, name: str, values: np.ndarray | None) -> TrialLog:
    """The log with one variable replaced, or left out."""
    variables = {key: value for key, value in log[group].items() if key != name}
    if values is not None:
        variables[name] = values
    return dataclasses.replace(log, groups={**log.groups, group: variables})


def test_round_trip_is_bit_for_bit(log: TrialLog, file: Path):
    again = read(file)
    assert differences(log, again) == []
    assert again.attributes == log.attributes
    for group, variables in TABLE.items():
        for name, variable in variables.items():
            dtype = np.dtype(object if variable.dtype == "str" else variable.dtype)
            assert again[group][name].dtype == dtype, f"{group}/{name}"
    assert np.isnan(again["usbl"]["received"]).any()  # lost packets keep their NaN
    assert str(again.attributes["scenario"]).endswith("Strömung\n")


def test_a_log_in_which_nothing_happened_round_trips(tmp_path: Path):
    write(empty_log(), tmp_path / "empty.nc")
    again = read(tmp_path / "empty.nc")
    assert differences(empty_log(), again) == []
    assert again["truth"]["fins"].shape == (0, 4)
    assert again["feedback"]["value"].shape == (0, 5)
    assert again["estimate"]["covariance"].shape == (0, 8, 8)


def test_other_netcdf_readers_find_names_units_and_dimensions(log: TrialLog, file: Path):
    with h5netcdf.File(file, "r") as other:
        for group, variables in TABLE.items():
            for name, variable in variables.items():
                found = other[group][name]
                assert found.dimensions == ("time", *variable.dimensions)
                assert found.attrs["long_name"] == variable.long_name
                assert found.attrs.get("units", "") == variable.units
                if variable.dtype == "float64":
                    np.testing.assert_array_equal(found[...], log[group][name])
        phase = other["guidance"]["phase"]
        assert phase.attrs["flag_meanings"] == " ".join(PHASES)
        assert np.array_equal(np.asarray(phase.attrs["flag_values"]), range(len(PHASES)))
        assert other["truth"].dimensions["time"].isunlimited()
        assert other.attrs["status"] == "complete"


def test_the_same_log_makes_the_same_bytes(log: TrialLog, file: Path, tmp_path: Path):
    write(log, tmp_path / "again.nc")
    assert (tmp_path / "again.nc").read_bytes() == file.read_bytes()


def test_event_texts_of_any_length_and_alphabet(tmp_path: Path):
    recorder = writer()
    texts = ["", "Tür zu — 門", "x" * 5000]
    for text in texts:
        recorder.event(0.0, "note", text)
    write(recorder.finish("complete"), tmp_path / "events.nc")
    assert read(tmp_path / "events.nc")["event"]["text"].tolist() == texts


def test_truth_is_copied_when_it_is_logged():
    recorder, now = writer(), truth(1.0, (1.0, 2.0, 3.0), velocity=(1.0, 2.0, 0.5), current=(0.1, 0.2, 0.3))
    recorder.truth(now)
    kept = {name: np.copy(getattr(now, name)) for name in TABLE["truth"]}
    now.position[:] = now.nu[:] = -1.0  # what a world does that reuses its arrays
    log = recorder.finish("complete")
    for name, value in kept.items():
        np.testing.assert_array_equal(log["truth"][name][0], value, err_msg=name)


def test_a_lost_reading_was_never_received():
    recorder = writer()
    recorder.reading(Reading("usbl", 1.0, 2.0, np.zeros(7), 3), lost=True)
    usbl = recorder.finish("complete")["usbl"]
    assert np.isnan(usbl["received"]).tolist() == [True]
    assert (usbl["lost"].tolist(), usbl["outlier"].tolist(), usbl["sequence"].tolist()) == ([True], [False], [3])


def test_rows_that_do_not_fit_are_named():
    recorder = writer()
    recorder.append("command", (0.0, 0.1))
    with pytest.raises(InputError, match="'command' has 2 values, not 4: time, rudder"):
        recorder.finish("complete")
    recorder = writer()
    recorder.reading(Reading("compass", 0.0, 0.0, np.zeros(2)))
    with pytest.raises(InputError, match=r"'compass/value' should have shape \(1, 3\)"):
        recorder.finish("complete")
    recorder = writer()
    recorder.truth(truth(0.0, (0, 0, 0))._replace(fins=np.zeros(3)))
    with pytest.raises(InputError, match="a truth should have 25 numbers"):
        recorder.finish("complete")
    with pytest.raises(InputError, match="no status 'done'; there are complete"):
        writer().finish("done")


def test_missing_file(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.nc: no such file"):
        read(tmp_path / "none.nc")


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
def test_truncated_file(file: Path, share: float):
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"trial\.nc: not a whole NetCDF-4 file: [^\n]+$"):
        read(file)


def test_not_netcdf(tmp_path: Path):
    (tmp_path / "text.nc").write_text("no log\n" * 100)
    with pytest.raises(InputError, match=r"text\.nc: not a whole NetCDF-4 file"):
        read(tmp_path / "text.nc")


def test_netcdf_that_is_no_trial_log(file: Path):
    with h5py.File(file, "a") as content:
        del content["truth/nu"]
    with pytest.raises(InputError, match=r"trial\.nc: no variable 'truth/nu'"):
        read(file)
    with h5py.File(file, "a") as content:
        del content["estimate"]
    with pytest.raises(InputError, match=r"trial\.nc: no "):
        read(file)
    with h5py.File(file, "a") as content:
        content.attrs["format_version"] = 99
    with pytest.raises(InputError, match="log format 99; this auvsim reads 1 and 2"):
        read(file)
    with h5py.File(file, "a") as content:
        del content.attrs["seed"]
    with pytest.raises(InputError, match="no attribute 'seed'"):
        read(file)


def test_wrong_shapes_are_refused(log: TrialLog, tmp_path: Path):
    path = tmp_path / "wrong.nc"
    rows = len(log["truth"]["time"])
    with pytest.raises(InputError, match=rf"'truth/nu' has shape \({rows}, 5\), not \({rows}, 6\)"):
        write(changed(log, "truth", "nu", np.zeros((rows, 5))), path)
    with pytest.raises(InputError, match=rf"'truth/shaft_speed' has shape \(3,\), not \({rows}\)"):
        write(changed(log, "truth", "shaft_speed", np.zeros(3)), path)
    with pytest.raises(InputError, match=r"'truth/fins' has shape \(\d+,\), not \(\d+, any\)"):
        write(changed(log, "truth", "fins", np.zeros(rows)), path)
    with pytest.raises(InputError, match="no variable 'usbl/lost'"):
        write(changed(log, "usbl", "lost", None), path)
    assert not path.exists()


@pytest.mark.parametrize("failing", ["fsync", "rename"])
@pytest.mark.parametrize("before", [None, b"the older log"])
def test_a_failing_write_changes_nothing(
    log: TrialLog, tmp_path: Path, monkeypatch, failing: str, before: bytes | None
):
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


def test_writing_where_there_is_no_folder(log: TrialLog, tmp_path: Path):
    with pytest.raises(InputError, match="cannot be written: No such file or directory"):
        write(log, tmp_path / "none" / "trial.nc")


def test_differences_see_one_bit_and_ignore_clocks_and_versions(log: TrialLog):
    nu = log["truth"]["nu"].copy()
    nu[7, 2] = np.nextafter(nu[7, 2], np.inf)
    assert differences(log, changed(log, "truth", "nu", nu)) == ["truth/nu"]
    assert differences(log, changed(log, "event", "text", np.array(["else"], dtype=object))) == ["event/text"]
    later = {**log.attributes, "wall_time": 99.0, "mujoco_version": "0"}
    assert differences(log, dataclasses.replace(log, attributes=later)) == []
    assert differences(log, dataclasses.replace(log, attributes={**later, "seed": 8})) == ["seed"]


def test_the_printed_table_has_every_variable():
    lines = table_markdown().splitlines()
    for group, variables in TABLE.items():
        start = lines.index(f"Group `{group}`:")
        rows = lines[start + 4 : start + 4 + len(variables)]
        assert [row.split("|")[1].strip() for row in rows] == list(variables)
        assert all(row.count("|") == 7 for row in rows)  # no cell breaks the table


def test_logs_of_version_1_are_read_with_empty_groups(log: TrialLog, file: Path):
    """They knew neither DVL nor gyro; everything else is as it was."""
    with h5py.File(file, "a") as content:
        del content["dvl"]
        del content["gyro"]
        content.attrs["format_version"] = 1
    again = read(file)
    assert differences(log, again) == []
    assert again["dvl"]["value"].shape == (0, 6)
    assert again["gyro"]["value"].shape == (0, 3)
