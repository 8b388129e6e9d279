"""Campaigns of trials that take no time, where how they run is to be tested."""

from collections.abc import Callable
from pathlib import Path

import pytest
from campaign_jobs import nothing, trial

from auvsim.campaign import execution, plan


@pytest.fixture
def light(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trials are those of `campaign_jobs`, and need no preparation."""
    monkeypatch.setattr(execution.trials, "run", trial)
    monkeypatch.setattr(execution.trials, "prepare", nothing)


@pytest.fixture
def planned(tmp_path: Path) -> Callable[..., plan.Plan]:
    """Makes a plan of light trials: which of them end how, where marks are left, and other keys of the plan."""

    def make(ending: str = "none", marks: Path | None = None, **keys: object) -> plan.Plan:
        name, _, numbers = ending.partition(":")
        trials = [int(number) for number in numbers.split(",") if number]
        settings = {"ending": name, "trials": trials, "marks": str(marks or tmp_path / "nowhere")}
        pins = {"estimator": {"kind": "light:estimator", "settings": settings}}
        values = {"seed": 4, "trials": 12, "timeout": 30.0, "variants": {"a": pins, "b": {**pins, "duration": 300.0}}}
        return plan.parse(values | keys)

    return make
