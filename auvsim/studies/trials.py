"""Docking trials and manoeuvres that studies run."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auvsim.analysis.estimates import EstimateQuality
from auvsim.analysis.statistics import wilson
from auvsim.analysis.summary import summarise
from auvsim.data import log
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run

LATER = 3  # attempts that the default guidance has


@dataclass(frozen=True, kw_only=True, slots=True)
class Summary:
    """What studies read of the summary of a docking trial, see `analysis.summary`."""

    docked: bool
    failure_reason: str | None
    failure_text: str | None
    attempts: int
    approaches: int
    time: float  # [s]
    miss_distance: float | None  # [m]
    cross_track: float | None  # its part across the axis [m]
    vertical: float | None  # its part downward [m]
    heading_error_deg: float | None
    contact_impulse: float  # [N s]
    peak_contact_force: float  # [N]
    contacts: int  # separate ones
    shaft_energy: float | None  # [J]
    way: float  # through the water [m]
    estimate: dict[str, EstimateQuality]  # over all phases ("all") and by phase
    real_time_factor: float | None

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> "Summary":
        """The summary of plain values."""
        kept = {field.name: values[field.name] for field in dataclasses.fields(cls)}
        estimate = {phase: EstimateQuality(**quality) for phase, quality in values["estimate"].items()}
        return cls(**{**kept, "estimate": estimate})


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
    found = run(scenario.parse(sampling.draw(plan, seed, trial)), seed=seed, trial=trial)
    return Summary.of(summarise(found.vehicle()))


def share(successes: int, trials: int, decimals: int = 1) -> str:
    """A rate in percent with its 95 % Wilson interval."""
    low, high = wilson(successes, trials)
    rate = 100.0 * successes / trials if trials else math.nan
    return f"{rate:.{decimals}f} ({100.0 * low:.0f}-{100.0 * high:.0f})"


def record_manoeuvre(kind: str, seed: int, path: Path, pinned: Mapping[str, Any]) -> None:
    """Runs one manoeuvre and writes its log.

    Args:
        kind: Kind of the manoeuvre.
        seed: Seed of all random streams.
        path: Path of the log.
        pinned: Nested values on top of the manoeuvre's plan.
    """
    plan = sampling.merge(sampling.manoeuvre_plan(kind), pinned)
    log.write(run(scenario.parse(sampling.draw(plan, seed, 0)), seed=seed), path)
