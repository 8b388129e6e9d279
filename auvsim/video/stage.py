"""One picture of a video: the views, where they stand in it, and what is written on them."""

from collections.abc import Sequence

import mujoco

from auvsim.base.errors import InputError
from auvsim.video import marks, overlay, panel, sonar
from auvsim.video.cameras import Cameras, project, split
from auvsim.video.canvas import Box, Canvas, Picture
from auvsim.video.marks import FarMarks, NearMarks
from auvsim.video.playback import Moment, Playback
from auvsim.video.storyboard import Frame

MOST = 4  # views of a picture
SIDE, READABLE = 0.325, 290  # part of the width that the views beside the main one take; least width for text


class Stage:
    """Draws the pictures of one video; use it in a `with` statement.

    Args:
        playback: the run.
        width: of the picture [pixels].
        height: of the picture [pixels].
        cameras: the main view and those beside it, see `Cameras`; none for the default.
        samples: for smooth edges.

    Raises:
        DrawingError: there is no OpenGL.
        InputError: there is no such camera, or they are too many.
    """

    def __init__(
        self, playback: Playback, width: int, height: int, cameras: Sequence[str] = (), samples: int = 0
    ) -> None:
        if len(cameras) > MOST:
            raise InputError(f"video: {len(cameras)} cameras: at most {MOST} fit into the picture")
        self._playback, self._views = playback, tuple(cameras)
        self._sonar = sonar.SonarViews(playback)
        self._far_view = sonar.MAP if sonar.MAP in self._sonar.views else "overview"
        self._beside = ("follow", sonar.SONAR) if sonar.SONAR in self._sonar.views else beside(playback)
        self._boxes = layout(width, height, len(cameras) or 1 + len(self._beside))
        self._cameras = Cameras(playback, self._boxes[0].width / self._boxes[0].height)
        for name in cameras:
            if name in sonar.VIEWS and name not in self._sonar.views:
                raise InputError(f"camera '{name}': the log holds no frames of a sonar; set its `log_frames`")
            if name not in sonar.VIEWS:
                self._cameras.check(name)
        side = side_width(width)
        self._corner = Box(
            width - side if len(self._boxes) > 1 else 0,
            0,
            side,
            round(side * panel.HEIGHT / panel.WIDTH),
        )
        playback.pose_model(playback.at(playback.start))
        self._near = NearMarks(playback)
        self._far = FarMarks(playback, self._cameras.overview_distance)
        self._canvas = Canvas(playback.model, width, height, samples)

    def __enter__(self) -> "Stage":
        return self

    def __exit__(self, *reason: object) -> None:
        self._canvas.close()

    def picture(self, frame: Frame, step: float) -> Picture:
        """Draws a frame; times must not go back.

        Args:
            frame: what to show.
            step: time in the video since the frame before [s].
        """
        moment = self._playback.at(frame.time, frame.focus)
        self._playback.pose_model(moment)
        views = self._views or ("dock" if frame.near else self._far_view, *self._beside)
        if "overview" in views:
            self._far.update(moment)
        drawn = ""  # vehicle round which the marks of the near views are
        for view, box in zip(views, self._boxes, strict=True):
            if view in sonar.VIEWS:
                continue
            if view != "overview" and (vehicle := self._cameras.looked_at(view, moment)) != drawn:
                self._near.update(moment, vehicle, frame.speed)
                drawn = vehicle
            self._view(view, box, moment, step)
        picture = self._canvas.read()
        for view, box in zip(views, self._boxes, strict=True):
            if view in sonar.VIEWS:
                self._sonar.draw(view, picture, box, frame.time, step)
        self._write(picture, views, moment, frame)
        return picture

    def _view(self, view: str, box: Box, moment: Moment, step: float) -> None:
        camera = self._cameras.aim(view, moment, step)
        layer = (self._far if view == "overview" else self._near).layer
        mujoco.mjv_updateCamera(self._playback.model, self._playback.data, camera, layer.scene)
        layer.sky(split(view)[0] in ("follow", "dock"))
        self._canvas.draw(layer.scene, box)

    def _write(self, picture: Picture, views: Sequence[str], moment: Moment, frame: Frame) -> None:
        scale = picture.shape[0] / 720.0
        if "overview" in views:
            self._label(picture, moment, self._boxes[views.index("overview")], scale)
        for view, box in zip(views, self._boxes, strict=True):
            overlay.tag(picture, self._name(view, moment), box, scale)
        for box in self._boxes[1:]:
            overlay.fill(picture, Box(box.x, box.y, box.width, max(round(2 * scale), 1)), overlay.PANEL)
        panel.panel(picture, self._playback, moment, frame.speed, self._corner, solid=len(views) > 1)
        if frame.banner:
            main = self._boxes[0]
            left = self._corner.width if len(views) == 1 else 0
            overlay.banner(picture, frame.banner, Box(main.x + left, main.y, main.width - left, main.height), scale)

    def _label(self, picture: Picture, moment: Moment, box: Box, scale: float) -> None:
        """Names of vehicles, docks and beacons in the overview."""
        playback, scene, above = self._playback, self._far.layer.scene, self._far.above
        for name, now in moment.vehicles.items():
            place = project(scene, now.position + above, box)
            colour = overlay.rgb(marks.colour_of(playback, name))
            overlay.label(picture, "AUV" if playback.lone else name, place, colour, scale)
        for name, dock in playback.docks.items():
            text = "dock" if len(playback.docks) == 1 else name
            place = dock.mouth + above if playback.lone else dock.mouth - 1.3 * above  # clear of a vehicle in it
            overlay.label(picture, text, project(scene, place, box), overlay.rgb(marks.DOCK), scale)
        for name, place in playback.beacons.items():
            overlay.label(picture, name, project(scene, place - 1.3 * above, box), overlay.rgb(marks.BEACON), scale)

    def _name(self, view: str, moment: Moment) -> str:
        """What stands in the corner of a view."""
        kind, _ = split(view)
        if kind in sonar.VIEWS:
            return self._sonar.name(kind)
        if kind == "overview":
            return "overview, squares of 50 m"
        if kind == "dock":
            return "dock" if len(self._playback.docks) == 1 else f"dock {self._cameras.dock_in(view, moment).name}"
        vehicle = self._cameras.looked_at(view, moment)
        who = "" if self._playback.lone else vehicle
        if kind == "follow":
            return who or "vehicle"
        up = "dock axis up" if self._playback.dock_of(vehicle) else "north up"
        return f"{who} from above, {up}".lstrip()


def beside(playback: Playback) -> tuple[str, ...]:
    """The views beside the main one: of a lone vehicle two, of several the first ones from behind."""
    if playback.lone:
        return "follow", "above"
    return tuple(f"follow:{name}" for name in [*playback.motions][: MOST - 1])


def side_width(width: int) -> int:
    """Width of the panel and of the views below it [pixels]."""
    return round(max(SIDE * width, min(READABLE, 0.5 * width)))


def layout(width: int, height: int, views: int) -> list[Box]:
    """The main view, and those beside it below the panel."""
    if views == 1:
        return [Box(0, 0, width, height)]
    side = side_width(width)
    top = round(side * panel.HEIGHT / panel.WIDTH)
    each = (height - top) // (views - 1)
    boxes = [Box(0, 0, width - side, height)]
    for index in range(views - 1):
        boxes.append(Box(width - side, top + index * each, side, each))
    return boxes
