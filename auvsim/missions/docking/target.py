"""Which of the charted structures a docking is for."""

from collections.abc import Mapping

from auvsim.base.errors import InputError, unknown_name
from auvsim.missions.mission import Place


def find_dock(name: str | None, structures: Mapping[str, Place]) -> Place:
    """The structure of a name, or the only one.

    Raises:
        InputError: there is none of that name; none at all; or several, and none is named.
    """
    if name is not None:
        if name not in structures:
            raise unknown_name("structure", name, list(structures))
        return structures[name]
    if len(structures) != 1:
        known = f"name one of {', '.join(structures)}" if structures else "there is no structure"
        raise InputError(f"mission docking: no dock is given; {known}")
    return next(iter(structures.values()))
