"""Contacts of vehicles: what they touch, and with what force, step by step."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np


class Contact(NamedTuple):
    """Contact of a vehicle with one thing during one step of the physics."""

    time: float  # end of the step [s]
    force: float  # sum of the magnitudes of the contact forces, friction included [N]
    other: str  # instance name of what is touched, or `sea_floor`
    duration: float  # of the step [s]


class ContactRecorder:
    """Sums the contact forces of each step by vehicle and by what it touches.

    Args:
        model: the compiled scene.
        data: its state.
        vehicles: instance names of the vehicles in it.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, vehicles: Iterable[str]) -> None:
        self._model, self._data = model, data
        self._owners = [_owner(model, geom) for geom in range(model.ngeom)]
        self._force = np.zeros(6)  # of one contact: normal, two of friction, three moments
        self.found: dict[str, list[Contact]] = {name: [] for name in vehicles}

    def clear(self) -> None:
        """Forgets all contacts."""
        for contacts in self.found.values():
            contacts.clear()

    def record(self) -> None:
        """Adds the contacts of the step just made."""
        data, owners, totals = self._data, self._owners, {}
        force = self._force[:3]
        contacts = data.contact
        pairs = zip(contacts.efc_address.tolist(), contacts.geom.tolist(), strict=True)
        for i, (address, (first, second)) in enumerate(pairs):
            if address < 0:
                continue
            mujoco.mj_contactForce(self._model, data, i, self._force)
            magnitude = math.sqrt(force.dot(force))
            one, other = owners[first], owners[second]
            for pair in {(one, other), (other, one)}:
                totals[pair] = totals.get(pair, 0.0) + magnitude
        for (name, other), total in sorted(totals.items()):
            if total > 0.0 and name in self.found:
                self.found[name].append(Contact(data.time, total, other, self._model.opt.timestep))


def _owner(model: mujoco.MjModel, geom: int) -> str:
    """Instance that a geom belongs to: the name of its tree's top body; the geom's own name in the world body."""
    root = int(model.body_rootid[model.geom_bodyid[geom]])
    return model.body(root).name.removesuffix("/") if root else model.geom(geom).name
