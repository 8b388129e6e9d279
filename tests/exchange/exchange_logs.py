"""Logs that are exported, and bags made of them without the exporter."""

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from auvsim.data.log import Log, VehicleLog
from auvsim.simulation import scenario
from auvsim.simulation.run import run

LATITUDE, LONGITUDE = 41.18, -8.7
FIX = {"kind": "fix", "rate": 0.5, "noise": 0.4}


def manoeuvre(seed: int = 3, duration: float = 60.0) -> Log:
    """A multisine with steps of speed in a current, all sensors on, from a datum."""
    steps = [1.2, 1.7, 1.4]
    settings = {"kind": "multisine", "duration": duration, "approach": 5.0, "speed_steps": steps, "step_time": 15.0}
    on = {"enabled": True}
    pinned = {
        "mission": {"kind": "manoeuvre", "manoeuvre": settings},
        "vehicle": {"start": {"range": 120.0, "bearing_deg": 35.0, "heading_deg": 70.0, "depth": 12.0}},
        "current": {"kind": "uniform", "speed": 0.15, "direction_deg": 100.0},
        "sensors": {"dvl": on, "gyro": on, "gps": FIX},
        "datum": {"latitude": LATITUDE, "longitude": LONGITUDE},
    }
    return run(scenario.parse(pinned), seed=seed)


def two_vehicles() -> Log:
    """Two that go straight for ten seconds."""
    straight = {"kind": "manoeuvre", "manoeuvre": {"kind": "straight", "duration": 12.0, "speed": 1.0, "approach": 1.0}}
    starts = {"auv_1": {"north": 30.0, "east": 10.0}, "auv_2": {"north": -30.0, "east": 60.0}}
    own = {"model": "remus100", "mission": straight, "estimator": {"kind": "dead_reckoning"}}
    vehicles = {name: {**own, "start": {"depth": 10.0, **start}} for name, start in starts.items()}
    return run(scenario.parse({"vehicles": vehicles, "duration": 12.0}), seed=1)


def bag(log: VehicleLog, path: Path, storage: str, late: float = 0.0, stamped: bool = True) -> None:
    """A rosbag2 of the compass, gyro, DVL, rudder and shaft as another program would record it.

    Args:
        log: Of the vehicle.
        path: Folder to be made.
        storage: sqlite3 or mcap.
        late: By which messages are recorded after their stamps [s].
        stamped: Whether the headers have stamps.
    """
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(
        get_types_from_msg(
            "std_msgs/Header header\nfloat64 time\ngeometry_msgs/Vector3 velocity\nfloat64 fom\nfloat64[] covariance\n"
            "float64 altitude\ndvl_msgs/DVLBeam[] beams\nbool velocity_valid\nint64 status\nint64 time_of_validity\n"
            "int64 time_of_transmission\nstring form\n",
            "dvl_msgs/msg/DVL",
        )
        | get_types_from_msg(
            "int64 id\nfloat64 velocity\nfloat64 distance\nfloat64 rssi\nfloat64 nsd\nbool valid\n",
            "dvl_msgs/msg/DVLBeam",
        )
    )

    def make(kind: str, *values: Any) -> Any:
        return store.types[kind](*values)

    def header(t: float) -> Any:
        ns = round((t + 1.7e9) * 1e9) if stamped else 0
        stamp = make("builtin_interfaces/msg/Time", *divmod(ns, 10**9))
        return make("std_msgs/msg/Header", stamp, "odom")

    def vector(x: float, y: float, z: float) -> Any:
        return make("geometry_msgs/msg/Vector3", float(x), float(y), float(z))

    none, zeros = np.array([-1.0, *[0.0] * 8]), np.zeros(9)
    level = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    rows: dict[str, tuple[str, list[tuple[float, Any]]]] = {}
    compass = []
    for t, (psi, pitch, roll) in zip(log["compass"]["time"], log["compass"]["value"], strict=True):
        ned = Rotation.from_euler("ZYX", [psi, pitch, roll]).as_matrix()
        x, y, z, w = Rotation.from_matrix(
            np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ ned @ np.diag([1, -1, -1])
        ).as_quat()
        q = make("geometry_msgs/msg/Quaternion", x, y, z, w)
        compass.append((t, make("sensor_msgs/msg/Imu", header(t), q, zeros, vector(0, 0, 0), none, vector(0, 0, 0),
                                none)))  # fmt: skip
    rows["/ahrs"] = ("sensor_msgs/msg/Imu", compass)
    rows["/gyro"] = ("sensor_msgs/msg/Imu", [
        (t, make("sensor_msgs/msg/Imu", header(t), level, none, vector(p, -q, -r), zeros, vector(0, 0, 0), none))
        for t, (p, q, r) in zip(log["gyro"]["time"], log["gyro"]["value"], strict=True)
    ])  # fmt: skip
    rows["/dvl/data"] = ("dvl_msgs/msg/DVL", [
        (t, make("dvl_msgs/msg/DVL", header(t), 0.0, vector(*np.nan_to_num(v[:3])), 0.0, np.zeros(0), 0.0, [],
                 bool(np.isfinite(v[0])), 0, 0, 0, ""))
        for t, v in zip(log["dvl"]["time"], log["dvl"]["value"], strict=True)
    ])  # fmt: skip
    fins = []
    for t, v in zip(log["feedback"]["time"], log["feedback"]["value"], strict=True):
        rudder = np.array([0.5 * (v[0] + v[1])])  # of the REMUS-100: the mean of its two rudders
        values = (np.append(rudder, 0.0), np.append([0.0], v[-1]), np.zeros(0))
        fins.append((t, make("sensor_msgs/msg/JointState", header(t), ["rudder", "shaft"], *values)))
    rows["/fins"] = ("sensor_msgs/msg/JointState", fins)
    with Writer(path, version=9, storage_plugin=getattr(StoragePlugin, storage.upper())) as writer:
        for topic, (kind, messages) in rows.items():
            connection = writer.add_connection(topic, kind, typestore=store)
            for t, message in messages:
                writer.write(connection, round((t + 1.7e9 + late) * 1e9), store.serialize_cdr(message, kind))
