"""Exports: what comes back is what was logged, in the axes and with the covariances that are stated."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from exchange_logs import FIX, LATITUDE, LONGITUDE, manoeuvre, two_vehicles
from rosbags.highlevel import AnyReader
from scipy.io import loadmat
from scipy.spatial.transform import Rotation

from auvsim.base.datum import Datum
from auvsim.base.frames import rotation
from auvsim.cli import main
from auvsim.data import log as logs
from auvsim.data.log import Log
from auvsim.exchange import sensor_messages
from auvsim.exchange.motion_messages import covariances
from auvsim.exchange.ros_messages import Ros
from auvsim.identification import log_records, table_records
from auvsim.ros.types import UNKNOWN
from auvsim.sensors.altimeter import AltimeterSettings
from auvsim.sensors.gps import GpsSettings
from auvsim.sensors.imu import ImuSettings
from auvsim.simulation import scenario
from auvsim.simulation.run import run

TO_ENU, TO_FLU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log, and all that is exported of it."""
    path = tmp_path_factory.mktemp("export")
    logs.write(manoeuvre(), path / "trial.nc")
    for kind in ("mcap", "csv", "mat"):
        assert main(["export", str(path / "trial.nc"), "--to", kind]) == 0
    return path


@pytest.fixture(scope="module")
def log(folder: Path) -> Log:
    """The log."""
    return logs.read(folder / "trial.nc")


@pytest.fixture(scope="module")
def messages(folder: Path) -> dict[str, list]:
    """Messages with when they were recorded [s], by topic, as another reader finds them."""
    found: dict[str, list] = {}
    with AnyReader([folder / "trial.mcap"]) as reader:  # which takes the definitions from the file alone
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic.removeprefix("/remus100"), []).append((1e-9 * time, message))
    return found


def xyz(vector) -> list[float]:
    """Its numbers."""
    return [vector.x, vector.y, vector.z]


def seconds(header) -> float:
    """Its stamp [s]."""
    return header.stamp.sec + 1e-9 * header.stamp.nanosec


def test_truth_as_odometry(log: Log, messages: dict[str, list]):
    """Places in ENU, attitudes by matrices written out here, velocities over ground forward, port, up."""
    truth = log.vehicle()["truth"]
    got = [m for _, m in messages["/truth/odometry"]]
    assert len(got) == len(truth["time"])
    assert {m.header.frame_id for m in got} == {"map"}
    assert {m.child_frame_id for m in got} == {"remus100/base_link"}
    np.testing.assert_allclose([seconds(m.header) for m in got], truth["time"], atol=1e-9)
    np.testing.assert_array_equal([xyz(m.pose.pose.position) for m in got], truth["position"] @ TO_ENU.T)
    np.testing.assert_array_equal([xyz(m.twist.twist.linear) for m in got], truth["nu"][:, :3] @ TO_FLU)
    np.testing.assert_array_equal([xyz(m.twist.twist.angular) for m in got], truth["nu"][:, 3:] @ TO_FLU)
    q = [m.pose.pose.orientation for m in got]
    theirs = Rotation.from_quat([[*xyz(o), o.w] for o in q]).as_matrix()
    ours = np.array([TO_ENU @ rotation(*a.tolist()) @ TO_FLU for a in truth["attitude"]])
    np.testing.assert_allclose(theirs, ours, atol=1e-12)
    sway = np.abs(truth["nu"][:, 1]).max()
    assert sway > 0.05  # what a wrong sign of port would show


