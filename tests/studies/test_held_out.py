"""Identification of the MuJoCo vehicle judged on other manoeuvres: a short form always, several seeds as the study."""

import io

import pytest
from rich.console import Console

from auvsim.studies.held_out import run_one, run_study, table


def test_one_seed() -> None:
    """From 200 s by segments alone: a circle is off by less than 2 % after 120 s, and by less than by its start."""
    found = run_one(1, {"multisine": 120.0, "zigzag": 80.0}, {"circle": 250.0}, ("segments",))
    assert found.converged
    assert found.shares["circle"] < 0.02  # what a fit must reach
    assert found.shares["circle"] < 0.5 * found.start_shares["circle"]
    output = io.StringIO()
    Console(width=120, file=output).print(table([found]))
    assert output.getvalue().count(f"{100.0 * found.shares['circle']:.2f} %") >= 3  # the seed, the median, the largest


@pytest.mark.slow
def test_whole_study() -> None:
    """From 300 s every seed's circle and spiral are off by less than 2 %, in the median by less than 0.5 %."""
    outcomes = run_study(range(30, 34))
    shares = [share for one in outcomes for share in one.shares.values()]
    assert len(shares) == 8
    assert max(shares) < 0.02
    assert sorted(shares)[4] < 0.005
    assert all(one.converged for one in outcomes)
