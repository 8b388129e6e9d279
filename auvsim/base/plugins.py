"""Parts of a user's own, named `package.module:Name` where the name of a shipped one could stand."""

import importlib
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from auvsim.base import schema
from auvsim.base.errors import InputError, unknown_name

Part = TypeVar("Part")

ADDRESS = re.compile(r"0x[0-9a-fA-F]{6,}")  # of an object in memory


def is_own(name: str) -> bool:
    """Whether a name is that of a user's own part."""
    return ":" in name


def find(what: str, name: str, shipped: Mapping[str, Part]) -> Part | Any:
    """A part by the name of a shipped one or as `package.module:Name`, looked for in the working folder too.

    Args:
        what: kind of part, for errors: "estimator".
        name: of the part.
        shipped: the shipped parts by name.

    Raises:
        InputError: there is none, or its module cannot be imported.
    """
    if name in shipped:
        return shipped[name]
    if not is_own(name):
        raise unknown_name(what, name, [*shipped, "package.module:Name of your own"])
    module, _, attribute = name.partition(":")
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.append(folder)
    try:
        return getattr(importlib.import_module(module), attribute)
    except (Exception, SystemExit) as error:  # a user's module may fail in any way while it is imported
        text = " ".join(str(error).split())[:300]
        raise InputError(f"{what} '{name}': {type(error).__name__}: {text}") from None


def require(what: str, made: Any, *names: str) -> None:
    """Sees that a part that was made has all that its contract names.

    Raises:
        InputError: it lacks something.
    """
    lacks = [name for name in names if not hasattr(made, name)]
    if lacks:
        raise InputError(f"{what} made a {type(made).__name__} without {', '.join(lacks)}")


def settings_of(part: Any, given: Mapping[str, Any], where: str) -> Any:
    """The settings of a user's own part: checked by its class `Settings` if it has one, else as they were given.

    Raises:
        InputError: its class refuses them.
    """
    of_its_own = getattr(part, "Settings", None)
    if of_its_own is None:
        return dict(given)
    try:
        return of_its_own(**given)
    except ValidationError as error:
        raise schema.explain(error, of_its_own, given, {"": where}) from None
    except Exception as error:  # of pydantic, or whatever a class of the user's own raises
        raise InputError(f"{where}: {' '.join(str(error).split())[:300]}") from None


def same_each_time(text: str) -> str:
    """A text without addresses of objects in memory, which differ in every process."""
    return ADDRESS.sub("0x...", text)
