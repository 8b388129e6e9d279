"""Sees that `estimators`, the top-level package that is installed beside auvsim, is not hidden by one of that name."""

import importlib.util
from pathlib import Path

import auvsim
from auvsim.base.errors import InputError

NAME = "estimators"


def check_estimators() -> None:
    """Sees that `import estimators` finds the package which belongs to auvsim.

    Raises:
        InputError: it finds another, or none; the text names the folder that hides it.
    """
    own = Path(auvsim.__file__).resolve().parent.parent / NAME
    spec = importlib.util.find_spec(NAME)
    places = [] if spec is None else [Path(place).resolve() for place in spec.submodule_search_locations or ()]
    if spec is not None and spec.origin is not None and not places:
        places = [Path(spec.origin).resolve()]
    if own not in places[:1]:
        found = f"hidden by {places[0]}; rename that, or start elsewhere" if places else "missing; reinstall auvsim"
        raise InputError(f"auvsim's package '{NAME}' ({own}) is {found}")
