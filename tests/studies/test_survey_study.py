"""Errors of a survey's path: the rotation about the dive point by a closed form, NEES, and what stays."""

import io
import math

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table

from auvsim.studies.survey import (
    CLOSED,
    FIXED,
    OPEN,
    RECKONING,
    WHOLE,
    Errors,
    Options,
    Trial,
    judged,
    raw_table,
    turned_table,
)
from estimators.map_path.poses import rotation_to, turned

AT = np.array((40.0, -7.0))
TRUE = AT + np.array([(0.0, 1.0), (60.0, 2.0), (61.0, 9.0), (3.0, 30.0), (-8.0, 12.0)])


def test_a_turned_and_displaced_path_is_free_of_error_after_the_rotation() -> None:
    """Raw errors are those by hand: chords of the turn, and the displacement of the dive point."""
    angle, believed = 0.05, AT + np.array((1.5, -0.7))
    c, s = math.cos(angle), math.sin(angle)
    path = believed + (TRUE - AT) @ np.array(((c, s), (-s, c)))
    found = judged(path, np.tile(np.diag((4.0, 9.0)), (len(path), 1, 1)), TRUE, believed, AT)
    assert found.turned == pytest.approx(0.0, abs=1e-9)
    off = path - TRUE
    assert found.raw == pytest.approx(math.sqrt(float((off**2).sum() / len(off))))
    assert found.nees == pytest.approx(float((off**2 / (4.0, 9.0)).sum() / (2.0 * len(off))))


def test_the_rotation_is_the_best_one() -> None:
    """No angle of a fine grid brings a distorted path closer, and a distortion is not taken away."""
    p, q = (TRUE - AT) * (1.03, 0.98) + (0.4, -0.2), TRUE - AT
    least = float(((turned(p, rotation_to(p, q)) - q) ** 2).sum())
    others = []
    for angle in np.linspace(-0.2, 0.2, 4001):
        c, s = math.cos(angle), math.sin(angle)
        others.append(float(((p @ np.array(((c, s), (-s, c))) - q) ** 2).sum()))
    assert 0.1 < least <= min(others) + 1e-12
    assert least == pytest.approx(min(others), rel=1e-3)


def test_the_table_sets_each_error_under_its_name() -> None:
    """Rms over missions of each; the two ratios; the path after a second fix only where there was one."""
    names = (RECKONING, OPEN, CLOSED, WHOLE, FIXED)
    both = [
        Trial({name: Errors(5.0 * (k + 1) * f, 3.0 * (k + 1) * f, 0.1 * (k + 1)) for k, name in enumerate(names)},
              0.5, 20, True)
        for f in (1.0, 7.0)
    ]  # fmt: skip
    for second in (False, True):
        options = Options(trials=2, second_fix=second)
        by_name = _last_row(turned_table(both, options))
        assert by_name["dead reckoning"] == "15.00"  # the root of (9 + 441) / 2
        assert (by_name["sonar / d. r."], by_name["path / d. r."]) == ("3.00", "4.00")
        assert (by_name["closures"], by_name["docked"]) == ("20", "2 of 2")
        assert by_name.get("fix") == ("75.00" if second else None)
        by_name = _last_row(raw_table(both, options))
        assert (by_name["dead reckoning"], by_name["floor"], by_name["NEES d. r."]) == ("25.00", "0.50", "0.10")
        assert by_name.get("fix") == ("125.00" if second else None)


def _last_row(shown: Table) -> dict[str, str]:
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(shown)
    row = next(line for line in console.export_text().splitlines() if line.split("\u2502")[1:2] == ["   all "])
    cells = [cell.strip() for cell in row.split("\u2502")[1:-1]]
    return dict(zip([str(column.header) for column in shown.columns], cells, strict=True))
