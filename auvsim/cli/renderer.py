"""Which renderer MuJoCo is to draw with; imports nothing, because MuJoCo decides when it is first imported."""

import ctypes
import os
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
    """Lets MuJoCo draw without a display where it can; leaves alone what the user chose, and a desktop."""
    if environment.get("MUJOCO_GL") or environment.get("DISPLAY"):
        return
    if available("libEGL.so.1") and available("libGL.so.1"):
        environment["MUJOCO_GL"] = "egl"
