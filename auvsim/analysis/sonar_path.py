"""Navigation by a sonar, from a log: keyframes and their path, loop closures, errors with and without the turn.

No frame shows a turn of the whole path about the point where the dive began; so errors are also given after the
rotation about it that brings the estimated lanes closest to the true ones.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvsim.base.frames import Array, wrap
from auvsim.data.log import VehicleLog
from auvsim.data.phases import interpolate, phase_at
from estimators.map_path.frames import SectorGrid
from estimators.map_path.poses import rotation_to, turned

LANES = "lanes"  # phase over which the rotation is fitted; without it, all after the dive began


class SonarPath(NamedTuple):
    """The keyframes, given all that was measured until the run ended."""

    times: Array  # (k,) stamps [s]
    poses: Array  # (k, 3) north, east [m], heading [rad]
    covariances: Array  # (k, 3, 3) of the poses
    images: Array  # (k, rows, columns) filtered echo
    grid: SectorGrid


class Closures(NamedTuple):
    """Ends of the loop closures that were believed; one may have several earlier ones."""

    times: Array  # (n,) when each was believed [s]
    later: Array  # (n,) stamp of its frame [s]
    earlier: Array  # (n,) stamp of a keyframe that was matched [s]


class TurnedErrors(NamedTuple):
    """Errors from the dive point on, after the rotation about it."""

    times: Array  # (n,) [s]
    errors: Array  # (n, 2) north, east [m]
    angle: float  # by which the estimated path was turned [rad]
    lanes: NDArray[np.bool_]  # (n,) which the rotation was fitted to

    @property
    def rms(self) -> float:
        """Over the lanes [m]."""
        return math.sqrt(float(np.square(self.errors[self.lanes]).sum(axis=1).mean()))


def sonar_path(log: VehicleLog) -> SonarPath | None:
    """The keyframes of a log; None where it holds none."""
    if "path" not in log or not log["path"]["frame"].any():
        return None
    rows = {name: values[log["path"]["frame"]] for name, values in log["path"].items()}
    grid = SectorGrid(
        cell=float(rows["cell"][0]),
        shape=rows["image"].shape[1:],
        ranges=(float(rows["nearest"][0]), float(rows["farthest"][0])),
        half_sector=float(rows["half_sector"][0]),
        ahead=float(rows["ahead"][0]),
    )
    images = rows["scale"][:, None, None] * rows["image"]
    return SonarPath(rows["time"], rows["pose"], rows["covariance"], images, grid)


def closures(log: VehicleLog) -> Closures:
    """The loop closures of a log."""
    if "closures" not in log:
        return Closures(*np.zeros((3, 0)))
    rows = log["closures"]
    return Closures(rows["time"], rows["later"], rows["earlier"])


def tilt(log: VehicleLog, times: Array) -> Array:
    """Roll and pitch (k, 2) [rad] at some times, by the compass; NaN without one."""
    if "compass" not in log or not len(log["compass"]["time"]):
        return np.full((len(times), 2), math.nan)
    return interpolate(times, log["compass"]["time"], log["compass"]["value"][:, [2, 1]])


def depth(log: VehicleLog, times: Array) -> Array:
    """Estimated depth (k,) [m] at some times."""
    return interpolate(times, log["estimate"]["time"], log["estimate"]["position"][:, 2])


def path_errors(log: VehicleLog, path: SonarPath) -> Array:
    """Errors (k, 3) of the keyframes' poses [m, m, rad]."""
    truth = log["truth"]
    true = interpolate(path.times, truth["time"], truth["position"][:, :2])
    heading = interpolate(path.times, truth["time"], np.unwrap(truth["attitude"][:, 2]))
    off = [wrap(error) for error in (path.poses[:, 2] - heading).tolist()]
    return np.column_stack((path.poses[:, :2] - true, off))


def turned_errors(log: VehicleLog) -> TurnedErrors | None:
    """Errors of the estimates from the dive point on, as that was estimated at each time; None before any dive."""
    if "matching" not in log:
        return None
    estimate = log["estimate"]
    dive = log["matching"]["dive"]
    under = np.isfinite(dive).all(axis=1) & estimate["initialised"]
    return _turned(log, estimate["time"][under], estimate["position"][under, :2], dive[under])


def turned_path_errors(log: VehicleLog, path: SonarPath) -> TurnedErrors | None:
    """Errors of the keyframes from the dive point on, after the best rotation about it; None without a dive point."""
    began = dive_time(log)
    if began is None:
        return None
    after, rows = path.times >= began, log["path"]
    return _turned(log, path.times[after], path.poses[after, :2], rows["pose"][~rows["frame"]][0, :2])


def _turned(log: VehicleLog, times: Array, places: Array, dive: Array) -> TurnedErrors | None:
    began = dive_time(log)
    if began is None or not len(times):
        return None
    truth = log["truth"]
    origin = interpolate(np.array([began]), truth["time"], truth["position"][:, :2])[0]
    path, true = places - dive, interpolate(times, truth["time"], truth["position"][:, :2]) - origin
    lanes = np.ones(len(times), dtype=bool)
    if LANES in log.phases and (on := phase_at(log, times) == log.phases.index(LANES)).any():
        lanes = on
    angle = rotation_to(path[lanes], true[lanes])
    return TurnedErrors(times, turned(path, angle) - true, angle, lanes)


def dive_time(log: VehicleLog) -> float | None:
    """When the dive began [s]; None before any."""
    if "path" not in log or not len(marks := np.flatnonzero(~log["path"]["frame"])):
        return None
    return float(log["path"]["time"][marks[0]])
