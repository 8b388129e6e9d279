"""CSV and NetCDF files of a user's vehicle as named columns of numbers and texts."""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import netcdf_file

from auvsim.base.errors import InputError
from estimators.core.types import Array

MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "--"}


@dataclass(frozen=True, kw_only=True, slots=True)
class Column:
    """A column as it stands in a file."""

    values: Array  # (n,) NaN where there is no number
    texts: NDArray[Any] | None = None  # (n,) the same as texts, where they are no numbers
    unit: str | None = None  # that the file gives apart from the name
    time: str | None = None  # the column that stamps it, where the file says so


def load(path: Path) -> dict[str, Column]:
    """The columns of a CSV file (comma, semicolon or tab; `#` begins a comment) or of a NetCDF file.

    Raises:
        InputError: If it cannot be read as either.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(8)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    if head.startswith(b"\x89HDF"):
        return _from_hdf(path)
    if head.startswith(b"CDF"):
        return _from_classic(path)
    return _from_csv(path)


def _from_csv(path: Path) -> dict[str, Column]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: neither NetCDF nor a CSV text of UTF-8: {' '.join(str(error).split())}") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise InputError(f"{path}: holds no rows; a CSV file has a line of column names and a row for each time")
    delimiter = max(",;\t", key=lines[0].count)
    header, *rows = csv.reader(lines, delimiter=delimiter)
    names = [name.strip() for name in header]
    if all(_is_number(name) for name in names):
        raise InputError(f"{path}: the first line holds numbers; give each column a name, such as `heading [deg]`")
    twice = sorted({name for name in names if names.count(name) > 1 and name})
    if twice:
        raise InputError(f"{path}: column '{twice[0]}' is there twice; give each its own name")
    for number, row in enumerate(rows, start=2):
        if len(row) != len(names):
            raise InputError(f"{path}: row {number} has {len(row)} values, the first line names {len(names)} columns")
    columns = zip(*rows, strict=True)
    return {name: _column(list(cells)) for name, cells in zip(names, columns, strict=True) if name}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _column(cells: list[str]) -> Column:
    cells = [cell.strip() for cell in cells]
    values = np.full(len(cells), np.nan)
    texts = False
    for k, cell in enumerate(cells):
        if cell.lower() in MISSING:
            continue
        try:
            values[k] = float(cell)
        except ValueError:
            texts = True
    if not texts:
        return Column(values=np.where(np.isfinite(values), values, np.nan))
    clocks = list(_clock_times(cells))
    if sum(clock is not None for clock in clocks) > 0.5 * len(cells):
        return Column(values=np.array([np.nan if clock is None else clock for clock in clocks]), unit="s")
    return Column(values=values, texts=np.array(cells, dtype=object))


def _clock_times(cells: list[str]) -> Iterator[float | None]:
    """Seconds of ISO 8601 texts, UTC where they name no zone."""
    for cell in cells:
        if not re.match(r"\d{4}-\d\d-\d\d[T ]", cell):
            yield None
            continue
        try:
            moment = datetime.fromisoformat(cell)
        except ValueError:
            yield None
            continue
        yield (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _from_hdf(path: Path) -> dict[str, Column]:
    found: dict[str, Column] = {}

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or item.ndim != 1 or item.dtype.kind not in "fiubOS":
            return
        if "but not a netCDF" in str(item.attrs.get("NAME", "")):
            return  # a dimension without values
        scales = [str(scale.name).strip("/") for scale in item.dims[0].values()]
        own = scales[0] if scales and scales[0] != name else None
        text = item.dtype.kind in "OS"
        raw = np.asarray((item.asstr() if text else item)[...])
        found[name] = Column(
            values=np.full(len(raw), np.nan) if text else _filled(raw, item.attrs.get("_FillValue")),
            texts=raw if text else None,
            unit=_text(item.attrs.get("units")),
            time=own,
        )

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise InputError(f"{path}: not a whole NetCDF-4 file: {str(error).splitlines()[0]}") from None
    return found


def _from_classic(path: Path) -> dict[str, Column]:
    try:
        with netcdf_file(path, "r", mmap=False) as file:
            return {
                name: Column(
                    values=_filled(np.array(variable[:]), getattr(variable, "_FillValue", None)),
                    unit=_text(getattr(variable, "units", None)),
                    time=variable.dimensions[0] if variable.dimensions[0] != name else None,
                )
                for name, variable in file.variables.items()
                if len(variable.dimensions) == 1 and np.array(variable[:]).dtype.kind in "fiu"
            }
    except (OSError, ValueError, TypeError, AssertionError, IndexError) as error:
        raise InputError(f"{path}: not a whole NetCDF file: {str(error) or type(error).__name__}") from None


def _filled(values: NDArray[Any], fill: Any) -> Array:
    numbers = np.asarray(values, dtype=float)
    missing = ~np.isfinite(numbers)
    if fill is not None:
        missing |= numbers == float(np.ravel(fill)[0])
    return np.where(missing, np.nan, numbers)


def _text(value: Any) -> str | None:
    if value is None:
        return None
    return value.decode() if isinstance(value, bytes) else str(value)
