"""Reads gridded currents, and variables of any kind, from NetCDF files, classic or NetCDF-4, by the CF conventions."""

import math
import re
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.water.settings import GridSettings

_SPEEDS = {"m/s": 1.0, "m s-1": 1.0, "m.s-1": 1.0, "m s^-1": 1.0, "m s**-1": 1.0, "meter second-1": 1.0}
_SPEEDS |= {"meters/second": 1.0, "meters per second": 1.0, "cm/s": 0.01, "cm s-1": 0.01}
LENGTHS = {"m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "km": 1000.0}
_TIMES = {"s": 1.0, "sec": 1.0, "second": 1.0, "min": 60.0, "minute": 60.0, "h": 3600.0, "hour": 3600.0, "day": 86400.0}
_NAMES = {
    "northward": ("northward_sea_water_velocity", "sea_water_y_velocity"),
    "eastward": ("eastward_sea_water_velocity", "sea_water_x_velocity"),
    "upward": ("upward_sea_water_velocity",),
}
_AXES = ("time", "depth", "north", "east")


class Variable(NamedTuple):
    """A variable of a file, unpacked; missing values are NaN."""

    dimensions: tuple[str, ...]
    values: Array
    attributes: dict[str, Any]

    @property
    def units(self) -> str:
        """Its units as written, or an empty text."""
        return str(self.attributes.get("units", "")).strip()


class GriddedCurrents(NamedTuple):
    """Currents on a grid whose axes increase; a missing axis has one point."""

    axes: tuple[Array, Array, Array, Array]  # time since the first [s]; depth, north, east [m]
    velocity: Array  # (time, depth, north, east, 3) NED [m/s]


def read(settings: GridSettings) -> GriddedCurrents:
    """The currents of a file, in metres and seconds.

    Raises:
        InputError: the file cannot be read, lacks a variable or coordinate, has other units or gaps.
    """
    variables = read_variables(Path(settings.file))
    try:
        return _gridded(variables, settings)
    except InputError as error:
        raise InputError(f"{settings.file}: {error}") from None


def read_variables(path: Path) -> dict[str, Variable]:
    """The numeric variables of a NetCDF file, by name.

    Raises:
        InputError: there is no such file, or it is no NetCDF.
    """
    if path.is_dir():
        raise InputError(f"{path}: it is a folder, not a file")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        classic = path.read_bytes()[:3] == b"CDF"
        return _classic(path) if classic else _netcdf4(path)
    except Exception as error:  # readers of broken files raise errors of any kind
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise InputError(f"{path}: not a whole NetCDF file: {reason}") from error


def _classic(path: Path) -> dict[str, Variable]:
    from scipy.io import netcdf_file

    with netcdf_file(path, mmap=False) as file:
        return {
            name: _unpacked(item.dimensions, np.array(item[...]), dict(item._attributes))
            for name, item in file.variables.items()
            if item.typecode() != "c"
        }


def _netcdf4(path: Path) -> dict[str, Variable]:
    with h5py.File(path, "r") as file:
        found = {}
        for name, item in file.items():
            if not isinstance(name, str) or not isinstance(item, h5py.Dataset) or item.dtype.kind not in "iuf":
                continue
            scales = [str(axis[0].name).rsplit("/", 1)[-1] if len(axis) else "" for axis in item.dims]
            own = (name,) if item.is_scale and item.ndim == 1 else tuple(scales)
            found[name] = _unpacked(own, np.asarray(item[...]), dict(item.attrs))
        return found


def _unpacked(dimensions: tuple[str, ...], values: Array, attributes: dict[str, Any]) -> Variable:
    """A variable with its texts as str, its packing undone and its fill values NaN."""
    plain = {
        key: value.decode() if isinstance(value, bytes) else np.ravel(value)[0] if np.size(value) == 1 else value
        for key, value in attributes.items()
        if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME")
    }
    texts = {key: value.decode() if isinstance(value, bytes) else value for key, value in plain.items()}
    missing = np.isin(values, [texts[key] for key in ("_FillValue", "missing_value") if key in texts])
    scaled = values.astype(float) * float(texts.get("scale_factor", 1.0)) + float(texts.get("add_offset", 0.0))
    scaled[missing] = math.nan
    return Variable(tuple(dimensions), scaled, texts)


def _gridded(variables: dict[str, Variable], settings: GridSettings) -> GriddedCurrents:
    north, east = (_velocity(variables, settings, which) for which in ("northward", "eastward"))
    try:
        up = _velocity(variables, settings, "upward")
    except InputError:
        if settings.upward is not None:
            raise
        up = north._replace(values=np.zeros_like(north.values))
    coordinates = {}
    for dimension in north.dimensions:
        if dimension not in variables:
            raise InputError(f"dimension '{dimension}' has no coordinate variable of its name")
        which, values = coordinate(dimension, variables[dimension], settings)
        if which in coordinates:
            raise InputError(f"two coordinates are {which}: {coordinates[which][0]} and {dimension}")
        coordinates[which] = dimension, values
    for which in ("north", "east"):
        if which not in coordinates:
            raise InputError(f"the velocities have no coordinate {which} (or {_GEOGRAPHIC[which]})")
    order = [coordinates[which][0] for which in _AXES if which in coordinates]
    axes = [coordinates[which][1] if which in coordinates else np.zeros(1) for which in _AXES]
    parts = []
    for part, sign in ((north, 1.0), (east, 1.0), (up, -1.0)):
        if sorted(part.dimensions) != sorted(order):
            raise InputError(f"velocities differ in their dimensions: {order} and {list(part.dimensions)}")
        values = sign * part.values.transpose([part.dimensions.index(name) for name in order])
        parts.append(values.reshape([axis.size for axis in axes]))
    velocity = np.stack(parts, axis=-1)
    for index, axis in enumerate(axes):
        steps = np.diff(axis)
        if np.any(steps <= 0) and np.any(steps >= 0):
            raise InputError(f"coordinate {_AXES[index]} does not increase or decrease all along")
        if steps.size and steps[0] < 0:
            axes[index], velocity = axis[::-1], np.flip(velocity, index)
    gaps = ~np.isfinite(velocity).all(axis=-1)
    if gaps.any():
        at = [axis[i] for axis, i in zip(axes, np.argwhere(gaps)[0], strict=True)]
        place = ", ".join(f"{name} {value:g}" for name, value in zip(_AXES, at, strict=True))
        raise InputError(f"{gaps.sum()} of {gaps.size} points have no current, the first at {place} [s, m]; fill them")
    axes[0] = axes[0] - axes[0][0]
    return GriddedCurrents(axes=(axes[0], axes[1], axes[2], axes[3]), velocity=np.ascontiguousarray(velocity))


def _velocity(variables: dict[str, Variable], settings: GridSettings, which: str) -> Variable:
    """The named or recognised velocity component in m/s."""
    name = getattr(settings, which)
    if name is None:
        names = _NAMES[which]
        name = next((key for key, item in variables.items() if item.attributes.get("standard_name") in names), None)
        if name is None:
            raise InputError(f"no variable has the standard_name {names[0]}; name one as `{which}`")
    elif name not in variables:
        raise InputError(f"no variable '{name}'; there are {', '.join(variables)}")
    found = variables[name]
    return found._replace(values=found.values * factor(name, found.units, _SPEEDS))


def factor(name: str, units: str, known: dict[str, float]) -> float:
    """What a variable's values are multiplied by to be in SI units.

    Raises:
        InputError: its units are not among those known.
    """
    if units not in known:
        raise InputError(f"'{name}' has the units '{units}'; known are {', '.join(known)}")
    return known[units]


_GEOGRAPHIC = {"north": "latitude", "east": "longitude"}


def coordinate(name: str, variable: Variable, settings: Any) -> tuple[str, Array]:
    """Which axis a coordinate is, and its values [s or m].

    Args:
        name: of the variable.
        variable: the coordinate.
        settings: with the latitude and longitude of the datum [deg], or None.

    Raises:
        InputError: it has gaps, unknown units, or is no coordinate that is known.
    """
    if not np.all(np.isfinite(variable.values)):
        raise InputError(f"coordinate '{name}' has gaps")
    standard, axis = str(variable.attributes.get("standard_name", "")), str(variable.attributes.get("axis", ""))
    units, lower = variable.units, name.lower()
    since = re.match(r"(\w+?)s? since ", units)
    if since or standard == "time" or axis == "T" or lower == "time":
        return "time", variable.values * factor(name, since[1] if since else units, _TIMES)
    if units.lower().startswith("degree") and units.lower() not in ("degree", "degrees"):
        which = "north" if "n" in units.lower()[6:] else "east"
        return which, _metres(variable.values, which, settings)
    for which, standards, letter, names in (
        ("depth", ("depth", "height", "altitude"), "Z", ("depth", "z", "lev", "level")),
        ("north", ("projection_y_coordinate", "latitude"), "Y", ("north", "northing", "y", "lat", "latitude")),
        ("east", ("projection_x_coordinate", "longitude"), "X", ("east", "easting", "x", "lon", "longitude")),
    ):
        if standard in standards or axis == letter or (not standard and not axis and lower in names):
            if which != "depth" and units.lower() in ("degree", "degrees"):
                return which, _metres(variable.values, which, settings)
            upward = variable.attributes.get("positive", "up" if standard in ("height", "altitude") else "down") == "up"
            sign = -1.0 if which == "depth" and upward else 1.0
            return which, sign * variable.values * factor(name, units, LENGTHS)
    raise InputError(f"coordinate '{name}' is no time, depth, latitude, longitude, y or x: give it a standard_name")


def _metres(degrees: Array, which: str, settings: Any) -> Array:
    """North or east [m] of the datum, by the radii of curvature of WGS84 there."""
    latitude, longitude = settings.latitude, settings.longitude
    if latitude is None or longitude is None:
        raise InputError(
            "the grid is in degrees: give the latitude and longitude of the datum, where north and east are 0"
        )
    a, e2 = 6378137.0, 6.69437999014e-3
    sine = math.sin(math.radians(latitude))
    normal = a / math.sqrt(1.0 - e2 * sine * sine)
    if which == "north":
        return np.radians(degrees - latitude) * normal * (1.0 - e2) / (1.0 - e2 * sine * sine)
    return np.radians((degrees - longitude + 180.0) % 360.0 - 180.0) * normal * math.cos(math.radians(latitude))
