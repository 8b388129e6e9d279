"""Latitudes and longitudes in degrees, however they are written."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification import cleaning
from auvsim.identification.columns import Meaning
from auvsim.identification.table_text import Column

DEGREE = math.radians(1.0) * 6_371_000.0  # of latitude, on the mean sphere [m]
LARGEST = {"latitude": 90.0, "longitude": 180.0}  # [deg]
EASTWARD = 360.0  # longitudes may count on to the east [deg]


def degrees(
    columns: Mapping[str, Column], meanings: Mapping[str, Meaning], path: Path
) -> tuple[dict[str, Column], list[str]]:
    """The columns, latitude and longitude written as degrees and minutes turned into degrees, and notes on that.

    Raises:
        InputError: One is beyond its range and no degrees and minutes.
    """
    found, notes = dict(columns), []
    given = {name: meanings[name] for name in LARGEST if name in meanings}
    raw = {name: np.where(cleaning.fills(columns[m.column].values), np.nan, columns[m.column].values)
           for name, m in given.items()}  # fmt: skip
    largest = {name: float(np.nanmax(np.abs(values * given[name].factor))) for name, values in raw.items()}
    beyond = [name for name, size in largest.items() if size > (EASTWARD if name == "longitude" else LARGEST[name])]
    if not beyond:
        return found, notes
    for name, meaning in given.items():
        turned = cleaning.degrees_and_minutes(raw[name], LARGEST[name])
        if turned is None:
            raise InputError(
                f"{path}: column '{meaning.column}' ({name}) reaches {largest[name]:g} deg; the largest is "
                f"{LARGEST[name]:g} deg, or {100 * LARGEST[name]:.0f} as degrees and minutes (4112.34)"
            )
        found[meaning.column] = replace(columns[meaning.column], values=turned)
        notes.append(f"{path.name}: {meaning.column} is read as degrees and minutes (ddmm.mm), as it reaches "
                     f"{largest[name]:g}")  # fmt: skip
    return found, notes
