"""Reads fields of a PyMJCF model, each checked, with a line that says where it is wrong."""

from typing import Any

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.settings import OTHERWISE


def numeric(root: Any, where: str, name: str) -> Array:
    """Numbers of a custom numeric.

    Raises:
        InputError: It is not there, is empty, or its numbers are not finite or are impossibly large.
    """
    element = root.find("numeric", name)
    if element is None:
        raise InputError(f"model {where} lacks the numeric '{name}'")
    data = np.atleast_1d(np.array([] if element.data is None else element.data, dtype=float))
    if not data.size or not np.isfinite(data).all():
        raise InputError(f"model {where}: the numeric '{name}' is {data.tolist()}; its data must be finite numbers")
    if np.abs(data).max() > OTHERWISE:
        raise InputError(f"model {where}: the numeric '{name}' has {np.abs(data).max():g}, more than {OTHERWISE:g}")
    return data


def allocation(root: Any, where: str, fins: tuple[str, ...]) -> Array:
    """Fin angle per unit of rudder and of elevator (m, 2)."""
    columns = []
    for name in ("allocation_rudder", "allocation_elevator"):
        column = numeric(root, where, name)
        if column.size != len(fins):
            known = ", ".join(fins) or "none"
            raise InputError(
                f"model {where}: '{name}' has {column.size} numbers; it wants {len(fins)}, one for each fin ({known})"
            )
        columns.append(column)
    return np.stack(columns, axis=-1)


def length(root: Any, where: str, name: str) -> float:
    """A numeric that is a length [m]."""
    data = numeric(root, where, name)
    if data.size != 1 or data[0] <= 0.0:
        raise InputError(f"model {where}: '{name}' is {data.tolist()}; it must be one number above 0 [m]")
    return float(data[0])


def panel_contact(root: Any, where: str) -> tuple[float, float] | None:
    """Stiffness [N/m] and damping [N s/m] of a dock's panels, if it says so."""
    if root.find("numeric", "panel_contact") is None:
        return None
    data = numeric(root, where, "panel_contact")
    if data.size != 2 or data[0] <= 0.0 or data[1] < 0.0:
        raise InputError(
            f"model {where}: 'panel_contact' is {data.tolist()}; it must be a stiffness above 0 [N/m] and a damping of "
            "0 or more [N s/m]"
        )
    return float(data[0]), float(data[1])


def site(root: Any, where: str, name: str) -> Array:
    """Place (3,) of a site in its body [m]."""
    found = root.find("site", name)
    if found is None:
        raise InputError(f"model {where} lacks the site '{name}'")
    place = np.zeros(3) if found.pos is None else np.array(found.pos, dtype=float)
    if not np.isfinite(place).all():
        raise InputError(f"model {where}: the site '{name}' is at {place.tolist()}; give finite numbers")
    return place


def site_x(root: Any, where: str, name: str) -> float:
    """Place of a site along its body's axis [m]."""
    return float(site(root, where, name)[0])


def attribute(element: Any, name: str) -> Any:
    """An attribute of an MJCF element: its own, else that of its default classes from the inside out, else None."""
    value, group = getattr(element, name), element.dclass or element.root.default
    while value is None and group is not None and group.tag == "default":
        value, group = getattr(getattr(group, element.tag), name, None), group.parent
    return value


def limits(root: Any, where: str, name: str) -> Array:
    """Smallest and largest command (2,) of an actuator."""
    actuator = root.find("actuator", name)
    if actuator is None:
        raise InputError(f"model {where} lacks the actuator '{name}'")
    found = attribute(actuator, "ctrlrange")
    if found is None:
        raise InputError(f"model {where}: actuator '{name}' needs a ctrlrange")
    return np.array(found, dtype=float)


def lag(root: Any, name: str) -> float:
    """Time constant [s] of a servo: damping / kp of a position servo, armature / kv of a velocity servo."""
    actuator = root.find("actuator", name)
    terms = {"position": ("damping", "kp"), "velocity": ("armature", "kv")}.get(actuator.tag)
    if terms is None:
        return 0.0
    inertia, gain = attribute(actuator.joint, terms[0]), attribute(actuator, terms[1])
    return float(np.atleast_1d(inertia)[0] / gain) if inertia is not None and gain else 0.0
