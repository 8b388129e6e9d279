"""Shape of the sea floor: flat, a slope, the user's own grid of depths, or one made from a seed."""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, Protocol

from pydantic import Field

from auvsim.base.settings import Settings
from auvsim.water import depth_file
from auvsim.water.depth_file import DepthGridSettings
from auvsim.water.seabed import SeabedSettings, make
from auvsim.water.terrain_grid import GriddedFloor


class FlatSettings(Settings):
    """A level sea floor at the depth `sea_floor`."""

    kind: Literal["flat"] = "flat"


class SlopeSettings(Settings):
    """A plane sea floor that is `sea_floor` deep at the datum."""

    kind: Literal["slope"] = "slope"
    gradient: float = Field(default=0.05, ge=0.0, le=0.5, description="depth gained per metre down the slope [-]")
    direction_deg: float = Field(default=0.0, description="direction in which it gets deeper, from north [deg]")


TerrainSettings = Annotated[
    FlatSettings | SlopeSettings | DepthGridSettings | SeabedSettings, Field(discriminator="kind")
]


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


@dataclass(frozen=True, slots=True)
class SlopedFloor:
    """A plane sea floor."""

    level: float  # its depth at the datum [m]
    to_north: float  # depth gained per metre northward [-]
    to_east: float  # depth gained per metre eastward [-]

    def depth(self, north: float, east: float) -> float:
        """Depth of the sea floor [m] at a place in NED [m]."""
        return self.level + self.to_north * north + self.to_east * east


def build_terrain(settings: TerrainSettings, sea_floor: float) -> Terrain:
    """The sea floor of settings.

    Args:
        settings: of its shape.
        sea_floor: its depth, at the datum where it is no plane [m].

    Raises:
        InputError: the file of a grid cannot be used.
    """
    match settings:
        case SlopeSettings():
            direction = math.radians(settings.direction_deg)
            to_north, to_east = settings.gradient * math.cos(direction), settings.gradient * math.sin(direction)
            return SlopedFloor(sea_floor, to_north, to_east)
        case SeabedSettings():
            return make(settings, sea_floor)  # pyright: ignore[reportArgumentType] (frozen, and so hashable)
        case DepthGridSettings():
            path = Path(settings.file)
            modified = path.stat().st_mtime_ns if path.is_file() else 0
            return _read(settings, modified)  # pyright: ignore[reportArgumentType] (frozen, and so hashable)
    return FlatFloor(sea_floor)


@lru_cache(maxsize=8)
def _read(settings: DepthGridSettings, modified: int) -> GriddedFloor:
    """The sea floor of a file, which is read again when it has changed."""
    return depth_file.read(settings)
