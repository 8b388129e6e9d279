"""The sea surface: its elevation above a place, and how that changes."""

from typing import NamedTuple, Protocol, runtime_checkable

from auvsim.base.frames import Array
from auvsim.water.field import CurrentField, terms


class Surface(NamedTuple):
    """The surface above one place at one time."""

    elevation: float  # above the mean level [m]
    rate: float  # its partial derivative in time [m/s]
    north_slope: float  # rise per metre northward [-]
    east_slope: float  # rise per metre eastward [-]


CALM = Surface(0.0, 0.0, 0.0, 0.0)


@runtime_checkable
class MovesSurface(Protocol):
    """A current field that comes with a moving surface."""

    def surface(self, time: float, position: Array) -> Surface:
        """The surface at a time [s] above a position (3,) in NED [m]."""
        ...


def movers(field: CurrentField) -> tuple[MovesSurface, ...]:
    """The parts of a field that move the surface; without any it is calm."""
    return tuple(part for part in terms(field) if isinstance(part, MovesSurface))


def surface(field: CurrentField, time: float, position: Array) -> Surface:
    """The surface at a time [s] above a position (3,) in NED [m], of all parts of a field together."""
    total = CALM
    for part in movers(field):
        total = Surface(*(a + b for a, b in zip(total, part.surface(time, position), strict=True)))
    return total
