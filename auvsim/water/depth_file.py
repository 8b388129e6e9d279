"""Reads gridded depths of the sea floor from NetCDF files (CF, GMT, GEBCO, EMODnet) and GeoTIFFs."""

import math
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.settings import Settings
from auvsim.water import geotiff, grid_file
from auvsim.water.grid_file import Variable
from auvsim.water.terrain_grid import Corner, GriddedFloor

MOST_POINTS = 4097  # of a grid along each side
EVEN = 0.1  # share of a step by which points of a regular grid may be off: coordinates are rounded
DEEPEST, SHALLOWEST = 12_000.0, 0.5  # that the deepest point can be [m]
STEEPEST = 5.0  # slope on both sides of a point from which on it is an error of sounding [-]
STEEP = 2.0  # slope that no sea floor has over half of a grid [-]
SMALLEST = 1.0  # grid, along each side [m]
FILLS = (-9999.0, 9999.0, -99999.0, 99999.0, -32768.0, 32767.0)  # that files have where nothing is known
_DOWN = ("sea_floor_depth_below_mean_sea_level", "sea_floor_depth_below_sea_surface", "sea_floor_depth_below_geoid")
_UP = ("height_above_mean_sea_level", "height_above_geopotential_datum", "height_above_reference_ellipsoid", "altitude")
_NAMES_DOWN = ("depth", "bathymetry", "bathy", "water_depth", "mean_depth")
_NAMES_UP = ("elevation", "topo", "topography", "height", "altitude")
_NAMES = (*_NAMES_UP, *_NAMES_DOWN, "z", "band1", geotiff.BAND)  # without standard names; of GMT and GDAL
_SHOWN_IN = {"(m)": "m", "(meters)": "m", "(metres)": "m", "[m]": "m"}  # units at the end of a long name

_FOOT, _FATHOM, _SURVEY_FOOT = 0.3048, 1.8288, 1200.0 / 3937.0  # [m]
LENGTHS = {**grid_file.LENGTHS, "cm": 0.01, "ft": _FOOT, "foot": _FOOT, "feet": _FOOT, "US_survey_foot": _SURVEY_FOOT}
LENGTHS |= {"fathom": _FATHOM, "fathoms": _FATHOM}

Unit = Literal["m", "km", "cm", "ft", "fathom"]


class DepthGridSettings(Settings):
    """Depths of the sea floor from a NetCDF file or a GeoTIFF, in place of `sea_floor`.

    The variable is found by its CF standard name (sea_floor_depth_below_mean_sea_level and the like, or a height above
    it), or by the names that are common (elevation, depth, z, Band1). Beyond its edge the floor stays as deep as there,
    for sensors; nothing is there to touch. Geographic grids become metres on the plane that touches the WGS84 ellipsoid
    in the datum; grid north of projected ones is taken for true north.
    """

    kind: Literal["grid"] = "grid"
    file: str = Field(description="path of the NetCDF file (classic or NetCDF-4) or GeoTIFF")
    variable: str | None = Field(default=None, description="name of the variable, if it is not found by itself")
    positive: Literal["down", "up"] | None = Field(
        default=None,
        description="which way values grow, up of heights; none: as the file says, or as they lie below the surface",
    )
    units: Unit | None = Field(default=None, description="of the depths, where the file does not say")
    coordinate_units: Unit | Literal["degrees"] | None = Field(
        default=None, description="of the coordinates, where the file does not say"
    )
    latitude: float | None = Field(
        default=None, ge=-85.0, le=85.0, description="of the datum, for geographic grids [deg]"
    )
    longitude: float | None = Field(default=None, ge=-180.0, le=360.0, description="of the datum [deg]")
    northing: float = Field(
        default=0.0, ge=-2e7, le=2e7, description="of the datum, for projected grids, on their map [metres]"
    )
    easting: float = Field(
        default=0.0, ge=-2e7, le=2e7, description="of the datum, for projected grids, on their map [metres]"
    )


class Depths(NamedTuple):
    """Depths at points whose coordinates rise."""

    north: Array  # (n,) of the datum [m]
    east: Array  # (m,) of the datum [m]
    values: Array  # (n, m) [m]


