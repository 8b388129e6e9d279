"""A world as sensors see it, without physics."""

from dataclasses import dataclass, field
from typing import Any

from auvsim.physics.truth import Truth
from auvsim.water.currents import CurrentField, Uniform
from auvsim.water.terrain import FlatFloor, Terrain


@dataclass(frozen=True)
class Around:
    """Still water over a flat floor, with nothing in it, if not said otherwise."""

    current: CurrentField = field(default_factory=lambda: Uniform((0.0, 0.0, 0.0)))
    terrain: Terrain = field(default_factory=lambda: FlatFloor(40.0))
    structures: dict[str, Any] = field(default_factory=dict)
    vehicles: dict[str, Truth] = field(default_factory=dict)

    def rays(self, place: Any, directions: Any, reach: float) -> None:
        """Nothing to meet."""
        return

    def truth(self, vehicle: str) -> Truth:
        """The state of another vehicle."""
        return self.vehicles[vehicle]


WATER = Around()
