"""Finds models/, in a checkout or in the installed package, and the MJCF texts of vehicles and structures."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path

import auvsim
from auvsim.base.errors import InputError, unknown_name

PACKAGE = Path(auvsim.__file__).parent
_MODEL = re.compile(r"<mujoco\b[^>]*?\bmodel\s*=\s*[\"']([^\"']+)")
INSTANCE = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,63}")  # what a vehicle or structure may be called
_GIVEN: ContextVar[Mapping[tuple[str, str], str] | None] = ContextVar("given", default=None)  # see `given`
_MARKS = {"vehicle": '<body name="hull"', "structure": '<site name="capture"'}  # what every MJCF of a kind has


def models_folder() -> Path:
    """The folder of the models: inside the installed package, else beside it in a checkout."""
    for folder in (PACKAGE / "models", PACKAGE.parent / "models"):
        if folder.is_dir():
            return folder
    raise InputError(f"no models folder inside or beside {PACKAGE}; reinstall auvsim")


def _read(path: Path) -> str:
    """Text of a file, which is read again when it has changed."""
    try:
        state = path.stat()
        return _text(path, state.st_mtime_ns, state.st_size)
    except FileNotFoundError:
        raise InputError(f"model {path}: there is no such file; give a shipped model's name or an MJCF file") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"model {path}: it cannot be read: {reason}") from None


@lru_cache(maxsize=64)
def _text(path: Path, modified: int, size: int) -> str:
    return path.read_text(encoding="utf-8")


def find(kind: str, name: str) -> Path:
    """The MJCF file of a shipped model by name, or the user's own by the path of its `.xml`.

    Args:
        kind: `vehicle` or `structure`.
        name: of the model, or a path.

    Raises:
        InputError: no model has that name; the text lists those there are.
    """
    if name.endswith(".xml"):
        return Path(name).expanduser()
    folder = models_folder()
    path = folder / name / f"{name}.xml"
    if not INSTANCE.fullmatch(name) or not path.is_file():
        raise unknown_name(kind, name, shipped(kind))
    return path


def shipped(kind: str) -> list[str]:
    """Names of the models that auvsim ships; `kind` as of `find`."""
    found = models_folder().glob("*/*.xml")
    return [path.stem for path in found if path.stem == path.parent.name and _MARKS[kind] in _read(path)]


@contextmanager
def given(texts: Mapping[tuple[str, str], str]) -> Iterator[None]:
    """Takes models from texts, such as a log holds, and not from their files.

    Args:
        texts: MJCF by kind (`vehicle` or `structure`) and name; other models are read from their files.
    """
    before = _GIVEN.set({**(_GIVEN.get() or {}), **texts})
    try:
        yield
    finally:
        _GIVEN.reset(before)


def source(kind: str, name: str) -> tuple[Path, str]:
    """The MJCF file of a model and its text now, or the text that is `given`; arguments and errors as of `find`."""
    held = _GIVEN.get() or {}
    if (kind, name) in held:
        return Path(name), held[kind, name]
    path = find(kind, name)
    return path, _read(path)


def model_name(kind: str, name: str) -> str:
    """Name of a model as its MJCF says it, without loading it; arguments and errors as of `find`.

    Raises:
        InputError: it cannot name a vehicle or structure, too.
    """
    path, text = source(kind, name)
    match = _MODEL.search(text)
    found = match.group(1) if match else "unnamed"
    if not INSTANCE.fullmatch(found):
        shown = found if len(found) <= 40 else f"{found[:37]}..."
        raise InputError(f"model {path}: model=\"{shown}\": give a name of 1 to 64 letters, digits, '_' and '-'")
    return found
