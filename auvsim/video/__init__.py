"""The video of a run and a still picture, from its log alone, drawn without a window.

Main view: from above where the run is time-lapse, a dock where it is slow. Beside it the vehicle from behind and from
above, or several vehicles from behind; the numbers of the moment and a legend.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import av
import matplotlib.image
import numpy as np

from auvsim.base.errors import DrawingError, InputError
from auvsim.base.files import whole
from auvsim.data.log import Log
from auvsim.video.canvas import Picture
from auvsim.video.motion import Motion
from auvsim.video.playback import Playback
from auvsim.video.stage import Stage
from auvsim.video.storyboard import Frame, looked_at, storyboard, verdict

__all__ = ["DrawingError", "render", "still"]

FPS = 25
QUALITY = 27  # constant rate factor of x264
JUST_BEFORE = 1.2  # range of the nose at which a still picture is taken [m]
WAITING = 8  # pictures drawn ahead of the encoder


def render(
    log: Log,
    path: str | os.PathLike[str],
    *,
    width: int = 1280,
    height: int = 720,
    fps: int = FPS,
    speed: float | None = None,
    cameras: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Writes the video of a run (MP4, H.264), whole or not at all.

    Args:
        log: of any status.
        path: of the video.
        width: even [pixels].
        height: even [pixels].
        fps: pictures a second.
        speed: speed-up far from the dock; by default such that the video lasts less than a minute.
        cameras: up to four of overview, follow, above, dock, and map, sonar of a log with a sonar's frames: the main
            view and those beside it, throughout; follow, above and dock also of one by its name, as in
            `follow:auv_2`. By default overview or dock, with follow and above of a lone vehicle, or follow of the first
            three, beside them; of a log with frames map or dock, with follow and sonar.
        progress: called with the number of pictures done and in all.

    Raises:
        DrawingError: there is no OpenGL.
        InputError: the log holds nothing to draw, there is no such camera, or the file cannot be written.
    """
    for name, value in (("width", width), ("height", height)):
        if value % 2 or not 64 <= value <= 4096:
            raise InputError(f"video: {name} {value}: needs an even number of pixels from 64 to 4096")
    if speed is not None and not 1.0 <= speed <= 1000.0:
        raise InputError(f"video: speed {speed}: needs a speed-up from 1 to 1000")
    playback = Playback(log)
    frames = storyboard(playback, fps, speed)
    try:
        with Stage(playback, width, height, cameras) as stage, whole(Path(path)) as partial:
            pictures = (stage.picture(frame, 1.0 / fps) for frame in frames)
            _encode(pictures, partial, (width, height), fps, progress, len(frames))
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error


def still(
    log: Log,
    path: str | os.PathLike[str],
    time: float | None = None,
    *,
    width: int = 1280,
    height: int = 720,
    cameras: Sequence[str] = (),
) -> None:
    """Writes one picture of a run (PNG), with smooth edges, whole or not at all.

    Args:
        log: of any status.
        path: of the picture.
        time: of the run [s]; by default just before the first vehicle with a dock comes nearest to its mouth,
            or else the end.
        width: [pixels].
        height: [pixels].
        cameras: as for `render`.

    Raises:
        DrawingError: there is no OpenGL.
        InputError: the log holds nothing to draw, there is no such camera, or the file cannot be written.
    """
    playback = Playback(log)
    docking = next((motion for motion in playback.motions.values() if np.isfinite(motion.ranges).any()), None)
    if time is None:
        time = _just_before(docking) if docking else playback.end
    focus = looked_at(playback, time)
    banner = verdict(playback) if time >= playback.end else ""
    frame = Frame(time=time, speed=0.0, near=focus is not None, banner=banner, focus=focus)
    try:
        with Stage(playback, width, height, cameras, samples=4) as stage, whole(Path(path)) as partial:
            _save_png(stage.picture(frame, 0.0), partial)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error


def _just_before(motion: Motion) -> float:
    """When a vehicle's nose was still a little away from its dock, before it came nearest [s]."""
    nearest = int(motion.ranges.argmin())
    return float(motion.times[np.flatnonzero(motion.ranges[: nearest + 1] >= JUST_BEFORE).max(initial=0)])


def _save_png(picture: Picture, path: Path) -> None:
    # Six bits of eight: the sand's finest grain is not seen, and would double the file.
    coarse = np.ascontiguousarray(picture & 0xFC)
    matplotlib.image.imsave(path, coarse, format="png", pil_kwargs={"compress_level": 9})


def _encode(
    pictures: Iterator[Picture],
    path: Path,
    size: tuple[int, int],
    fps: int,
    progress: Callable[[int, int], None] | None,
    total: int,
) -> None:
    """Encodes in a thread while the next pictures are drawn."""
    with _movie(path, size, fps) as encode, ThreadPoolExecutor(1) as thread:
        pending: deque[Future] = deque()
        for done, picture in enumerate(pictures, 1):
            pending.append(thread.submit(encode, picture))
            if len(pending) > WAITING:
                pending.popleft().result()
            if progress:
                progress(done, total)
        for future in pending:
            future.result()


@contextmanager
def _movie(path: Path, size: tuple[int, int], fps: int) -> Iterator[Callable[[Picture], None]]:
    """A function that appends a picture to the video."""
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream(
            "libx264", rate=Fraction(fps), options={"crf": str(QUALITY), "preset": "veryfast"}
        )
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"

        def encode(picture: Picture) -> None:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            container.mux(stream.encode(frame))

        yield encode
        container.mux(stream.encode(None))
