"""OpenGL without a window: scenes drawn into rectangles of one picture."""

import os
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import DrawingError

Picture = NDArray[np.uint8]  # (height, width, 3), first row on top
NO_OPENGL = (
    "no OpenGL to draw with ({}): apt-get install libegl1 libgl1, then `auvsim video DIR/trial.nc` makes the video"
)


def _context_class() -> Any:
    """The OpenGL that MUJOCO_GL names; MuJoCo's own choice is made when it is imported, perhaps before auvsim."""
    name = os.environ.get("MUJOCO_GL", "").lower()
    if name == "egl":
        from mujoco.egl import GLContext

        return GLContext
    if not hasattr(mujoco, "GLContext"):
        raise RuntimeError(f"MUJOCO_GL is '{name}'")
    return mujoco.GLContext


class Box(NamedTuple):
    """A rectangle of the picture [pixels], from its top left corner."""

    x: int
    y: int
    width: int
    height: int


class Canvas:
    """An OpenGL context of the size of the picture; use it in a `with` statement, in one thread.

    Args:
        model: its meshes and textures are drawn.
        width: of the picture [pixels].
        height: of the picture [pixels].
        samples: for smooth edges; in software 4 cost three times the time of none.

    Raises:
        DrawingError: there is no OpenGL.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int, samples: int = 0) -> None:
        self._context = self._gl = None
        self.width, self.height = width, height
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        model.vis.quality.offsamples = samples
        # Round shapes are few and small: coarse ones save a third of the time of software drawing.
        model.vis.quality.numslices, model.vis.quality.numstacks = 16, 8
        try:
            self._gl = _context_class()(width, height)
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        except Exception as error:  # each backend has errors of its own
            self.close()
            reason = " ".join(str(error).split())[:120].rstrip(".")
            raise DrawingError(NO_OPENGL.format(reason or type(error).__name__)) from None

    def draw(self, scene: mujoco.MjvScene, box: Box) -> None:
        """Draws a scene, with its camera, into a rectangle."""
        assert self._context, "closed"
        viewport = mujoco.MjrRect(box.x, self.height - box.y - box.height, box.width, box.height)
        mujoco.mjr_render(viewport, scene, self._context)

    def read(self) -> Picture:
        """The picture, as an array of its own."""
        assert self._context, "closed"
        pixels = np.empty((self.height, self.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, mujoco.MjrRect(0, 0, self.width, self.height), self._context)
        return pixels[::-1]  # OpenGL counts rows from below

    def close(self) -> None:
        """Gives the context back; at interpreter exit it would be too late."""
        if self._context:
            self._context.free()
        if self._gl:
            self._gl.free()
        self._context = self._gl = None

    def __enter__(self) -> "Canvas":
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()