def test_estimate_as_odometry(log: Log, messages: dict[str, list]):
    """Velocity over ground is that through the water and the current; the covariance is that of finite differences."""
    estimate, names = log.vehicle()["estimate"], log.vehicle().table("estimate")["mean"].labels
    there = np.flatnonzero(estimate["initialised"])
    got = [m for _, m in messages["/estimate/odometry"]]
    assert len(got) == len(there) > 50
    k = there[-1]
    heading, (u, v, r), current = estimate["heading"][k], estimate["velocity"][k], estimate["current"][k]
    turn = rotation(0.0, 0.0, heading)[:2, :2]
    ground = turn.T @ current + np.array([u, v])
    np.testing.assert_allclose(xyz(got[-1].twist.twist.linear), [ground[0], -ground[1], 0.0], atol=1e-12)
    assert got[-1].twist.twist.angular.z == -r
    P = estimate["covariance"][k]
    at = [names.index(n) for n in ("north", "east", "heading", "surge", "sway", "yaw_rate", "current_north",
                                   "current_east")]  # fmt: skip

    def shown(x: np.ndarray) -> np.ndarray:
        c, s = math.cos(x[2]), math.sin(x[2])
        return np.array([x[1], x[0], -x[2], x[3] + c * x[6] + s * x[7], -(x[4] - s * x[6] + c * x[7]), -x[5]])

    x = estimate["mean"][k][at]
    J = np.array([(shown(x + 1e-6 * e) - shown(x - 1e-6 * e)) / 2e-6 for e in np.eye(8)]).T
    Q = J @ P[np.ix_(at, at)] @ J.T
    pose, twist = (np.array(m.covariance).reshape(6, 6) for m in (got[-1].pose, got[-1].twist))
    axes = np.ix_([0, 1, 5], [0, 1, 5])
    np.testing.assert_allclose(pose[axes], Q[:3, :3], rtol=1e-6, atol=1e-12)  # of the differences
    np.testing.assert_allclose(twist[axes], Q[3:, 3:], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(np.diag(pose)[2:5], [0.05**2 + 0.1**2, UNKNOWN, UNKNOWN])
    assert abs(Q[0, 2]) > 1e-9  # of east and yaw: what a wrong sign would show


def test_covariance_of_what_is_not_estimated():
    """States that a filter lacks are of unknown variance, not of none."""
    pose, twist = covariances(np.diag([4.0, 9.0]), ("north", "east"), 0.3, (0.1, 0.2), 0.01)
    np.testing.assert_array_equal(np.diag(pose), [9.0, 4.0, 0.01, UNKNOWN, UNKNOWN, UNKNOWN])
    np.testing.assert_array_equal(twist, UNKNOWN * np.eye(6))


def test_sensors(log: Log, messages: dict[str, list]):
    """Each sensor's numbers in its message's axes; variances of the data sheets; what is not measured says -1."""
    vehicle = log.vehicle()
    gyro = [m for _, m in messages["/gyro"]]
    np.testing.assert_array_equal([xyz(m.angular_velocity) for m in gyro], vehicle["gyro"]["value"] @ TO_FLU)
    assert gyro[0].orientation_covariance[0] == gyro[0].linear_acceleration_covariance[0] == -1.0
    variance = math.radians(0.005) ** 2 * 10.0 + math.radians(0.005) ** 2
    np.testing.assert_allclose(gyro[0].angular_velocity_covariance, (variance * np.eye(3)).ravel())
    compass = [m for _, m in messages["/compass"]]
    psi, pitch, roll = vehicle["compass"]["value"].T
    yaw, nose, port = Rotation.from_quat([[*xyz(m.orientation), m.orientation.w] for m in compass]).as_euler("ZYX").T
    np.testing.assert_allclose(np.cos(yaw - (math.pi / 2 - psi)), 1.0, atol=1e-12)
    np.testing.assert_allclose([nose, port], [-pitch, roll], atol=1e-12)
    assert compass[0].angular_velocity_covariance[0] == -1.0
    np.testing.assert_allclose(compass[0].orientation_covariance[8], math.radians(1.0) ** 2 + math.radians(0.5) ** 2)
    pressure = [m for _, m in messages["/depth"]]
    water = 1026.0 * 9.81
    np.testing.assert_allclose(
        [(m.fluid_pressure - 101325.0) / water for m in pressure], vehicle["depth"]["value"][:, 0], atol=1e-9
    )
    np.testing.assert_allclose(pressure[0].variance, water**2 * (0.05**2 + 0.1**2))
    for name, first, mode in (("bottom", 0, 1), ("water", 3, 2)):
        track = [m for _, m in messages[f"/dvl/{name}"]]
        values = vehicle["dvl"]["value"][:, first : first + 3]
        values = values[np.isfinite(values).all(axis=1)]
        np.testing.assert_array_equal([xyz(m.velocity) for m in track], values)  # forward, starboard, down
        assert {m.velocity_mode for m in track} == {mode}


def test_positions_and_commands(log: Log, messages: dict[str, list]):
    """USBL packets that arrived, recorded when they did; satellite fixes on the sphere's scale; joints with units."""
    vehicle = log.vehicle()
    usbl = vehicle["usbl"]
    arrived = np.isfinite(usbl["received"])
    packets = sorted(messages["/usbl"], key=lambda row: seconds(row[1].header))
    assert len(packets) == arrived.sum() > 5
    np.testing.assert_allclose([t for t, _ in packets], usbl["received"][arrived], atol=1e-6)
    _, last = packets[-1]
    x, y, z = value = usbl["value"][arrived][-1][:3]
    heading, pitch, roll = usbl["value"][arrived][-1][3:6]
    np.testing.assert_allclose(xyz(last.relative_position), rotation(roll, pitch, heading) @ value, atol=1e-12)
    assert last.range == pytest.approx(math.sqrt(x * x + y * y + z * z), rel=1e-6)  # a float of four bytes
    assert last.bearing == pytest.approx(math.atan2(y, x), rel=1e-6)
    assert last.elevation == pytest.approx(math.atan2(-z, math.hypot(x, y)), rel=1e-5)
    fixes = [m for _, m in messages["/gps"]]
    north, east = vehicle["gps"]["value"].T
    np.testing.assert_allclose([(m.latitude - LATITUDE) * 111.06e3 for m in fixes], north, rtol=2e-3, atol=0.05)
    across = 111.32e3 * math.cos(math.radians(LATITUDE))
    np.testing.assert_allclose([(m.longitude - LONGITUDE) * across for m in fixes], east, rtol=5e-3, atol=0.05)
    assert fixes[0].position_covariance[0] == pytest.approx(FIX["noise"] ** 2)
    command = [m for _, m in messages["/command"]]
    assert command[0].name == ["rudder_command", "elevator_command", "shaft_speed_command"]
    np.testing.assert_array_equal([m.position[0] for m in command], vehicle["command"]["rudder"])
    np.testing.assert_array_equal([m.velocity[2] for m in command], vehicle["command"]["shaft_speed"])
    assert np.isnan(command[0].position[2])
    assert np.isnan(command[0].velocity[0])


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_reads_back_to_the_same_data(folder: Path, kind: str):
    """CSV bit for bit; MCAP to a nanosecond of the stamps, and of headings to the rounding of a quaternion."""
    (ours,), *_ = log_records.signals(folder / "trial.nc")
    (theirs,), _ = table_records.signals(folder / f"trial.{kind}", {})
    first = float(ours.signals["rudder"].times[0])
    exact = kind == "csv"
    for name, signal in ours.signals.items():
        np.testing.assert_allclose(theirs.signals[name].times, signal.times - first, atol=2e-9)
        turns = theirs.signals[name].values[0] - signal.values[0] if name == "heading" else 0.0
        tolerance = 0.0 if exact else 1e-9 if name == "heading" else 0.0
        np.testing.assert_allclose(theirs.signals[name].values - turns, signal.values, rtol=0.0, atol=tolerance)
        assert abs(math.remainder(turns, 2.0 * math.pi)) < 1e-9
    assert len(ours.signals) == 10


def test_covariances_come_back(folder: Path, messages: dict[str, list]):
    """The deviations that a reader of the MCAP file has are those of the data sheets, noise and bias together."""
    (found,), notes = table_records.signals(folder / "trial.mcap", {})
    assert found.deviations["heading"] == pytest.approx(math.radians(math.hypot(1.0, 0.5)))
    assert found.deviations["yaw_rate"] == pytest.approx(math.radians(0.005) * math.sqrt(11.0))
    fixed = {m.pose.covariance[0] for _, m in messages["/usbl/position"]}
    assert found.deviations["north"] == found.deviations["east"] == pytest.approx(math.sqrt(fixed.pop()))
    assert not any("scatter" in note for note in notes)


def test_sensors_of_a_survey():
    """An inertial unit, an altimeter and GPS: axes, limits and variances, of which a slow error is part."""
    kinds = {"imu": {"kind": "imu", "bias": 0.02}, "altimeter": {"kind": "altimeter", "beam_deg": 9.0}, "gps": FIX}
    straight = {"kind": "straight", "duration": 4.0, "speed": 1.0, "approach": 1.0}
    plan = scenario.parse({"mission": {"kind": "manoeuvre", "manoeuvre": straight}, "sensors": kinds, "duration": 4.0})
    vehicle, ros = run(plan, seed=2).vehicle(), Ros()
    datum = Datum(latitude=LATITUDE, longitude=LONGITUDE)

    def made(name: str, kind: str, sheet) -> tuple[str, list]:
        (stream,) = sensor_messages.sensor(ros, vehicle, name, kind, sheet, plan, datum)
        return stream.type, [message for *_, message in stream.rows]

    name, inertial = made("imu", "imu", ImuSettings(bias=0.02))
    values = vehicle["imu"]["value"]
    assert name == "sensor_msgs/msg/Imu"
    np.testing.assert_array_equal([xyz(m.angular_velocity) for m in inertial], values[:, :3] @ TO_FLU)
    np.testing.assert_array_equal([xyz(m.linear_acceleration) for m in inertial], values[:, 3:] @ TO_FLU)
    assert np.mean([m.linear_acceleration.z for m in inertial]) == pytest.approx(9.8, abs=0.3)  # upwards at rest
    np.testing.assert_allclose(inertial[0].linear_acceleration_covariance[4], 7e-4**2 * 10.0 + 0.02**2)
    np.testing.assert_allclose(
        inertial[0].angular_velocity_covariance[8], math.radians(0.005) ** 2 * 10.0 + math.radians(0.005) ** 2
    )
    assert inertial[0].orientation_covariance[0] == -1.0
    name, altitudes = made("altimeter", "altimeter", AltimeterSettings(beam_deg=9.0))
    assert name == "sensor_msgs/msg/Range"
    np.testing.assert_array_equal([m.range for m in altitudes], vehicle["altimeter"]["value"][:, 0])
    first = altitudes[0]
    assert (first.min_range, first.max_range, first.header.frame_id) == (0.3, 50.0, f"{vehicle.name}/altimeter")
    assert first.field_of_view == pytest.approx(math.radians(9.0))
    name, fixes = made("gps", "gps", GpsSettings(noise=0.7, wander=2.0))
    assert name == "sensor_msgs/msg/NavSatFix"
    assert fixes[0].position_covariance[0] == pytest.approx(0.7**2 + 2.0**2)


def test_matlab_has_all(folder: Path, log: Log):
    """Every array of the log is in its place, with its unit."""
    found = loadmat(folder / "trial.mat", simplify_cells=True)
    for group, columns in log.groups.items():
        node, units = found, found["units"]
        for key in group.split("/"):
            node, units = node[key], units.get(key, {})
        for name, values in columns.items():
            assert units.get(name, "") == log.tables[group][name].units
            if values.size and values.dtype != object:
                np.testing.assert_array_equal(np.atleast_1d(node[name]).reshape(values.shape), values)
    assert found["attributes"]["seed"] == 3


def test_foxglove_layout(folder: Path, messages: dict[str, list]):
    """Every panel is in the tree once, and every path is of a topic that the file has."""
    made = json.loads((folder / "trial.foxglove.json").read_text())

    def leaves(node) -> list[str]:
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    tabs = [tab["layout"] for panel in made["configById"].values() for tab in panel.get("tabs", [])]
    names = [name for node in (made["layout"], *tabs) for name in leaves(node)]
    assert sorted(names) == sorted(made["configById"])
    topics = {f"/remus100{t}" if t not in ("/tf", "/rosout") else t for t in messages}
    paths = [path["value"] for panel in made["configById"].values() for path in panel.get("paths", [])]
    assert len(paths) > 10
    assert {path.split(".")[0] for path in paths} <= topics


def test_two_vehicles(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Each has its topics and its CSV; which one is meant is asked, and a namespace says it."""
    logs.write(two_vehicles(), tmp_path / "two.nc")
    for kind in ("mcap", "csv"):
        assert main(["export", str(tmp_path / "two.nc"), "--to", kind]) == 0
    (one,), _ = table_records.signals(tmp_path / "two.auv_2.csv", {})
    bag = str(tmp_path / "two.mcap")
    assert main(["estimate", bag]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert "/auv_1/actuation (sensor_msgs/msg/JointState), /auv_2/actuation (sensor_msgs/msg/JointState)" in said
    (tmp_path / "map.yaml").write_text("namespace: /auv_2\n")
    from auvsim.identification.columns import read_map

    (two,), _ = table_records.signals(tmp_path / "two.mcap", read_map(tmp_path / "map.yaml"))
    np.testing.assert_allclose(two.signals["heading"].values, one.signals["heading"].values, atol=1e-9)


def test_bad_input(tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]):
    """One line and exit code 2."""
    (tmp_path / "cut.nc").write_bytes((folder / "trial.nc").read_bytes()[:9000])
    cases = {
        ("nowhere.nc", "--to", "csv"): "nowhere.nc",
        (str(tmp_path / "cut.nc"), "--to", "mat"): "cut.nc",
        (str(folder / "trial.nc"), "--to", "csv", "--out", "x.txt"): "ends in .csv",
        (str(folder / "trial.nc"), "--to", "bag"): "--to",
    }
    for arguments, part in cases.items():
        assert main(["export", *arguments]) == 2
        said = capsys.readouterr().err.strip().splitlines()
        assert len(said) == 1
        assert part in said[0]


def test_missing_packages(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Without them one line says what to install."""
    import sys

    for name in ("mcap.writer", "rosbags"):
        monkeypatch.setitem(sys.modules, name, None)
    assert main(["export", str(folder / "trial.nc"), "--to", "mcap", "--out", str(folder / "no.mcap")]) == 2
    assert capsys.readouterr().err.strip().endswith("pip install 'auvsim[ros]'")
    from auvsim.ros import types

    types.known.cache_clear()
    assert main(["estimate", str(folder / "trial.mcap")]) == 2
    assert capsys.readouterr().err.strip().endswith("pip install 'auvsim[ros]'")
