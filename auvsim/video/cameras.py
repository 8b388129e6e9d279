"""Where the scene is looked at from: the whole trial, the vehicle from behind and from above, the dock from aside."""

import math
from collections.abc import Callable

import mujoco
import numpy as np

from auvsim.base.errors import unknown_name
from auvsim.base.frames import Array
from auvsim.video.canvas import Box
from auvsim.video.playback import Moment, Playback

FIELD = 45.0  # vertical field of view [deg]
TILT = -50.0  # of the overview [deg]
MARGIN = 0.82  # part of the overview that the track may fill
SETTLING = 0.8  # time in the video in which a camera follows a turn [s]


class Cameras:
    """The cameras of one video; they remember where they looked, so that they turn smoothly.

    Args:
        playback: the trial.
        aspect: width over height of the overview.
    """

    def __init__(self, playback: Playback, aspect: float) -> None:
        playback.model.vis.global_.fovy = FIELD
        self._playback = playback
        self._axis_azimuth = -math.degrees(playback.pose.heading)
        self._azimuth: float | None = None
        self._tangents = MARGIN * math.tan(math.radians(FIELD / 2.0)) * np.array([aspect, 1.0])
        self._overview = _overview(playback, self._tangents)
        self.overview_distance = float(self._overview.distance)
        self._aims: dict[str, Callable[[Moment, float], mujoco.MjvCamera]] = {
            "overview": lambda moment, step: self._overview,
            "follow": self._follow,
            "above": self._above,
            "dock": self._dock,
        }

    def check(self, name: str) -> None:
        """Raises InputError unless there is a camera of that name."""
        if name not in self._aims:
            raise unknown_name("camera", name, list(self._aims))

    def aim(self, name: str, moment: Moment, step: float) -> mujoco.MjvCamera:
        """A camera at a moment.

        Args:
            name: one of overview, follow, above, dock.
            moment: what it looks at.
            step: time in the video since it was aimed before [s].
        """
        return self._aims[name](moment, step)

    def _follow(self, moment: Moment, step: float) -> mujoco.MjvCamera:
        """From behind and above."""
        wanted = -math.degrees(moment.heading)
        if self._azimuth is None:
            self._azimuth = wanted
        self._azimuth += (wanted - self._azimuth) * (1.0 - math.exp(-step / SETTLING))
        return _camera(moment.position + np.array([0.0, 0.0, 0.15]), 4.2, self._azimuth + 14.0, -17.0)

    def _above(self, moment: Moment, step: float) -> mujoco.MjvCamera:
        """From straight above, the dock's axis upwards, from so high that the estimate is in the picture too."""
        spread = 0.0
        if moment.belief is not None:
            spread = float(np.linalg.norm((moment.belief.position - moment.position)[:2]))
        return _camera(moment.position, 8.0 + min(3.0 * spread, 30.0), self._axis_azimuth, -89.5)

    def _dock(self, moment: Moment, step: float) -> mujoco.MjvCamera:
        """Obliquely from the dock's starboard side, nose and mouth in the picture."""
        mouth = self._playback.mouth
        away = moment.position - mouth
        away *= min(1.0, 30.0 / max(float(np.linalg.norm(away)), 1e-9))
        dock = mouth + np.array([[0.0, 0.0, 1.1], [0.0, 0.0, -1.6], 1.7 * self._playback.axis])
        vehicle = mouth + away + np.outer((-1.0, 1.0), moment.nose - moment.position)
        return _fitted(np.concatenate([dock, vehicle]), self._axis_azimuth + 58.0, -20.0, self._tangents)


def _camera(target: Array, distance: float, azimuth: float, elevation: float) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = target, distance, azimuth, elevation
    return camera


def _overview(playback: Playback, tangents: Array) -> mujoco.MjvCamera:
    """The camera from which the whole track and the dock fill the picture best, of all azimuths."""
    around = playback.mouth + 15.0 * np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    points = np.concatenate([playback.positions, around])
    # Of nearly equal ones the one in which north points most upwards: azimuth 0 looks north.
    fits = [_fitted(points, azimuth, TILT, tangents) for azimuth in range(-180, 180, 15)]
    return min(fits, key=lambda camera: camera.distance * (1.0 + 0.0005 * abs(camera.azimuth)))


def _fitted(points: Array, azimuth: float, elevation: float, tangents: Array) -> mujoco.MjvCamera:
    """The camera that sees all points (n, 3) from the least distance.

    A point with right and up `s` and depth `z` is seen from distance d, shifted by c, if |s - c| <= tangent (d + z).

    Args:
        points: to be seen [m].
        azimuth: of the view [deg].
        elevation: of the view [deg].
        tangents: (2,) of the half angles of the view that the points may fill.
    """
    right, up, forward = _axes(math.radians(azimuth), math.radians(elevation))
    centre = points.mean(axis=0)
    points = points - centre
    depth = points @ forward
    sides = np.stack([points @ right, points @ up], axis=1)
    high = (sides - np.outer(depth, tangents)).max(axis=0)
    low = (-sides - np.outer(depth, tangents)).max(axis=0)
    shift = 0.5 * (high - low)
    distance = float((0.5 * (high + low) / tangents).max())
    return _camera(centre + shift[0] * right + shift[1] * up, distance, azimuth, elevation)


def _axes(azimuth: float, elevation: float) -> tuple[Array, Array, Array]:
    """Right, up and forward of a MuJoCo camera."""
    ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
    forward = np.array([ca * ce, sa * ce, se])
    right = np.array([sa, -ca, 0.0])
    return right, np.cross(right, forward), forward


def project(scene: mujoco.MjvScene, point: Array, box: Box) -> tuple[int, int] | None:
    """Where in the picture [pixels] a scene's camera sees a point (3,); None behind the camera or out of the box."""
    camera = scene.camera[0]
    forward, up = np.array(camera.forward, dtype=float), np.array(camera.up, dtype=float)
    ray = np.asarray(point) - np.array(camera.pos, dtype=float)
    depth = float(ray @ forward)
    if depth <= 0.0:
        return None
    scale = 0.5 * box.height / math.tan(math.radians(FIELD / 2.0)) / depth
    x = round(box.x + 0.5 * box.width + float(ray @ np.cross(forward, up)) * scale)
    y = round(box.y + 0.5 * box.height - float(ray @ up) * scale)
    inside = box.x <= x < box.x + box.width and box.y <= y < box.y + box.height
    return (x, y) if inside else None
