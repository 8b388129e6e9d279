"""ROS 2 messages of plain numbers and arrays, as more than one topic needs them."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from auvsim.base.datum import Datum
from auvsim.base.frames import Array, euler_to_quaternion
from auvsim.ros import types
from auvsim.ros.frames import enu, enu_quaternion
from auvsim.ros.types import UNKNOWN

MAP = "map"
Rows = Iterator[tuple[float, float, Any]]  # stamp [s], when recorded [s], message


class Stream(NamedTuple):
    """The messages of one topic."""

    topic: str
    type: str
    rows: Rows


class Ros:
    """Makes messages, with numbers and arrays as their classes want them."""

    def __init__(self) -> None:
        self._types = types.store().types

    def make(self, name: str, /, **fields: Any) -> Any:
        """A message of a type `package/msg/Name`."""
        return self._types[name](**fields)

    def time(self, stamp: float) -> Any:
        """A stamp [s]."""
        seconds, rest = divmod(round(stamp * 1e9), 1_000_000_000)
        return self.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)

    def header(self, stamp: float, frame: str) -> Any:
        """A header."""
        return self.make("std_msgs/msg/Header", stamp=self.time(stamp), frame_id=frame)

    def vector(self, values: Any, name: str = "Vector3") -> Any:
        """A Vector3 or Point of three numbers."""
        x, y, z = (float(v) for v in values)
        return self.make(f"geometry_msgs/msg/{name}", x=x, y=y, z=z)

    def quaternion(self, wxyz: Array) -> Any:
        """A quaternion."""
        w, x, y, z = wxyz.tolist()
        return self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, position: Array, quaternion: Array, covariance: Array) -> Any:
        """A pose in ENU with its covariance (6, 6), of positions and attitudes in NED."""
        pose = self.make(
            "geometry_msgs/msg/Pose",
            position=self.vector(enu(position), "Point"), orientation=self.quaternion(enu_quaternion(quaternion)),
        )  # fmt: skip
        return self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance.ravel())

    def twist(self, linear: Array, angular: Array) -> Any:
        """A twist, of whatever axes the numbers are in."""
        return self.make("geometry_msgs/msg/Twist", linear=self.vector(linear), angular=self.vector(angular))

    def satellite(self, t: float, frame: str, place: Array, datum: Datum, variances: Array) -> Any:
        """A satellite fix of a place (3,) in NED [m] with variances (3,) [m2]."""
        geodetic = datum.geodetic(place)
        return self.make(
            "sensor_msgs/msg/NavSatFix",
            header=self.header(t, frame),
            status=self.make("sensor_msgs/msg/NavSatStatus", status=0, service=1),
            latitude=float(geodetic.latitude), longitude=float(geodetic.longitude), altitude=float(geodetic.height),
            position_covariance=np.diag(variances).ravel(), position_covariance_type=2,
        )  # fmt: skip

    def joints(self, t: float, names: list[str], units: list[str], values: Array) -> Any:
        """Angles as positions, speeds as velocities, forces and moments as efforts; NaN in the other two."""
        position, velocity, effort = (np.full(len(names), math.nan) for _ in range(3))
        for k, (unit, value) in enumerate(zip(units, values.tolist(), strict=True)):
            (velocity if unit.endswith("/s") else effort if unit.startswith("N") else position)[k] = value
        return self.make(
            "sensor_msgs/msg/JointState",
            header=self.header(t, ""), name=names, position=position, velocity=velocity, effort=effort,
        )  # fmt: skip

    def inertial(self, t: float, frame: str, **known: Any) -> Any:
        """An Imu message that knows its attitude or its rates, and says -1 of the rest."""
        lacking = np.array([-1.0, *[0.0] * 8])
        fields = {
            "orientation": self.quaternion(np.array([1.0, 0.0, 0.0, 0.0])),
            "angular_velocity": self.vector(np.zeros(3)),
            "linear_acceleration": self.vector(np.zeros(3)),
            **{f"{name}_covariance": lacking for name in ("orientation", "angular_velocity", "linear_acceleration")},
        }
        return self.make("sensor_msgs/msg/Imu", header=self.header(t, frame), **fields | known)

    def placed(self, t: float, place: Array, variance: float) -> Any:
        """A horizontal position [m] in `map`, of no depth and attitude."""
        covariance = np.diag([variance, variance, *[UNKNOWN] * 4])
        pose = self.pose(place, euler_to_quaternion(0.0, 0.0, 0.0), covariance)
        return self.make("geometry_msgs/msg/PoseWithCovarianceStamped", header=self.header(t, MAP), pose=pose)
