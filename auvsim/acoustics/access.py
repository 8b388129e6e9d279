"""Medium access: who may send when. Free (ALOHA), in slots of time (TDMA), or when polled by a master."""

import math
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from auvsim.base.settings import Settings, tag_by_kind


class FreeSettings(Settings):
    """Everyone sends when it wants to (ALOHA)."""

    kind: Literal["none"] = "none"


class TdmaSettings(Settings):
    """Slots in turn, by each modem's own clock; a modem sends at the beginning of its slots alone, once in each.

    No packets collide where a slot holds the longest packet and the travel time over `reach`, and the clocks agree.
    """

    kind: Literal["tdma"] = "tdma"
    slot: float = Field(default=4.0, gt=0.0, description="length of a slot [s]")
    reach: float = Field(default=1500.0, ge=0.0, description="distance up to which slots keep packets apart [m]")
    order: tuple[str, ...] = Field(
        default=(), description="vehicles in the order of their slots; none: as in the scenario"
    )


class PollingSettings(Settings):
    """A master tells its state and each time asks the next modem, which replies with its own; nobody else sends."""

    kind: Literal["polling"] = "polling"
    master: str = Field(default="leader", description="vehicle that polls")
    period: float = Field(default=8.0, ge=0.1, description="time between two polls [s]")
    phase: float = Field(default=0.0, ge=0.0, description="time of the first, by the master's clock [s]")


AccessSettings = Annotated[
    Annotated[FreeSettings, Tag("FreeSettings")]
    | Annotated[TdmaSettings, Tag("TdmaSettings")]
    | Annotated[PollingSettings, Tag("PollingSettings")],
    Discriminator(tag_by_kind(FreeSettings, TdmaSettings, PollingSettings)),
]


class Slots:
    """The slots of one modem, each of which is given away once; times are by its clock.

    Args:
        index: of its slot in a frame.
        count: slots of a frame.
        length: of a slot [s].
    """

    def __init__(self, index: int, count: int, length: float) -> None:
        self._first, self._frame, self._taken = index * length, count * length, -1

    def take(self, wanted: float) -> float:
        """Begin of the first free slot at or after a time [s]."""
        number = max(self._taken + 1, math.ceil((wanted - self._first) / self._frame - 1e-9))
        self._taken = number
        return self._first + number * self._frame
