"""Shape of the sea floor."""

from dataclasses import dataclass
from typing import Protocol


class Terrain(Protocol):
    """Depth of the sea floor as a function of place."""

    def depth(self, north: float, east: float) -> float:
        """Depth of the sea floor [m] at a place in NED [m]."""
        ...


@dataclass(frozen=True, slots=True)
class FlatFloor:
    """A level sea floor."""

    level: float  # its depth [m]

    def depth(self, north: float, east: float) -> float:
        """Depth of the sea floor [m], the same everywhere."""
        return self.level