def read(settings: DepthGridSettings) -> GriddedFloor:
    """The sea floor of a file.

    Raises:
        InputError: one line that begins with the file and says what cannot be used and what would be right.
    """
    try:
        path = Path(settings.file)
        depths = _depths(_variables(path), settings)
        _check(depths)
        return _regular(depths)
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(settings.file) else f"{settings.file}: {text}") from None


def _variables(path: Path) -> dict[str, Variable]:
    if path.is_file():
        with path.open("rb") as file:
            if file.read(4) in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
                return geotiff.read(path)
    variables = grid_file.read_variables(path)
    return _unrolled(variables) if {"x_range", "y_range", "dimension", "z"} <= set(variables) else variables


def _unrolled(variables: dict[str, Variable]) -> dict[str, Variable]:
    """The variables x, y and z of a file of GMT before version 4, whose rows go from north to south in one line."""
    columns, rows = (int(count) for count in variables["dimension"].values)
    z = variables["z"]
    half = 0.5 if z.attributes.get("node_offset", 0) else 0.0  # pixels, or points up to the edges
    found = {"z": Variable(("y", "x"), z.values.reshape(rows, columns)[::-1], {})}
    for name, count in (("x", columns), ("y", rows)):
        low, high = variables[f"{name}_range"].values
        step = (high - low) / (count - 1 + 2.0 * half)
        found[name] = Variable((name,), low + step * (np.arange(count) + half), {})
    for name, variable in found.items():
        said = variables[f"{name}_range"].units if f"{name}_range" in variables else ""
        variable.attributes["units" if said in LENGTHS else "long_name"] = said
    return found


def _depths(variables: dict[str, Variable], settings: DepthGridSettings) -> Depths:
    """Depths and coordinates [m] of a file's variables, rising."""
    name = _depth_variable(variables, settings)
    found = variables[name]
    axes: dict[str, Array] = {}
    order: list[str] = []
    for dimension, count in zip(found.dimensions, found.values.shape, strict=True):
        if dimension not in variables:
            raise InputError(f"dimension '{dimension}' of '{name}' has no coordinate variable of its name")
        if variables[dimension].values.shape != (count,):
            raise InputError(f"coordinate '{dimension}' is not one value for each of {count} points of '{name}'")
        which, axis = _coordinate(dimension, variables[dimension], settings)
        axes[which] = axis
        order.append(which)
    if sorted(order) != ["east", "north"]:
        raise InputError(f"'{name}' is over {', '.join(order) or 'nothing'}; depths are over north and east alone")
    values = found.values * grid_file.factor(name, _units(name, found, settings), LENGTHS)
    values = values.T if order == ["east", "north"] else values
    for i, which in enumerate(("north", "east")):
        steps = np.diff(axes[which])
        if steps.size < 1 or not (np.all(steps > 0.0) or np.all(steps < 0.0)):
            raise InputError(f"coordinate {which} must increase or decrease all along, over two points or more")
        if steps[0] < 0.0:
            axes[which], values = axes[which][::-1], np.flip(values, i)
    _check_holes(axes["north"], axes["east"], found.values if order == ["north", "east"] else found.values.T, values)
    return Depths(axes["north"], axes["east"], _sign(name, found, values, settings) * values)


def _depth_variable(variables: dict[str, Variable], settings: DepthGridSettings) -> str:
    """Name of the variable of depths or heights: the one that is set, or by standard name, or by usual names."""
    if settings.variable is not None:
        if settings.variable not in variables:
            raise InputError(f"no variable '{settings.variable}'; there are {', '.join(variables)}")
        return settings.variable
    flat = {name: found for name, found in variables.items() if len(found.dimensions) == 2}
    standard = [n for n, found in flat.items() if found.attributes.get("standard_name", "") in (*_DOWN, *_UP)]
    usual = [n for wanted in _NAMES for n, found in flat.items() if n.lower() == wanted and not _is_other(found)]
    found = standard or usual[:1]
    if not found:
        there = f"; there are {', '.join(flat)}" if flat else ""
        raise InputError(f"no variable has the standard_name {_DOWN[0]} or a usual name; name one as `variable`{there}")
    if len(found) > 1:
        raise InputError(f"{' and '.join(found)} are depths or heights all; name one of them as `variable`")
    return found[0]


