"""A place that moves to a goal at a speed, and waits for the vehicle that follows it."""

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.missions.mission import MissionSetup
from auvsim.vehicles.actuation import Thrusters

LEAD = 0.8  # longest distance of the place ahead of the vehicle [m]


def require_thrusters(setup: MissionSetup) -> None:
    """Sees that a vehicle can hover.

    Raises:
        InputError: it cannot.
    """
    if not isinstance(setup.vehicle.actuation, Thrusters):
        raise InputError(
            f"mission {setup.settings.kind} of '{setup.name}': '{setup.vehicle.model}' cannot hover; it needs a "
            "vehicle that thrusters drive, such as bluerov2_heavy"
        )


class Carrot:
    """The place that is asked of the controller, on its way to a goal.

    Args:
        period: between two moves [s].
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._place: Array | None = None

    def move(self, goal: Array, here: Array, speed: float) -> Array:
        """The place (2,) now.

        Args:
            goal: (2,) north, east [m].
            here: (2,) where the vehicle is [m].
            speed: of the place over ground [m/s].
        """
        place = here if self._place is None else self._place
        way = goal - place
        distance = float(np.hypot(*way))
        step = speed * self._period
        place = goal if distance <= step else place + way * (step / distance)
        off = place - here
        ahead = float(np.hypot(*off))
        if ahead > LEAD:
            place = here + off * (LEAD / ahead)
        self._place = place
        return place
