"""Bags as columns: the same fit as from CSV, stamps, maps, and what cannot be used in one line."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "exchange"))
from exchange_logs import bag, manoeuvre

from auvsim.cli import main
from auvsim.data import log as logs
from auvsim.data.log import Log
from auvsim.exchange import csv_file
from auvsim.identification import readers, table_records
from auvsim.identification.columns import ColumnSettings
from auvsim.identification.least_squares import fit_least_squares
from auvsim.identification.segments import fit_segments
from auvsim.physics.planar_fit import fit_planar_model


@pytest.fixture(scope="module")
def log() -> Log:
    """A minute and a half of a multisine, with the noise of all sensors."""
    return manoeuvre(seed=7, duration=90.0)


@pytest.fixture(scope="module")
def folder(log: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log and bags of it by another program."""
    path = tmp_path_factory.mktemp("bags")
    logs.write(log, path / "trial.nc")
    csv_file.write(log, path / "trial.csv")
    for storage in ("sqlite3", "mcap"):
        bag(log.vehicle(), path / storage, storage, late=0.25)
    bag(log.vehicle(), path / "unstamped", "mcap", stamped=False)
    return path


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_parameters_are_those_from_csv(folder: Path, storage: str):
    """The same records, so the same parameters as from the CSV; lift and rudder are the vehicle's own to a fifth.

    The bag has the bottom track alone: the CSV's water track and fixes are left out.
    """
    (ours,) = readers.read([folder / storage], vehicle="remus100").records
    text = (folder / "trial.csv").read_text()
    for name in ("surge", "sway", "north", "east"):  # what the bag does not have
        text = text.replace(f",{name} [m", f",other_{name} [m")
    (folder / "same.csv").write_text(text)
    (theirs,) = readers.read([folder / "same.csv"], vehicle="remus100").records
    np.testing.assert_allclose(ours.inputs, theirs.inputs, atol=1e-6)  # 2e-7 s of a double of 1.7e9 s
    np.testing.assert_allclose(ours.measured, theirs.measured, atol=1e-6)
    truth = fit_planar_model("remus100", 1.4).parameters
    fits = [fit_least_squares([record], truth).parameters.vector() for record in (ours, theirs)]
    np.testing.assert_allclose(*fits, rtol=1e-3, atol=1e-6)
    fit = fit_segments([ours], truth, ("N_uv", "N_ur", "N_dd"))
    # The planar model is condensed from the hull's forces, of which sway and yaw in turns are not quite linear.
    np.testing.assert_allclose(fit.values, [truth.N_uv, truth.N_ur, truth.N_dd], rtol=0.2)


def test_receipt_is_told(folder: Path):
    """Messages that are recorded a quarter of a second after their stamps count at their stamps, and that is said."""
    (signals,), notes = table_records.signals(folder / "mcap", {})
    assert any("/fins received 0.25 s after its headers' stamps" in note for note in notes)
    mapping = {"rudder": ColumnSettings(column="/fins", time="/fins.received")}
    (late,), _ = table_records.signals(folder / "mcap", mapping)
    shift = late.signals["rudder"].times - signals.signals["rudder"].times
    np.testing.assert_allclose(shift, 0.25, atol=1e-6)


def test_map_names_numbers(folder: Path):
    """A topic, or one of its numbers with unit and sign."""
    (plain,), _ = table_records.signals(folder / "mcap", {})
    mapping = {"yaw_rate": ColumnSettings(column="/gyro.angular_velocity.z", unit="rad/s", sign=-1.0)}
    (mapped,), _ = table_records.signals(folder / "mcap", mapping)
    np.testing.assert_array_equal(mapped.signals["yaw_rate"].values, plain.signals["yaw_rate"].values)


def test_single_files(folder: Path, tmp_path: Path):
    """The storage file of a rosbag2 alone is enough."""
    for storage, suffix in (("mcap", ".mcap"), ("sqlite3", ".db3")):
        file = next((folder / storage).glob(f"*{suffix}"))
        shutil.copy(file, tmp_path / file.name)
        (signals,), _ = table_records.signals(tmp_path / file.name, {})
        assert len(signals.signals["heading"].times) == 900


