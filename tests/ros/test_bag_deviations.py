"""Covariances that messages carry become deviations of samples; what is not filled does not."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from auvsim.identification import table_records
from auvsim.identification.columns import ColumnSettings
from auvsim.identification.signals import DEVIATIONS
from auvsim.ros import types

STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(get_types_from_msg(types._DEFINITIONS["dvl_msgs/msg/DVLBeam"], "dvl_msgs/msg/DVLBeam"))
STORE.register(get_types_from_msg(types._DEFINITIONS[types.WATER_LINKED], types.WATER_LINKED))
STILL = {"rudder": ColumnSettings(constant=0.1), "shaft_speed": ColumnSettings(constant=90.0)}


def make(kind: str, *values: Any) -> Any:
    """A message."""
    return STORE.types[kind](*values)


def header(k: int, frame: str) -> Any:
    """Ten a second."""
    return make("std_msgs/msg/Header", make("builtin_interfaces/msg/Time", k // 10, k % 10 * 10**8), frame)


def vector(x: float, y: float, z: float, kind: str = "Vector3") -> Any:
    """Three numbers."""
    return make(f"geometry_msgs/msg/{kind}", x, y, z)


def diagonal(*variances: float) -> np.ndarray:
    """A covariance with these variances, and 0.1 of them beside each other, so that a wrong place shows."""
    return (np.diag(variances) + 0.1 * np.ones((len(variances), len(variances)))).ravel()


LEVEL = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)


def odometry(k: int, frame: str, pose: np.ndarray, twist: np.ndarray) -> Any:
    """A vehicle that goes straight ahead at 1 m/s."""
    place = make("geometry_msgs/msg/Pose", vector(0.1 * k, 0.0, 0.0, "Point"), LEVEL)
    speed = make("geometry_msgs/msg/Twist", vector(1.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    return make(
        "nav_msgs/msg/Odometry", header(k, frame), "base",
        make("geometry_msgs/msg/PoseWithCovariance", place, pose),
        make("geometry_msgs/msg/TwistWithCovariance", speed, twist),
    )  # fmt: skip


def imu(k: int, attitude: np.ndarray, rates: np.ndarray) -> Any:
    """One that stands still."""
    none = vector(0.0, 0.0, 0.0)
    return make("sensor_msgs/msg/Imu", header(k, "imu"), LEVEL, attitude, none, rates, none, np.zeros(9))


def deviations(path: Path, **topics: Any) -> tuple[dict[str, float], list[str]]:
    """What the reader makes of a bag of 200 messages each, and its notes."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for name, of in topics.items():
            connection = writer.add_connection(f"/{name}", (kind := of(1).__msgtype__), typestore=STORE)
            for k in range(1, 201):
                writer.write(connection, k * 10**8, STORE.serialize_cdr(of(k), kind))
    (found,), notes = table_records.signals(path, STILL)
    return {name: found.deviation(name) for name in found.signals if name in DEVIATIONS}, notes


@pytest.mark.parametrize(("frame", "first", "second"), [("odom", "east", "north"), ("odom_ned", "north", "east")])
def test_odometry(tmp_path: Path, frame: str, first: str, second: str):
    """Variances of x and y are of east and north, in NED of north and east; of yaw and the twist in either."""
    pose, twist = diagonal(3.9, 15.9, 1.0, 1.0, 1.0, 0.3), diagonal(0.06, 0.15, 1.0, 1.0, 1.0, 0.021)
    found, _ = deviations(tmp_path / "bag", odometry=lambda k: odometry(k, frame, pose, twist))
    want = {first: 4.0, second: 16.0, "heading": 0.4, "ground_surge": 0.16, "ground_sway": 0.25, "yaw_rate": 0.121}
    assert found == pytest.approx({name: math.sqrt(value) for name, value in want.items()})


@pytest.mark.parametrize("of", [0.0, -1.0, 1e6, math.nan])
def test_unknown(tmp_path: Path, of: float):
    """0, -1, a filter's 1e6 and NaN are no deviations."""
    unknown = np.full(36, of)
    found, _ = deviations(tmp_path / "bag", odometry=lambda k: odometry(k, "odom", unknown, unknown))
    none, _ = deviations(tmp_path / "other", odometry=lambda k: odometry(k, "odom", np.zeros(36), np.zeros(36)))
    assert found == none
    assert found["north"] == DEVIATIONS["north"]


def test_sensors(tmp_path: Path):
    """Satellite fixes in metres to the north and east, rates of an inertial unit, the DVL's figure of merit."""

    def fix(k: int, kind: int) -> Any:
        status = make("sensor_msgs/msg/NavSatStatus", 0, 1)
        place = (60.0 + 1e-6 * k, 10.0, 0.0)
        return make("sensor_msgs/msg/NavSatFix", header(k, "gps"), status, *place, diagonal(3.9, 15.9, 1.0), kind)

    def dvl(k: int) -> Any:
        valid = k % 3 > 0
        return make(
            types.WATER_LINKED, header(k, "dvl"), 0.0, vector(1.0, 0.0, 0.0), 0.07 if valid else 9.0, np.zeros(0), 0.0,
            [], valid, 0, 0, 0, "",
        )  # fmt: skip

    rates = diagonal(5.0, 5.0, 2.0) * 1e-4
    found, _ = deviations(tmp_path / "bag", gps=lambda k: fix(k, 2), imu=lambda k: imu(k, np.zeros(9), rates), dvl=dvl)
    assert found["north"] == pytest.approx(4.0, rel=1e-4)  # the latitude moves by 2e-4 deg
    assert found["east"] == pytest.approx(2.0, rel=1e-4)
    assert found["yaw_rate"] == pytest.approx(math.sqrt(2.1e-4))
    assert found["ground_surge"] == found["ground_sway"] == pytest.approx(0.07)
    unknown, _ = deviations(tmp_path / "other", gps=lambda k: fix(k, 0), imu=lambda k: imu(k, np.zeros(9), rates))
    assert unknown["north"] == DEVIATIONS["north"]


def test_scatter_counts_where_a_covariance_says_less(tmp_path: Path):
    """A driver's constant of 1e-8 beside samples that scatter by 0.004 rad/s is told, and not believed."""
    generator = np.random.default_rng(4)
    noise = 0.004 * generator.standard_normal(201)

    def shaken(k: int, variance: float) -> Any:
        message = imu(k, np.zeros(9), np.diag([1.0, 1.0, variance]).ravel())
        message.angular_velocity.z = float(noise[k])
        return message

    found, notes = deviations(tmp_path / "bag", imu=lambda k: shaken(k, 1e-8))
    assert found["yaw_rate"] == pytest.approx(0.004, rel=0.2)  # of 200 samples' median of third differences
    assert any("/imu.yaw_rate: its samples scatter by" in note for note in notes)
    good, notes = deviations(tmp_path / "other", imu=lambda k: shaken(k, 0.01**2))
    assert good["yaw_rate"] == pytest.approx(0.01)
    assert not any("scatter" in note for note in notes)
