"""Shape of the sea floor: flat, a slope, the user's own grid of depths, or one made from a seed."""

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.settings import Settings
from auvsim.water import grid_file
from auvsim.water.seabed import SeabedSettings, make
from auvsim.water.terrain_grid import Corner, GriddedFloor

MOST_POINTS = 4097  # of a grid along each side, after it is made regular
DEEPEST = 12_000.0  # [m]
STEEPEST = 5.0  # slope on both sides of a point from which on it is an error of sounding [-]
_DOWN = ("sea_floor_depth_below_mean_sea_level", "sea_floor_depth_below_sea_surface", "sea_floor_depth_below_geoid")
_UP = ("height_above_mean_sea_level", "height_above_geopotential_datum", "height_above_reference_ellipsoid", "altitude")


class FlatSettings(Settings):
    """A level sea floor at the depth `sea_floor`."""

    kind: Literal["flat"] = "flat"


class SlopeSettings(Settings):
    """A plane sea floor that is `sea_floor` deep at the datum."""

    kind: Literal["slope"] = "slope"
    gradient: float = Field(default=0.05, ge=0.0, le=0.5, description="depth gained per metre down the slope [-]")
    direction_deg: float = Field(default=0.0, description="direction in which it gets deeper, from north [deg]")


class DepthGridSettings(Settings):
    """Depths of the sea floor from a NetCDF file, by CF conventions, in place of `sea_floor`.

    The variable is found by its standard name (sea_floor_depth_below_mean_sea_level and the like, or a height above
    it). Beyond its edge the floor stays as deep as there, for sensors; nothing is there to touch.
    """

    kind: Literal["grid"] = "grid"
    file: str = Field(description="path of the NetCDF file (classic or NetCDF-4)")
    variable: str | None = Field(default=None, description="name of the variable, if it has no standard name")
    positive: Literal["down", "up"] = Field(default="down", description="of a variable that is named here")
    latitude: float | None = Field(
        default=None, ge=-85.0, le=85.0, description="of the datum, for geographic grids [deg]"
    )
    longitude: float | None = Field(default=None, ge=-180.0, le=360.0, description="of the datum [deg]")


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
    try:
        return _gridded(settings)
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(settings.file) else f"{settings.file}: {text}") from None


def _gridded(settings: DepthGridSettings) -> GriddedFloor:
    variables = grid_file.read_variables(Path(settings.file))
    name, sign = _depth_variable(variables, settings)
    found = variables[name]
    values = sign * found.values * grid_file.factor(name, found.units, grid_file.LENGTHS)
    axes: dict[str, Array] = {}
    order: list[str] = []
    for dimension in found.dimensions:
        if dimension not in variables:
            raise InputError(f"dimension '{dimension}' has no coordinate variable of its name")
        which, axis = grid_file.coordinate(dimension, variables[dimension], settings)
        axes[which] = axis
        order.append(which)
    if sorted(order) != ["east", "north"]:
        raise InputError(f"'{name}' is over {', '.join(order) or 'nothing'}; depths are over north and east alone")
    if order == ["east", "north"]:
        values = values.T
    for i, which in enumerate(("north", "east")):
        steps = np.diff(axes[which])
        if steps.size < 1 or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
            raise InputError(f"coordinate {which} must increase or decrease all along, over two points or more")
        if steps[0] < 0.0:
            axes[which], values = axes[which][::-1], np.flip(values, i)
    if not np.isfinite(values).all():
        raise InputError(f"{(~np.isfinite(values)).sum()} of {values.size} points have no depth; fill them")
    _check_depths(axes["north"], axes["east"], values)
    return _regular(axes["north"], axes["east"], values)


def _check_depths(north: Array, east: Array, depths: Array) -> None:
    """Refuses depths (n, m) [m] that no sea has: heights taken for depths, fill values, spikes.

    Raises:
        InputError: one line with the first place at fault.
    """
    if depths.max() <= 0.0:
        raise InputError(f"all depths are 0 or less, down to {depths.min():g} m; of heights say `positive: up`")
    deepest = float(np.abs(depths).max())
    if deepest > DEEPEST:
        raise InputError(f"a depth of {deepest:g} m is more than that of any sea, {DEEPEST:g} m; is it a fill value?")
    for spiked in (_spikes(north, depths), _spikes(east, depths.T).T):
        for i, j in np.argwhere(spiked):
            raise InputError(
                f"the depth of {depths[i, j]:g} m at north {north[i]:g} m, east {east[j]:g} m is a spike, steeper than "
                f"{STEEPEST:g} to 1 on either side; mend it"
            )


def _spikes(axis: Array, depths: Array) -> NDArray[np.bool_]:
    """Points (n, m) that are steeply above or below both their neighbours along the first axis (n,) [m]."""
    slopes = np.diff(depths, axis=0) / np.diff(axis)[:, None]
    before, after = slopes[:-1], -slopes[1:]
    spiked = np.zeros(depths.shape, dtype=bool)
    spiked[1:-1] = (np.minimum(np.abs(before), np.abs(after)) > STEEPEST) & (before * after > 0.0)
    return spiked


def _depth_variable(variables: dict[str, grid_file.Variable], settings: DepthGridSettings) -> tuple[str, float]:
    """Name of the variable of depths or heights, and the sign that makes depths of it."""
    if settings.variable is not None:
        if settings.variable not in variables:
            raise InputError(f"no variable '{settings.variable}'; there are {', '.join(variables)}")
        return settings.variable, 1.0 if settings.positive == "down" else -1.0
    for name, variable in variables.items():
        standard = str(variable.attributes.get("standard_name", ""))
        if standard in (*_DOWN, *_UP) and len(variable.dimensions) == 2:
            return name, 1.0 if standard in _DOWN else -1.0
    raise InputError(f"no variable has the standard_name {_DOWN[0]}; name one as `variable`")


def _regular(north: Array, east: Array, values: Array) -> GriddedFloor:
    """Depths on a regular grid as fine as the closest points, up to `MOST_POINTS` a side."""
    for i, axis in enumerate((north, east)):
        count = min(MOST_POINTS, 1 + math.ceil((axis[-1] - axis[0]) / np.diff(axis).min() - 1e-6))
        even = np.linspace(axis[0], axis[-1], count)
        values = np.apply_along_axis(lambda line, at=axis, to=even: np.interp(to, at, line), i, values)
    n, m = values.shape
    corner = Corner(
        float(north[0]), float(east[0]), float(north[-1] - north[0]) / (n - 1), float(east[-1] - east[0]) / (m - 1)
    )
    return GriddedFloor(corner, np.ascontiguousarray(values))