def _is_other(variable: Variable) -> bool:
    """Whether a standard name says that a variable is neither a depth nor a height of the floor."""
    return bool(variable.attributes.get("standard_name"))


def _units(name: str, variable: Variable, settings: DepthGridSettings) -> str:
    """Units of depths: of the attribute, at the end of the long name, or as set."""
    long_name = str(variable.attributes.get("long_name", "")).lower().strip()
    shown = next((unit for end, unit in _SHOWN_IN.items() if long_name.endswith(end)), "")
    return _stated(f"'{name}' has", variable.units or shown, settings.units, "units", "m, km, cm, ft or fathom")


def _stated(what: str, stated: str, given: str | None, key: str, known: str) -> str:
    """Units that a file states or settings give.

    Raises:
        InputError: neither does, or they contradict each other.
    """
    if not stated and given is None:
        raise InputError(f"{what} no units; give them as `{key}`: {known}")
    if stated and given is not None and not _are_alike(stated, given):
        raise InputError(f"{what} the units '{stated}'; `{key}: {given}` contradicts them")
    return stated or str(given)


def _are_alike(one: str, other: str) -> bool:
    if other == "degrees":
        return one.lower().startswith("degree")
    return LENGTHS.get(one) == LENGTHS[other]


def _coordinate(name: str, variable: Variable, settings: DepthGridSettings) -> tuple[str, Array]:
    """Which axis a coordinate is, `north` or `east`, and its values from the datum [m]."""
    hints = (name.lower(), str(variable.attributes.get("long_name", "")).lower().strip())
    which = next((w for w in ("latitude", "longitude") for hint in hints if hint in (w, w[:3])), None)
    if which and not variable.units:
        attributes: dict[str, Any] = {"units": "degrees_north" if which == "latitude" else "degrees_east"}
    else:
        stated = _stated(
            f"coordinate '{name}' has",
            variable.units,
            settings.coordinate_units,
            "coordinate_units",
            "m, km or degrees",
        )
        attributes = {**variable.attributes, "units": stated}
    units, raw = str(attributes["units"]), variable.values
    if units in LENGTHS:
        attributes, raw = {**attributes, "units": "m"}, LENGTHS[units] * raw
    axis, values = grid_file.coordinate(name, variable._replace(attributes=attributes, values=raw), settings)
    if axis in ("north", "east"):
        if units in LENGTHS:
            values = values - (settings.northing if axis == "north" else settings.easting)
        elif (farthest := float(np.abs(raw).max())) > (90.0 if axis == "north" else 360.0):
            raise InputError(f"coordinate '{name}' goes to {farthest:g} degrees; is it in metres?")
        extent = float(np.ptp(values))
        if extent < SMALLEST:
            raise InputError(
                f"coordinate '{name}' spans {extent:.3g} m by its units '{units}'; is it in degrees or km?"
            )
    return axis, values


def _sign(name: str, variable: Variable, values: Array, settings: DepthGridSettings) -> float:
    """What makes depths of values: 1 of depths, -1 of heights.

    By the settings, the standard name, the attribute `positive`, or the variable's name; where none of them says,
    values of one sign lie below the surface.
    """
    standard = str(variable.attributes.get("standard_name", ""))
    positive = str(variable.attributes.get("positive", "")).lower()
    said = settings.positive
    said = said or ("down" if standard in _DOWN else "up" if standard in _UP else None)
    said = said or (positive if positive in ("down", "up") else None)
    lower = name.lower()
    said = said or ("down" if lower in _NAMES_DOWN else "up" if lower in _NAMES_UP else None)
    if said is None:
        if values.min() < 0.0 < values.max():
            raise InputError(
                f"'{name}' goes from {values.min():g} to {values.max():g} m and does not say whether that is down or "
                "up; give `positive: down` of depths or `positive: up` of heights"
            )
        said = "up" if values.min() < 0.0 else "down"
    return 1.0 if said == "down" else -1.0


