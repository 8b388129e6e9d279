"""Errors of a survey's path: the rotation about the dive point by a closed form, NEES, and what stays."""

import io
import math

import numpy as np
import pytest
from rich.console import Console

from auvsim.studies.survey import CLOSED, FIXED, OPEN, RECKONING, WHOLE, Errors, Options, Trial, judged, table, turned

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
    least = float(((turned(p, q) - q) ** 2).sum())
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
        shown = table(both, Options(trials=2, second_fix=second))
        console = Console(width=300, record=True, file=io.StringIO())
        console.print(shown)
        row = next(line for line in console.export_text().splitlines() if "2 of 2" in line)
        cells = [cell.strip() for cell in row.split("\u2502")[2:-1]]
        by_name = list(zip([str(column.header) for column in shown.columns][1:], cells, strict=True))
        assert by_name[0] == ("turned: DR", "15.00")  # the root of (9 + 441) / 2
        assert ("S / DR", "3.00") in by_name
        assert ("path / DR", "4.00") in by_name
        assert [value for name, value in by_name if name == "S fix"] == (["75.00", "125.00"] if second else [])
        assert ("NEES: DR", "0.10") in by_name
