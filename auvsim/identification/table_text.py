"""Tables in text files as people and instruments write them: separators, decimal commas, a row of units, clocks."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.errors import InputError
from auvsim.identification import clock_times
from auvsim.identification.columns import is_unit, split_header
from estimators.core.types import Array

MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "--"}
_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")  # 12,5
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+,\d+")  # 1.012,5
_TOKEN = re.compile(r"\S+(?:\s+[\[(][^\])]*[\])])?")  # a name, and the unit in brackets after it


@dataclass(frozen=True, kw_only=True, slots=True)
class Column:
    """A column as it stands in a file."""

    values: Array  # (n,) NaN where there is no number
    texts: NDArray[Any] | None = None  # (n,) the same as texts, where they are no numbers
    unit: str | None = None  # that the file gives apart from the name
    time: str | None = None  # the column that stamps it, where the file says so
    deviation: float | None = None  # of a sample, in the column's unit, where the file says so


def read(path: Path) -> tuple[dict[str, Column], list[str]]:
    """The columns of a text file, and notes on how it was understood.

    Columns stand apart by comma, semicolon, tab or blanks; `#` begins a comment, also one that names the columns. With
    another separator than the comma numbers may have decimal commas. A row under the names may hold units.

    Raises:
        InputError: It is no table; the text says what would be one.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: neither NetCDF nor a CSV text of UTF-8: {' '.join(str(error).split())}") from None
    lines = _lines(text)
    if len(lines) < 2:
        raise InputError(f"{path}: holds no rows; a CSV file has a line of column names and a row for each time")
    names, rows = _split(lines)
    if all(_is_number(name) for name in names):
        raise InputError(f"{path}: the first line holds numbers; give each column a name, such as `heading [deg]`")
    twice = sorted({name for name in names if names.count(name) > 1 and name})
    if twice:
        raise InputError(f"{path}: column '{twice[0]}' is there twice; give each its own name")
    _even(path, names, rows)
    notes: list[str] = []
    units = _units(names, rows[0])
    if units:
        notes.append(f"{path.name}: the second line is read as units: {', '.join(unit for unit in units if unit)}")
        rows = rows[1:]
    columns = [[cell.strip() for cell in cells] for cells in zip(*rows, strict=True)] or [[] for _ in names]
    if _decimal_commas(path, names, columns):
        notes.append(f"{path.name}: decimal commas")
        columns = [[_with_point(cell) for cell in cells] for cells in columns]
    found = {
        name: _column(cells, units[k] if units else None)
        for k, (name, cells) in enumerate(zip(names, columns, strict=True))
        if name
    }
    return found, notes


def _lines(text: str) -> list[str]:
    """The lines of the table, the names first; those may stand in the last comment."""
    lines = [line.strip("\r\n") for line in text.splitlines() if line.strip()]
    kept = [line for line in lines if not line.lstrip().startswith("#")]
    if kept and lines[0] is not kept[0] and all(_is_number(cell) for cell in re.split(r"[,;\s]+", kept[0].strip())):
        last = lines[lines.index(kept[0]) - 1].lstrip().lstrip("#").strip()
        if len(_split([last])[0]) == len(_split([kept[0]])[0]):
            return [last, *kept]
    return kept


def _split(lines: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Names and rows of cells."""
    delimiter = max(";\t,", key=lines[0].count)
    if lines[0].count(delimiter):
        header, *rows = csv.reader(lines, delimiter=delimiter)
        return [name.strip() for name in header], rows
    return _TOKEN.findall(lines[0]), [line.split() for line in lines[1:]]


def _even(path: Path, names: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    for number, row in enumerate(rows, start=2):
        if len(row) == len(names):
            continue
        said = f"{path}: row {number} has {len(row)} values, the first line names {len(names)} columns"
        if len(row) > 1.4 * len(names) and all(_is_number(cell) for cell in row):
            said += ": decimal commas? then separate the columns by semicolons"
        raise InputError(said)


def _units(names: Sequence[str], row: Sequence[str]) -> list[str | None]:
    """The units that a row under the names holds; empty where it holds none."""
    cells = [cell.strip().strip("[]()") for cell in row]
    named = [cell for cell in cells if cell.lower() not in MISSING]
    known = [cell for cell in named if is_unit(cell)]
    if not named or len(known) < 0.6 * len(named) or any(_is_number(cell.replace(",", ".")) for cell in named):
        return []
    # What the name itself says goes before.
    return [
        cell if is_unit(cell) and split_header(n)[1] is None else None for n, cell in zip(names, cells, strict=True)
    ]


def _decimal_commas(path: Path, names: Sequence[str], columns: Sequence[Sequence[str]]) -> bool:
    """Whether the numbers have decimal commas.

    Raises:
        InputError: Some have a comma, some a point.
    """
    found, pointed = {}, {}
    for name, cells in zip(names, columns, strict=True):
        for cell in cells:
            if _COMMA.fullmatch(cell) or _THOUSANDS.fullmatch(cell):
                found.setdefault(name, cell)
            elif "." in cell and _is_number(cell):
                pointed.setdefault(name, cell)
    if not found:
        return False
    if pointed:
        (a, comma), (b, point) = next(iter(found.items())), next(iter(pointed.items()))
        raise InputError(
            f"{path}: column '{a}' has a decimal comma ({comma}), column '{b}' a decimal point ({point}); "
            "write all numbers with one of them"
        )
    return True


def _with_point(cell: str) -> str:
    if _THOUSANDS.fullmatch(cell):
        cell = cell.replace(".", "")
    return cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _column(cells: Sequence[str], unit: str | None) -> Column:
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
        return Column(values=np.where(np.isfinite(values), values, np.nan), unit=unit)
    clocks = clock_times.seconds(cells)
    if clocks is not None:
        return Column(values=clocks, unit="s")
    return Column(values=values, texts=np.array(cells, dtype=object), unit=unit)
