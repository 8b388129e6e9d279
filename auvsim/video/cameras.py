"""Where the scene is looked at from: the whole run, a vehicle from behind and from above, a dock from aside.

A view is of the vehicle in focus and its dock, or of one by its name: `follow:auv_2`, `dock:west`.
"""

import math
from collections.abc import Callable

import mujoco
import numpy as np

from auvsim.base.errors import InputError, unknown_name
from auvsim.base.frames import Array
from auvsim.video.canvas import Box
from auvsim.video.motion import VehicleMoment
from auvsim.video.playback import Dock, Moment, Playback

FIELD = 45.0  # vertical field of view [deg]
TILT = -50.0  # of the overview [deg]
MARGIN = 0.82  # part of the overview that the track may fill
SETTLING = 0.8  # time in the video in which a camera follows a turn [s]


class Cameras:
    """The cameras of one video; they remember where they looked, so that they turn smoothly.

    Args:
        playback: the run.
        aspect: width over height of the overview.
    """

    def __init__(self, playback: Playback, aspect: float) -> None:
        playback.model.vis.global_.fovy = FIELD
        self._playback = playback
        self._azimuths: dict[str, float] = {}  # of the view from behind, by vehicle
        self._tangents = MARGIN * math.tan(math.radians(FIELD / 2.0)) * np.array([aspect, 1.0])
        self._overview = _overview(playback, self._tangents)
        self.overview_distance = float(self._overview.distance)
        self._aims: dict[str, Callable[[str, Moment, float], mujoco.MjvCamera]] = {
            "overview": lambda subject, moment, step: self._overview,
            "follow": self._follow,
            "above": self._above,
            "dock": self._dock,
        }

    def check(self, view: str) -> None:
        """Raises InputError unless there is such a view of something that the log has."""
        kind, subject = split(view)
        if kind not in self._aims:
            raise unknown_name("camera", view, list(self._aims))
        known = list(self._playback.docks if kind == "dock" else self._playback.motions)
        if kind == "dock" and not known:
            raise InputError(f"camera '{view}': the log has no dock; there are overview, follow, above")
        if subject and (kind == "overview" or subject not in known):
            raise InputError(
                f"camera '{view}': {kind} may be of {'all only' if kind == 'overview' else ', '.join(known)}"
            )

    def aim(self, view: str, moment: Moment, step: float) -> mujoco.MjvCamera:
        """A camera at a moment.

        Args:
            view: overview, follow, above or dock, the latter three also with `:` and a name.
            moment: what it looks at.
            step: time in the video since it was aimed before [s].
        """
        kind, subject = split(view)
        return self._aims[kind](subject, moment, step)

    def looked_at(self, view: str, moment: Moment) -> str:
        """The vehicle that a view shows: the one named, the one nearest to the dock named, or else the one in focus."""
        kind, subject = split(view)
        if not subject:
            return moment.focus
        if kind != "dock":
            return subject
        mouth = self._playback.docks[subject].mouth
        return min(moment.vehicles, key=lambda name: math.dist(moment.vehicles[name].nose, mouth))

    def _follow(self, subject: str, moment: Moment, step: float) -> mujoco.MjvCamera:
        """From behind and above."""
        name = subject or moment.focus
        now = moment.vehicles[name]
        wanted = -math.degrees(now.heading)
        azimuth = self._azimuths.get(name, wanted)
        azimuth += (wanted - azimuth) * (1.0 - math.exp(-step / SETTLING))
        self._azimuths[name] = azimuth
        return _camera(now.position + np.array([0.0, 0.0, 0.15]), 4.2, azimuth + 14.0, -17.0)

    def _above(self, subject: str, moment: Moment, step: float) -> mujoco.MjvCamera:
        """From straight above, its dock's axis or north upwards, so high that the estimate is in the picture too."""
        name = subject or moment.focus
        now, dock = moment.vehicles[name], self._playback.dock_of(name)
        spread = 0.0
        if now.belief is not None:
            spread = float(np.linalg.norm((now.belief.position - now.position)[:2]))
        azimuth = -math.degrees(dock.heading) if dock else 0.0
        return _camera(now.position, 8.0 + min(3.0 * spread, 30.0), azimuth, -89.5)

    def dock_in(self, view: str, moment: Moment) -> Dock:
        """The dock that a view of one shows: the one named, that of the vehicle in focus, or else the first."""
        _, subject = split(view)
        docks = self._playback.docks
        return docks[subject] if subject else self._playback.dock_of(moment.focus) or next(iter(docks.values()))

    def _dock(self, subject: str, moment: Moment, step: float) -> mujoco.MjvCamera:
        """Obliquely from the dock's starboard side, nose and mouth in the picture."""
        view = f"dock:{subject}"
        dock, now = self.dock_in(view, moment), moment.vehicles[self.looked_at(view, moment)]
        return _fitted(_dock_and_nose(dock, now), -math.degrees(dock.heading) + 58.0, -20.0, self._tangents)


def split(view: str) -> tuple[str, str]:
    """Kind of a view, and the name of what it is of; "" for what is in focus."""
    kind, _, subject = view.partition(":")
    return kind, subject


def _dock_and_nose(dock: Dock, now: VehicleMoment) -> Array:
    """Points (n, 3) of a dock and of a vehicle, which is taken for nearer where it is far."""
    away = now.position - dock.mouth
    away *= min(1.0, 30.0 / max(float(np.linalg.norm(away)), 1e-9))
    funnel = dock.mouth + np.array([[0.0, 0.0, 1.1], [0.0, 0.0, -1.6], 1.7 * dock.axis])
    return np.concatenate([funnel, dock.mouth + away + np.outer((-1.0, 1.0), now.nose - now.position)])


def _camera(target: Array, distance: float, azimuth: float, elevation: float) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = target, distance, azimuth, elevation
    return camera


def _overview(playback: Playback, tangents: Array) -> mujoco.MjvCamera:
    """The camera from which all tracks, docks and beacons fill the picture best, of all azimuths."""
    around = 15.0 * np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    tracks = [motion.positions for motion in playback.motions.values()]
    places = [*(dock.mouth for dock in playback.docks.values()), *playback.beacons.values()]
    places = places or [track[0] for track in tracks]
    points = np.concatenate([*tracks, *(place + around for place in places)])
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
