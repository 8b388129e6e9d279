"""Docking trials and manoeuvres that studies run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from auvsim.data import log
from auvsim.missions.docking.metrics import Summary, summarise
from auvsim.simulation import sampling, scenario
from auvsim.simulation.trial import run_trial


def docking_trial(seed: int, trial: int, *pinned: Mapping[str, Any]) -> Summary:
    """Runs one trial of the default plan and returns its metrics.

    Args:
        seed: Seed of all random streams.
        trial: Number of the trial under that seed.
        pinned: Nested values on top of the default plan, later ones on top of earlier ones.
    """
    plan = sampling.default_plan()
    for values in pinned:
        plan = sampling.merge(plan, values)
    return summarise(run_trial(scenario.parse(sampling.draw(plan, seed, trial)), seed=seed, trial=trial))


def record_manoeuvre(kind: str, seed: int, path: Path, pinned: Mapping[str, Any]) -> None:
    """Runs one manoeuvre and writes its log.

    Args:
        kind: Kind of the manoeuvre.
        seed: Seed of all random streams.
        path: Path of the log.
        pinned: Nested values on top of the manoeuvre's plan.
    """
    plan = sampling.merge(sampling.manoeuvre_plan(kind), pinned)
    log.write(run_trial(scenario.parse(sampling.draw(plan, seed, 0)), seed=seed, trial=0), path)
