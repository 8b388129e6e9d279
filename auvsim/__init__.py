"""AUV docking on exact MuJoCo hydrodynamics."""

import ctypes
import os
import sys

__version__ = "0.1.0"


def _choose_opengl() -> None:
    """Chooses MuJoCo's OpenGL before it is imported: without a display EGL, or none where EGL is not installed.

    What the user has set in `MUJOCO_GL` is never changed.
    """
    if "MUJOCO_GL" in os.environ or os.environ.get("DISPLAY") or not sys.platform.startswith("linux"):
        return
    try:
        for library in ("libEGL.so.1", "libGL.so.1"):
            ctypes.CDLL(library)
    except OSError:
        os.environ["MUJOCO_GL"] = "disable"
    else:
        os.environ["MUJOCO_GL"] = "egl"


_choose_opengl()
