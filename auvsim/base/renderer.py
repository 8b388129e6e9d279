"""Which OpenGL MuJoCo is to draw with; imports no MuJoCo, which decides when it is first imported."""

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
    """Lets MuJoCo draw without a display where it can, and look for none where it cannot.

    Leaves alone what the user chose, desktops, and systems other than Linux.
    """
    if environment.get("MUJOCO_GL") or environment.get("DISPLAY") or not sys.platform.startswith("linux"):
        return
    found = available("libEGL.so.1") and available("libGL.so.1")
    environment["MUJOCO_GL"] = "egl" if found else "disable"
