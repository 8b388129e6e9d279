"""Choice of the OpenGL with which MuJoCo draws, made before MuJoCo is first imported."""

import ctypes
import os
import socket
import sys
from collections.abc import Callable, MutableMapping

OFF = "disable"
# What MuJoCo and dm_control understand, and the libraries that each needs, one of every tuple.
NEEDS: dict[str, tuple[tuple[str, ...], ...]] = {
    "egl": (("libEGL.so.1", "libEGL.so"), ("libGL.so.1", "libGL.so", "libOpenGL.so.0")),
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),),
    **dict.fromkeys(("glfw", "on", "enable", "enabled", "true", "1", OFF, "disabled", "off", "false", "0"), ()),
}


def loads(library: str) -> bool:
    """Whether a shared library is there and can be loaded."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def answers(display: str) -> bool:
    """Whether an X server is listening at a DISPLAY such as `:0` or `host:10.0`."""
    host, _, screen = display.rpartition(":")
    number = screen.partition(".")[0]
    if not number.isdigit():
        return False
    path = f"/tmp/.X11-unix/X{number}"
    local = [(socket.AF_UNIX, path), (socket.AF_UNIX, f"\0{path}")]
    places = [(socket.AF_INET, (host, 6000 + int(number)))] if host and host != "unix" else local
    for family, address in places:
        try:
            with socket.socket(family, socket.SOCK_STREAM) as connection:
                connection.settimeout(1.0)
                connection.connect(address)
                return True
        except OSError:
            continue
    return False


def choose_renderer(
    environment: MutableMapping[str, str] = os.environ,
    available: Callable[[str], bool] = loads,
    alive: Callable[[str], bool] = answers,
) -> str:
    """Makes MuJoCo draw without a display where the libraries for that are there, and switches drawing off elsewhere.

    Does nothing where the user chose a renderer that can work, on desktops whose display answers, and on systems other
    than Linux. A choice that cannot work is switched off, since MuJoCo could not even be imported with it.

    Returns:
        Why the user's choice was not heeded; empty if it was.
    """
    if not sys.platform.startswith("linux"):
        return ""
    wanted, display = environment.get("MUJOCO_GL", ""), environment.get("DISPLAY", "")
    if wanted:
        name = wanted.lower().strip()
        if name not in NEEDS:
            environment["MUJOCO_GL"] = OFF
            return f"MUJOCO_GL={wanted} is unknown; set it to egl, osmesa or glfw, or unset it"
        missing = [either[0] for either in NEEDS[name] if not any(map(available, either))]
        if missing:
            environment["MUJOCO_GL"] = OFF
            return f"MUJOCO_GL={wanted} needs {' and '.join(missing)}, which cannot be loaded"
        return ""
    if display and alive(display):
        return ""
    found = all(any(map(available, either)) for either in NEEDS["egl"])
    environment["MUJOCO_GL"] = "egl" if found else OFF
    return f"no X server answers at DISPLAY={display}; unset DISPLAY" if display else ""
