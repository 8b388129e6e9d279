"""One picture of a video: the views, where they stand in it, and what is written on them."""

from collections.abc import Sequence

import mujoco

from auvsim.base.errors import InputError
from auvsim.video import overlay
from auvsim.video.cameras import Cameras, project
from auvsim.video.canvas import Box, Canvas, Picture
from auvsim.video.marks import DOCK, TRUE, FarMarks, NearMarks
from auvsim.video.playback import Moment, Playback
from auvsim.video.storyboard import Frame

NAMES = {
    "overview": "overview, squares of 50 m",
    "follow": "vehicle",
    "above": "from above, dock axis up",
    "dock": "dock",
}
SIDE, READABLE = 0.325, 290  # part of the width that the views beside the main one take; least width for text


class Stage:
    """Draws the pictures of one video; use it in a `with` statement.

    Args:
        playback: the trial.
        width: of the picture [pixels].
        height: of the picture [pixels].
        cameras: names of the main view and those beside it; none for the default.
        samples: for smooth edges.

    Raises:
        DrawingError: there is no OpenGL.
        InputError: there is no such camera, or they are too many.
    """

    def __init__(
        self, playback: Playback, width: int, height: int, cameras: Sequence[str] = (), samples: int = 0
    ) -> None:
        if len(cameras) > 3:
            raise InputError(f"video: {len(cameras)} cameras: at most three fit into the picture")
        self._playback, self._names = playback, tuple(cameras)
        self._boxes = layout(width, height, len(cameras) or 3)
        self._cameras = Cameras(playback, self._boxes[0].width / self._boxes[0].height)
        for name in cameras:
            self._cameras.check(name)
        side = side_width(width)
        self._corner = Box(
            width - side if len(self._boxes) > 1 else 0,
            0,
            side,
            round(side * overlay.PANEL_HEIGHT / overlay.PANEL_WIDTH),
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
        playback = self._playback
        moment = playback.at(frame.time)
        playback.pose_model(moment)
        names = self._names or ("dock" if frame.near else "overview", "follow", "above")
        if "overview" in names:
            self._far.update(moment, frame.speed)
        if set(names) - {"overview"}:
            self._near.update(moment, frame.speed)
        places: dict[str, tuple[int, int] | None] = {}
        for name, box in zip(names, self._boxes, strict=True):
            self._view(name, box, moment, step, places)
        picture = self._canvas.read()
        self._write(picture, names, moment, frame, places)
        return picture

    def _view(
        self, name: str, box: Box, moment: Moment, step: float, places: dict[str, tuple[int, int] | None]
    ) -> None:
        """Draws one view and notes where in it the vehicle and the dock are."""
        camera = self._cameras.aim(name, moment, step)
        marks = self._far if name == "overview" else self._near
        mujoco.mjv_updateCamera(self._playback.model, self._playback.data, camera, marks.layer.scene)
        marks.layer.sky(name in ("follow", "dock"))
        self._canvas.draw(marks.layer.scene, box)
        if name == "overview":
            places["AUV"] = project(marks.layer.scene, moment.position + self._far.above, box)
            places["dock"] = project(marks.layer.scene, self._playback.mouth + self._far.above, box)

    def _write(
        self,
        picture: Picture,
        names: Sequence[str],
        moment: Moment,
        frame: Frame,
        places: dict[str, tuple[int, int] | None],
    ) -> None:
        scale = picture.shape[0] / 720.0
        for text, colour in (("AUV", TRUE), ("dock", DOCK)):
            overlay.label(picture, text, places.get(text), overlay.rgb(colour), scale)
        for name, box in zip(names, self._boxes, strict=True):
            overlay.tag(picture, NAMES[name], box, scale)
        for box in self._boxes[1:]:
            overlay.fill(picture, Box(box.x, box.y, box.width, max(round(2 * scale), 1)), overlay.PANEL)
        overlay.panel(picture, self._playback, moment, frame.speed, self._corner, solid=len(names) > 1)
        if frame.banner:
            main = self._boxes[0]
            left = self._corner.width if len(names) == 1 else 0
            overlay.banner(picture, frame.banner, Box(main.x + left, main.y, main.width - left, main.height), scale)


def side_width(width: int) -> int:
    """Width of the panel and of the views below it [pixels]."""
    return round(max(SIDE * width, min(READABLE, 0.5 * width)))


def layout(width: int, height: int, views: int) -> list[Box]:
    """The main view, and those beside it below the panel."""
    if views == 1:
        return [Box(0, 0, width, height)]
    side = side_width(width)
    top = round(side * overlay.PANEL_HEIGHT / overlay.PANEL_WIDTH)
    each = (height - top) // (views - 1)
    boxes = [Box(0, 0, width - side, height)]
    for index in range(views - 1):
        boxes.append(Box(width - side, top + index * each, side, each))
    return boxes