def test_bad_bags(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """One line that names topics and types, and exit code 2."""
    whole = next((folder / "mcap").glob("*.mcap")).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "noise.db3").write_bytes(b"no database" * 100)
    shutil.copytree(folder / "sqlite3", tmp_path / "headless")
    (tmp_path / "headless" / "metadata.yaml").write_text("rosbag2_bagfile_information: 3\n")
    (tmp_path / "map.yaml").write_text("heading: /nowhere\n")
    (tmp_path / "field.yaml").write_text("yaw_rate: /gyro.rate\n")
    (tmp_path / "clock.yaml").write_text("heading: {column: /ahrs, time: /gyro.stamp}\n")
    cases = {
        ("cut.mcap",): "not a whole MCAP file",
        ("empty.mcap",): "not a whole MCAP file",
        ("noise.db3",): "not a whole MCAP file or rosbag2",
        ("headless",): "not a whole MCAP file or rosbag2",
        (str(folder / "unstamped"),): "stamps of its headers are all 0",
        (
            str(folder / "mcap"),
            "--columns",
            "map.yaml",
        ): "no messages of topic '/nowhere'; there are /ahrs (sensor_msgs",
        (str(folder / "mcap"), "--columns", "field.yaml"): "/gyro (sensor_msgs/msg/Imu) has no number 'rate'",
        (str(folder / "mcap"), "--columns", "clock.yaml"): "give /ahrs.received",
    }
    for (path, *rest), part in cases.items():
        rest = [str(tmp_path / r) if r.endswith(".yaml") else r for r in rest]
        for command in ("estimate", "identify"):
            extra = ["--out", str(tmp_path / "out")] if command == "identify" else []
            assert main([command, str(tmp_path / path), *rest, *extra]) == 2, (path, command)
            said = capsys.readouterr().err.strip().splitlines()
            assert len(said) == 1, said
            assert part in said[0]


def test_ambiguous_missing_and_unknown(log: Log, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Two topics of one kind, none of a rudder, and a type that nobody defines."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("std_msgs/Header header\nfloat64 angle\n", "own_msgs/msg/Fin"))

    def header(t: float):
        stamp = store.types["builtin_interfaces/msg/Time"](int(t), 0)
        return store.types["std_msgs/msg/Header"](stamp, "")

    def write(path: Path, topics: dict[str, str]) -> None:
        with Writer(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:  # without definitions
            for topic, kind in topics.items():
                connection = writer.add_connection(topic, kind, typestore=store)
                for t in range(5, 40):
                    made = store.types[kind](header(t), *[0.1] * (2 if "Pressure" in kind else 1))
                    writer.write(connection, t * 10**9, store.serialize_cdr(made, kind))
        if "own_msgs/msg/Fin" in topics.values():
            import sqlite3

            with sqlite3.connect(next(path.glob("*.db3"))) as file:
                tables = [name for (name,) in file.execute("select name from sqlite_master where type='table'")]
                if "message_definitions" in tables:
                    file.execute("delete from message_definitions")

    write(tmp_path / "humid", {"/air": "own_msgs/msg/Fin"})
    (tmp_path / "map.yaml").write_text("rudder: {column: /air.angle, unit: rad}\n")
    assert main(["estimate", str(tmp_path / "humid")]) == 2
    assert "no message of use; there are /air (own_msgs/msg/Fin)" in capsys.readouterr().err
    assert main(["estimate", str(tmp_path / "humid"), "--columns", str(tmp_path / "map.yaml")]) == 2
    assert "message type own_msgs/msg/Fin is not known" in capsys.readouterr().err
    shutil.rmtree(tmp_path / "humid")
    bag(log.vehicle(), tmp_path / "bag", "mcap")
    (tmp_path / "one.yaml").write_text("rudder: {constant: 0.1}\nshaft_speed: /ahrs\n")
    assert main(["identify", str(tmp_path / "bag"), "--columns", str(tmp_path / "one.yaml"), "--out", "out"]) == 2
    assert "/ahrs (sensor_msgs/msg/Imu) has no number 'shaft_speed'" in capsys.readouterr().err
    write(tmp_path / "still", {"/pressure": "sensor_msgs/msg/FluidPressure"})
    assert main(["identify", str(tmp_path / "still"), "--out", "out"]) == 2
    assert "no message of use; there are /pressure (sensor_msgs/msg/FluidPressure)" in capsys.readouterr().err
