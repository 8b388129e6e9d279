"""What a study leaves: tables as CSV and figures as PNG, each written whole or not at all."""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvsim.analysis.style import DPI, legend
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.reproduce.verdict import Verdict


def write_files(
    folder: Path, tables: Mapping[str, Iterable[Sequence[Any]]], figures: Mapping[str, Figure]
) -> list[Path]:
    """Writes tables as CSV and figures as PNG, by their names.

    Raises:
        InputError: If one of them cannot be written.
    """
    path = folder
    try:
        for name, rows in tables.items():
            path = folder / name
            with whole(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file, lineterminator="\n").writerows([_text(value) for value in row] for row in rows)
        for name, figure in figures.items():
            path = folder / name
            with whole(path) as partial:
                figure.savefig(partial, dpi=DPI, format="png")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error
    return [folder / name for name in (*tables, *figures)]


def verdict_rows(judged: Iterable[Verdict]) -> Iterable[Sequence[Any]]:
    """Heading and lines of acceptance.csv: one for each thing to reach."""
    yield "row", "quantity", "measured", "low", "high", "met", "reason"
    for v in judged:
        yield v.row, v.quantity, v.measured, v.low, v.high, "yes" if v.met else "no", v.reason


def finish(figure: Figure, axes: Any, title: str) -> None:
    """Title, and one legend for all axes."""
    entries: dict[str, Any] = {}
    for each in np.atleast_1d(axes):
        handles, labels = each.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    legend(figure, entries)
    figure.suptitle(title, fontsize=13)


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ("" if math.isnan(value) else str(value))
    return str(value)
