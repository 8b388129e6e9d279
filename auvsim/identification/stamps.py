"""The time of a file's rows: its unit where the header has none, and stamps that stand for several rows."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification import cleaning, clock_times
from auvsim.identification.columns import UNITS, Meaning
from auvsim.identification.table_text import Column
from estimators.core.types import Array

LONGEST = 5.0  # between two rows whose unit is only assumed [s]
YEARS = 1e11  # seconds since 1970 lie below [s]


def seconds(columns: Mapping[str, Column], meaning: Meaning, path: Path) -> tuple[Array, list[str]]:
    """Times of the rows (n,) [s], and notes on how they were understood.

    Raises:
        InputError: They are no times, or their unit is not the one that was given or taken.
    """
    column, notes = columns[meaning.column], []
    where = f"{path}: column '{meaning.column}' (time)"
    if column.texts is not None and np.isfinite(column.values).sum() < 0.5 * len(column.values):
        example = next((str(text) for text in column.texts if str(text)), "")
        raise InputError(f"{where} holds '{example}'; times are understood as {clock_times.FORMS}")
    factor = meaning.factor
    if column.unit is None and not meaning.declared:
        unit = cleaning.epoch_unit(column.values)
        if unit is not None:
            factor = UNITS["time"][unit]
            notes.append(f"{path.name}: {meaning.column} counts since 1970 in {unit}, by its size")
    times, together = cleaning.spread(column.values * factor)
    if together > 1:
        text = f"each stamp of '{meaning.column}' stands for about {together} rows: spread evenly to the next"
        notes.append(f"{path.name}: {text}")
    if np.nanmedian(np.abs(times)) > YEARS:
        raise InputError(f"{where} is beyond the year 5000 as {factor:g} s each: name its unit, such as `time [ms]`")
    steps = np.abs(np.diff(times[np.isfinite(times)]))
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual >= LONGEST and not meaning.declared:
        raise InputError(
            f"{where}: rows lie {usual:g} apart: seconds, or milliseconds? Give the unit, such as `time [ms]`"
        )
    return times, notes
