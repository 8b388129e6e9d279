"""Choice of the OpenGL with which MuJoCo draws, made before MuJoCo is first imported."""

import ctypes
import os
import sys
from collections.abc import Callable, MutableMapping


def loads(library: str) -> bool:
    """Whether a shared library is there and can be loaded."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def choose_renderer(
    environment: MutableMapping[str, str] = os.environ, available: Callable[[str], bool] = loads
) -> None:
    """Makes MuJoCo draw without a display where the libraries for that are there, and switches drawing off elsewhere.

    Does nothing where the user chose a renderer, on desktops, and on systems other than Linux.
    """
    if environment.get("MUJOCO_GL") or environment.get("DISPLAY") or not sys.platform.startswith("linux"):
        return
    found = available("libEGL.so.1") and available("libGL.so.1")
    environment["MUJOCO_GL"] = "egl" if found else "disable"
