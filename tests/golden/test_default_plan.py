"""Trials of the default plan against those of before the rebuilding."""

import math
from pathlib import Path
from typing import Any

import pytest

from . import default_plan

# With OpenBLAS's oldest kernels and Numba's code for a generic processor, no value of the 200 trials moves by more than
# 2e-13, in the units of its column. A hundredfold of that, and more, since a trial may be less well-behaved elsewhere.
TOLERANCE = 1e-9


def unlike(now: list[default_plan.Row], before: list[default_plan.Row]) -> list[tuple[int, str]]:
    """Trial and column of each value that is not what it was, numbers to TOLERANCE."""
    return [
        (b["trial"], name)
        for n, b in zip(now, before, strict=True)
        for name in default_plan.COLUMNS
        if n[name] != pytest.approx(b[name], abs=TOLERANCE, rel=0.0)
    ]


def test_first_trials_are_what_they_were(tmp_path: Path):
    _, rows = default_plan.read()
    assert unlike(default_plan.run(4, tmp_path), rows[:4]) == []


def test_kept_statistics_are_those_of_the_kept_trials():
    kept, rows = default_plan.read()
    assert [row["trial"] for row in rows] == list(range(default_plan.TRIALS))
    for name, values in default_plan.statistics(rows).items():
        assert values == pytest.approx(kept[name], rel=1e-12), name  # sums in another order


def test_statistics_of_three_trials():
    """By hand: one docks at once, one at its second attempt, one never and without a miss."""
    names = ("docked", "attempts", "time", "cross_track", "vertical", "nees_per_dof", "position_rms")
    values: list[tuple] = [(True, 1, 100.0, 0.3, 0.6, 0.5, 1.0), (True, 2, 200.0, -0.4, 0.8, 1.0, 2.0)]
    values.append((False, 3, 600.0, None, None, None, 6.0))
    rows = [dict.fromkeys(default_plan.COLUMNS) | dict(zip(names, row, strict=True)) for row in values]
    found = default_plan.statistics(rows)
    # Wilson's interval of 2 in 3: (2 + z^2/2 -+ z sqrt(2/3 + z^2/4)) / (3 + z^2), z = 1.959964.
    assert found["docked"] == pytest.approx({"count": 2, "trials": 3, "low": 0.207660, "high": 0.938508}, abs=1e-6)
    assert found["docked_first"]["count"] == 1
    assert found["miss_across_rms"] == pytest.approx(math.sqrt(0.125))
    assert found["miss_vertical_rms"] == pytest.approx(math.sqrt(0.5))
    assert found["nees_per_dof"] == pytest.approx({"mean": 0.75, "standard_error": 0.25})
    assert found["position_rms"] == pytest.approx({"mean": 3.0, "standard_error": math.sqrt(7.0 / 3.0)})
    assert found["time"]["mean"] == pytest.approx(300.0)


@pytest.mark.slow
def test_statistics_are_what_they_were(tmp_path: Path):
    """All 200 trials: shares within Wilson's intervals of before, means within two standard errors.

    With the same code even each trial is the same; after a change of numbers only this is asked for.
    """
    kept, rows = default_plan.read()
    now = default_plan.run(default_plan.TRIALS, tmp_path)
    again = default_plan.statistics(now)
    print(f"{sum(n == b for n, b in zip(now, rows, strict=True))} of {len(rows)} trials are equal bit for bit")
    for name in ("docked", "docked_first"):
        assert kept[name]["low"] <= again[name]["count"] / again[name]["trials"] <= kept[name]["high"]
    for name in ("nees_per_dof", "position_rms", "time"):
        assert within_two_errors(kept[name], again[name]["mean"]), name
    # The relative standard error of an rms of 200 normal values is 1/sqrt(400): 5 %.
    for name in ("miss_across_rms", "miss_vertical_rms"):
        assert again[name] == pytest.approx(kept[name], rel=0.1), name


def within_two_errors(kept: dict[str, Any], value: float) -> bool:
    return abs(value - kept["mean"]) <= 2.0 * kept["standard_error"]
