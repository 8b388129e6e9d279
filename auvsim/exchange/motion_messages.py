"""ROS 2 messages of how a vehicle moved, what its estimator made of it, and what it was told to do."""

import math
from typing import Any

import numpy as np

from auvsim.base.datum import Datum
from auvsim.base.frames import Array, euler_to_quaternion, flip, rotation
from auvsim.data.log import VehicleLog
from auvsim.exchange.ros_messages import MAP, Ros, Rows
from auvsim.ros.frames import enu, enu_quaternion
from auvsim.ros.types import UNKNOWN

_PLANAR = ("north", "east", "heading", "surge", "sway", "yaw_rate", "current_north", "current_east")


def truth(ros: Ros, log: VehicleLog) -> Rows:
    """Odometry of the truth."""
    truth, exact = log["truth"], np.zeros((6, 6))
    for t, place, q, nu in zip(*(truth[k] for k in ("time", "position", "quaternion", "nu")), strict=True):
        twist = ros.make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=ros.twist(flip(nu[:3]), flip(nu[3:])), covariance=exact.ravel(),
        )  # fmt: skip
        yield t, t, _odometry(ros, log, t, ros.pose(place, q, exact), twist)


def transforms(ros: Ros, log: VehicleLog) -> Rows:
    """The true pose as a transform from `map`."""
    truth = log["truth"]
    for t, place, q in zip(*(truth[k] for k in ("time", "position", "quaternion")), strict=True):
        transform = ros.make(
            "geometry_msgs/msg/Transform",
            translation=ros.vector(enu(place)), rotation=ros.quaternion(enu_quaternion(q)),
        )  # fmt: skip
        stamped = ros.make(
            "geometry_msgs/msg/TransformStamped",
            header=ros.header(t, MAP), child_frame_id=f"{log.name}/base_link", transform=transform,
        )  # fmt: skip
        yield t, t, ros.make("tf2_msgs/msg/TFMessage", transforms=[stamped])


def current(ros: Ros, log: VehicleLog) -> Rows:
    """The current at the vehicle, in ENU."""
    for t, current in zip(log["truth"]["time"], log["truth"]["current"], strict=True):
        twist = ros.twist(enu(current), np.zeros(3))
        yield t, t, ros.make("geometry_msgs/msg/TwistStamped", header=ros.header(t, MAP), twist=twist)


def through_water(ros: Ros, log: VehicleLog) -> Rows:
    """The velocity through the water, in the body frame."""
    truth, frame = log["truth"], f"{log.name}/base_link"
    for t, attitude, nu, current in zip(*(truth[k] for k in ("time", "attitude", "nu", "current")), strict=True):
        through = nu[:3] - rotation(*attitude.tolist()).T @ current
        twist = ros.twist(flip(through), flip(nu[3:]))
        yield t, t, ros.make("geometry_msgs/msg/TwistStamped", header=ros.header(t, frame), twist=twist)


def true_fixes(ros: Ros, log: VehicleLog, datum: Datum) -> Rows:
    """The true position as a satellite fix once a second."""
    truth = log["truth"]
    every = max(1, round(1.0 / float(np.median(np.diff(truth["time"])))))
    for t, place in zip(truth["time"][::every], truth["position"][::every], strict=True):
        yield t, t, ros.satellite(t, f"{log.name}/base_link", place, datum, np.zeros(3))


def estimates(ros: Ros, log: VehicleLog, depth_variance: float) -> Rows:
    """Odometry of the estimate once it is initialised: velocity over ground by that through the water and current."""
    columns = log["estimate"]
    names = log.table("estimate")["mean"].labels
    keys = ("time", "position", "heading", "velocity", "current", "covariance", "initialised")
    for t, place, heading, (u, v, r), (north, east), covariance, there in zip(*(columns[k] for k in keys), strict=True):
        if not there:
            continue
        c, s = math.cos(heading), math.sin(heading)
        pose, twist = covariances(covariance, names, heading, (north, east), depth_variance)
        ground = np.array([u + c * north + s * east, v - s * north + c * east, 0.0])
        message = ros.make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=ros.twist(flip(ground), flip(np.array([0.0, 0.0, r]))), covariance=twist.ravel(),
        )  # fmt: skip
        yield t, t, _odometry(ros, log, t, ros.pose(place, euler_to_quaternion(0.0, 0.0, heading), pose), message)


def covariances(
    covariance: Array, names: tuple[str, ...], heading: float, current: tuple[float, float], depth_variance: float
) -> tuple[Array, Array]:
    """Covariances (6, 6) of an odometry message: of the pose in ENU, and of the twist over ground in the body.

    Args:
        covariance: (n, n) of the states.
        names: Of the states.
        heading: [rad].
        current: North, east [m/s].
        depth_variance: Of the gauge [m2].
    """
    known = [k for k, name in enumerate(_PLANAR) if name in names]
    P = np.zeros((8, 8))
    P[np.ix_(known, known)] = covariance[np.ix_(*2 * ([names.index(_PLANAR[k]) for k in known],))]
    c, s = math.cos(heading), math.sin(heading)
    north, east = current
    # (6, 8) east, north, yaw about up; then over ground forward, port, yaw rate about up, by the planar states.
    J = np.zeros((6, 8))
    J[0, 1] = J[1, 0] = 1.0
    J[2, 2], J[5, 5] = -1.0, -1.0
    J[3, [3, 6, 7, 2]] = 1.0, c, s, c * east - s * north
    J[4, [4, 6, 7, 2]] = -1.0, s, -c, c * north + s * east
    Q = J @ P @ J.T
    pose, twist = np.diag(np.full(6, UNKNOWN)), np.diag(np.full(6, UNKNOWN))
    for target, axes, first in ((pose, (0, 1, 5), 0), (twist, (0, 1, 5), 3)):
        there = [k for k in range(3) if Q[first + k, first + k] > 0.0]
        at = [axes[k] for k in there]
        target[np.ix_(at, at)] = Q[np.ix_([first + k for k in there], [first + k for k in there])]
    pose[2, 2] = depth_variance
    return pose, twist


def commands(ros: Ros, log: VehicleLog) -> Rows:
    """What the controller told the actuators."""
    table = {name: variable for name, variable in log.table("command").items() if name != "time"}
    values = np.column_stack([log["command"][name] for name in table]).astype(float)
    names, units = [f"{name}_command" for name in table], [variable.units for variable in table.values()]
    for t, row in zip(log["command"]["time"], values, strict=True):
        yield t, t, ros.joints(t, names, units, row)


def _odometry(ros: Ros, log: VehicleLog, t: float, pose: Any, twist: Any) -> Any:
    return ros.make(
        "nav_msgs/msg/Odometry",
        header=ros.header(t, MAP), child_frame_id=f"{log.name}/base_link", pose=pose, twist=twist,
    )  # fmt: skip
