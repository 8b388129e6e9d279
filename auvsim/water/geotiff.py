"""Reads one band of a GeoTIFF and where its pixels are, as variables in the form of those of a NetCDF file.

Tags and keys are those of OGC 19-008r4 (GeoTIFF 1.1); units, scale and offset of the band and its value for "no data"
are in GDAL's own tags. Pillow reads the pixels.
"""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.water.grid_file import Variable

BAND = "band 1"
_SCALE, _TIES, _TURN, _KEYS, _METADATA, _NO_DATA = 33550, 33922, 34264, 34735, 42112, 42113  # tags
_MODEL, _RASTER, _ANGULAR, _LINEAR, _VERTICAL = 1024, 1025, 2054, 3076, 4099  # keys
_LENGTHS = {9001: "m", 9002: "ft", 9003: "US_survey_foot", 9036: "km"}  # EPSG codes of units
_DEGREE, _POINT = 9102, 2  # the angular unit's code; pixels are points, not areas
PROJECTED, GEOGRAPHIC = 1, 2


def read(path: Path) -> dict[str, Variable]:
    """The first band and its coordinates: `y` and `x`, or `latitude` and `longitude`.

    Raises:
        InputError: the file is broken, is no grid that is placed on the earth, or is turned against its axes.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            tags = dict(image.tag_v2)  # pyright: ignore[reportAttributeAccessIssue] (of a TIFF)
            values = np.asarray(image, dtype=float)
    except Exception as error:  # readers of broken files raise errors of any kind
        kind = "its pixels are of no kind that is known" if isinstance(error, UnidentifiedImageError) else str(error)
        reason = (kind.strip() or type(error).__name__).splitlines()[0]
        raise InputError(
            f"a TIFF that cannot be read ({reason}); `gdal_translate -b 1 -ot Float32` makes one that can"
        ) from error
    if values.ndim != 2:
        raise InputError(f"an image of {values.shape[2]} colours, not a grid of depths")
    try:
        return _placed(values, tags)
    except (TypeError, ValueError, IndexError, OverflowError) as error:
        raise InputError(f"a TIFF whose tags are broken ({error}); `gdal_translate` writes them anew") from error


def _placed(values: Array, tags: dict[int, Any]) -> dict[str, Variable]:
    """The band and its coordinates, by the tags of the file."""
    keys = _keys(tags)
    model = keys.get(_MODEL)
    if model not in (PROJECTED, GEOGRAPHIC):
        raise InputError("a TIFF without a projected or geographic reference system (GTModelTypeGeoKey); it is needed")
    if model == GEOGRAPHIC and keys.get(_ANGULAR, _DEGREE) != _DEGREE:
        raise InputError(f"angles in the unit EPSG:{keys[_ANGULAR]}; known are degrees")
    north, east = _axes(tags, values.shape, keys.get(_RASTER) == _POINT)
    names = ("latitude", "longitude") if model == GEOGRAPHIC else ("y", "x")
    units = ("degrees_north", "degrees_east") if model == GEOGRAPHIC else (_length(keys, _LINEAR),) * 2
    axes = {
        name: Variable((name,), axis, {"units": unit})
        for name, axis, unit in zip(names, (north, east), units, strict=True)
    }
    return {**axes, BAND: _band(names, values, tags, _length(keys, _VERTICAL))}


def _keys(tags: dict[int, Any]) -> dict[int, int]:
    """Keys that are numbers themselves, by the directory of them."""
    entries = np.array(tags.get(_KEYS, ()), dtype=int)
    return {int(key): int(value) for key, where, _, value in entries[4:].reshape(-1, 4) if where == 0}


def _length(keys: dict[int, int], key: int) -> str:
    """Unit of length that a key names; "" where there is none, and its code where it is not known."""
    return _LENGTHS.get(keys[key], f"EPSG:{keys[key]}") if key in keys else ""


def _axes(tags: dict[int, Any], shape: tuple[int, ...], points: bool) -> tuple[Array, Array]:
    """Coordinates of the rows and columns."""
    if _TURN in tags:
        matrix = np.array(tags[_TURN]).reshape(4, 4)
        if matrix[0, 1] or matrix[1, 0]:
            raise InputError("a TIFF whose rows run neither north nor east; `gdalwarp` makes them do so")
        scale, first = (matrix[0, 0], -matrix[1, 1]), (matrix[0, 3], matrix[1, 3])
    elif _SCALE in tags and len(tags.get(_TIES, ())) == 6:
        i, j, _, x, y, _ = tags[_TIES]
        scale = tags[_SCALE][:2]
        first = x - i * scale[0], y + j * scale[1]
    else:
        raise InputError("a TIFF whose place is not given by one tie point and the size of a pixel")
    middle = 0.0 if points else 0.5
    north = first[1] - scale[1] * (np.arange(shape[0]) + middle)
    east = first[0] + scale[0] * (np.arange(shape[1]) + middle)
    return np.asarray(north, dtype=float), np.asarray(east, dtype=float)


def _band(names: tuple[str, str], values: Array, tags: dict[int, Any], vertical: str) -> Variable:
    """The values, scaled; NaN where they are those for "no data"."""
    try:
        missing = float(str(tags.get(_NO_DATA, "nan")).strip("\0 "))
    except ValueError:
        missing = math.nan
    metadata = str(tags.get(_METADATA, ""))

    def of_band(role: str, default: str) -> str:
        found = re.search(rf'sample="0"\s+role="{role}"[^>]*>([^<]*)<', metadata)
        return found[1].strip() if found else default

    holes = values == (np.float32(missing) if abs(missing) < 3.5e38 else missing)
    values = np.where(holes, math.nan, float(of_band("scale", "1")) * values + float(of_band("offset", "0")))
    return Variable(names, values, {"units": of_band("unittype", vertical)})
