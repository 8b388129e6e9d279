"""Where numba keeps compiled code; imports no numba, which decides when it is first imported."""

import os
import stat
import tempfile
from collections.abc import Callable, MutableMapping
from pathlib import Path

PACKAGES = tuple(Path(__file__).resolve().parents[2] / name for name in ("auvsim", "estimators"))


def is_writable(folder: Path) -> bool:
    """Whether files can be made in a folder, or in the nearest one above it that exists."""
    try:
        while not folder.exists():
            folder = folder.parent
        return os.access(folder, os.W_OK | os.X_OK)
    except OSError:
        return False


def choose_cache(
    environment: MutableMapping[str, str] = os.environ, writable: Callable[[Path], bool] = is_writable
) -> str:
    """Gives numba a temporary folder where it can keep compiled code in none of its usual ones.

    Without any, numba would refuse to compile. What the user chose is left alone.

    Returns:
        What is to be said of it; empty where nothing was changed.
    """
    if environment.get("NUMBA_CACHE_DIR"):
        return ""
    cache = environment.get("XDG_CACHE_HOME") or os.path.join(environment.get("HOME") or "/", ".cache")
    if writable(Path(cache, "numba")) or all(writable(package / "__pycache__") for package in PACKAGES):
        return ""
    folder = _own_folder(Path(tempfile.gettempdir(), f"auvsim-compiled-{os.getuid()}"))
    environment["NUMBA_CACHE_DIR"] = str(folder)
    return (
        f"compiled code is kept in {folder}, since no other place can be written to; set NUMBA_CACHE_DIR to change that"
    )


def _own_folder(folder: Path) -> Path:
    """A folder that nobody else can write to, since what is kept in it is run."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022:
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="auvsim-compiled-"))
