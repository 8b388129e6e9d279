"""Numba compilation with a cache on disk that many processes may share, and none where nothing can be written."""

import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numba


def compiled(function: Callable) -> Any:
    """Compiles `function` with numba on its first call; the machine code is kept on disk where that is possible."""
    try:
        return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # numba finds no folder that it may write to
        return numba.njit(nogil=True, error_model="numpy")(function)


def cache_folder() -> Path:
    """The user's folder for generated source: `auvsim` in XDG_CACHE_HOME or in the platform's own cache folder."""
    if base := os.environ.get("XDG_CACHE_HOME"):
        return Path(base) / "auvsim"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "auvsim" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "auvsim"
    return Path.home() / ".cache" / "auvsim"


def load(name: str, source: str) -> ModuleType:
    """Imports generated `source` as a module from the cache folder, or from memory if that folder cannot be written.

    The file's name carries a hash of the source, so a changed source never meets machine code of an earlier one.
    Whatever else that machine code depends on must therefore stand in the source, if only in a comment.
    """
    module_name = f"{name}_{hashlib.sha256(source.encode()).hexdigest()[:16]}"
    if module_name in sys.modules:
        return sys.modules[module_name]
    path = _written(cache_folder() / f"{module_name}.py", source)
    if path is None:
        module = ModuleType(module_name)
        exec(compile(source, f"<{module_name}>", "exec"), module.__dict__)
    else:
        spec = importlib.util.spec_from_file_location(module_name, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    sys.modules[module_name] = module
    return module


def is_ready(dispatcher: Any) -> bool:
    """Whether a `compiled` function has machine code, in this process or on disk."""
    if dispatcher.signatures:
        return True
    folder = dispatcher.stats.cache_path
    return bool(folder) and any(Path(folder).glob(f"*.{dispatcher.__name__}-*.nbi"))


def _written(path: Path, source: str) -> Path | None:
    """Writes `source` whole or not at all; an equal file stays, since numba takes a new date for a new source."""
    try:
        if path.is_file() and path.read_text() == source:
            return path
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".tmp", delete=False) as file:
            file.write(source)
        os.replace(file.name, path)
    except (OSError, RuntimeError):  # RuntimeError: the user has no home folder
        return None
    return path