def _check_holes(north: Array, east: Array, raw: Array, values: Array) -> None:
    """Refuses points (n, m) without a depth: not finite, or the numbers that files have instead.

    Args:
        north: (n,) [m].
        east: (m,) [m].
        raw: as in the file, not in the order of `values`.
        values: as of the coordinates.
    """
    holes = ~np.isfinite(values)
    if holes.any():
        i, j = np.argwhere(holes)[0]
        raise InputError(
            f"{holes.sum()} of {holes.size} points have no depth; fill them (the first at north {north[i]:g} m, east "
            f"{east[j]:g} m)"
        )
    for fill in FILLS:
        if (count := int((raw == fill).sum())) > 1:
            raise InputError(f"{count} points are {fill:g}, as files have it where nothing is known; fill them")


def _check(depths: Depths) -> None:
    """Refuses depths that no sea has: heights taken for depths, wrong units, fill values, spikes.

    Raises:
        InputError: one line with the first place at fault.
    """
    north, east, values = depths
    if values.max() <= 0.0:
        raise InputError(
            f"all depths are 0 or less, down to {values.min():g} m, above the surface; say `positive: up` of heights "
            "or `positive: down` of depths"
        )
    if values.max() < SHALLOWEST:
        raise InputError(f"the deepest point is {values.max():.3g} m deep; are the depths in km?")
    deepest = float(np.abs(values).max())
    if deepest > DEEPEST:
        raise InputError(f"a depth of {deepest:g} m is more than that of any sea, {DEEPEST:g} m; is it a fill value?")
    for spiked in (_spikes(north, values), _spikes(east, values.T).T):
        for i, j in np.argwhere(spiked):
            raise InputError(
                f"the depth of {values[i, j]:g} m at north {north[i]:g} m, east {east[j]:g} m is a spike, steeper than "
                f"{STEEPEST:g} to 1 on either side; mend it"
            )
    for which, axis, lines in (("north", north, values), ("east", east, values.T)):
        slope = float(np.median(np.abs(np.diff(lines, axis=0) / np.diff(axis)[:, None])))
        if slope > STEEP:
            raise InputError(
                f"half of the floor is steeper than {slope:.3g} to 1 towards {which}; are the coordinates in km or "
                "degrees, or the depths in cm or feet?"
            )


def _spikes(axis: Array, depths: Array) -> NDArray[np.bool_]:
    """Points (n, m) that are steeply above or below both their neighbours along the first axis (n,) [m]."""
    slopes = np.diff(depths, axis=0) / np.diff(axis)[:, None]
    before, after = slopes[:-1], -slopes[1:]
    spiked = np.zeros(depths.shape, dtype=bool)
    spiked[1:-1] = (np.minimum(np.abs(before), np.abs(after)) > STEEPEST) & (before * after > 0.0)
    return spiked


def _regular(depths: Depths) -> GriddedFloor:
    """Depths on a regular grid as fine as the closest points."""
    values = depths.values
    for i, (which, axis) in enumerate((("north", depths.north), ("east", depths.east))):
        steps = np.diff(axis)
        even = np.abs(axis - np.linspace(axis[0], axis[-1], axis.size)).max() <= EVEN * steps.mean()
        count = axis.size if even else 1 + math.ceil((axis[-1] - axis[0]) / steps.min() - 1e-6)
        if count > MOST_POINTS:
            what = f"{axis.size} points" if even else f"steps of {steps.min():.3g} to {steps.max():.3g} m"
            raise InputError(
                f"coordinate {which} has {what}, which makes a regular grid of {count} points, at most {MOST_POINTS}; "
                "cut out the part that is needed or thin it"
            )
        if not even:
            regular = np.linspace(axis[0], axis[-1], count)
            values = np.apply_along_axis(lambda line, at=axis, to=regular: np.interp(to, at, line), i, values)
    n, m = values.shape
    north, east = depths.north, depths.east
    corner = Corner(
        float(north[0]), float(east[0]), float(north[-1] - north[0]) / (n - 1), float(east[-1] - east[0]) / (m - 1)
    )
    return GriddedFloor(corner, np.ascontiguousarray(values))
