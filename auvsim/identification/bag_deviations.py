"""Standard deviations of samples by the covariances that messages carry."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from auvsim.identification.places import DEGREE
from auvsim.ros import types
from auvsim.ros.bags import Topic

Variance = tuple[str, str]  # a quantity, and the field that holds its variance


def is_ned(topic: Topic) -> bool:
    """Whether a topic's frame is north-east-down and forward-starboard-down, by its name."""
    return "ned" in topic.frame.lower().replace("/", "_").split("_")


def deviations(topic: Topic) -> dict[str, float]:
    """Standard deviation of a sample by quantity [m, rad, m/s, rad/s], where most messages say it; their median.

    By the messages' own definitions -1 and 0 mean unknown; `types.UNKNOWN` and more is what filters write of what they
    do not estimate. Latitude and longitude are in degrees, as the samples are.
    """
    found = {}
    for quantity, path in _BY_TYPE.get(topic.type, lambda _: iter(()))(topic):
        variances = topic.fields[path]
        filled = variances[np.isfinite(variances) & (variances > 0.0) & (variances < types.UNKNOWN)]
        if 2 * len(filled) > len(variances):
            found[quantity] = math.sqrt(float(np.median(filled)))
    if topic.type == types.WATER_LINKED and "fom" in topic.fields:
        merit = topic.fields["fom"][topic.fields["velocity_valid"] > 0.0]
        if len(merit) and (merit > 0.0).all():
            found |= dict.fromkeys(("ground_surge", "ground_sway"), float(np.median(merit)))
    if "latitude" in found:
        latitude = math.radians(float(np.nanmedian(topic.fields["latitude"])))
        found["latitude"] /= DEGREE
        found["longitude"] /= DEGREE * math.cos(latitude)
    return found


def _imu(topic: Topic) -> Iterator[Variance]:
    yield from (("heading", "orientation_covariance[8]"), ("yaw_rate", "angular_velocity_covariance[8]"))


def _satellites(topic: Topic) -> Iterator[Variance]:
    if (topic.fields["position_covariance_type"] > 0.0).all():  # else unknown, whatever the numbers are
        yield from (("longitude", "position_covariance[0]"), ("latitude", "position_covariance[4]"))


def _pose(topic: Topic) -> Iterator[Variance]:
    x, y = ("north", "east") if is_ned(topic) else ("east", "north")
    yield from ((x, "pose.covariance[0]"), (y, "pose.covariance[7]"), ("heading", "pose.covariance[35]"))


def _twist(*over: str) -> Callable[[Topic], Iterator[Variance]]:
    def found(topic: Topic) -> Iterator[Variance]:
        for before in over:
            yield from ((f"{before}surge", "twist.covariance[0]"), (f"{before}sway", "twist.covariance[7]"))
        yield "yaw_rate", "twist.covariance[35]"

    return found


def _odometry(topic: Topic) -> Iterator[Variance]:
    yield from _pose(topic)
    yield from _twist("ground_")(topic)


def _dvl(topic: Topic) -> Iterator[Variance]:
    for before in ("ground_", ""):
        yield from ((f"{before}surge", "velocity_covar[0]"), (f"{before}sway", "velocity_covar[4]"))


_BY_TYPE: dict[str, Callable[[Topic], Iterator[Variance]]] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/NavSatFix": _satellites,
    "nav_msgs/msg/Odometry": _odometry,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose,
    "geometry_msgs/msg/TwistWithCovarianceStamped": _twist("ground_", ""),
    types.DVL: _dvl,
}
