"""Docking trials outside the default plan: one condition after another, the same trials, starts and noises in each."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

from rich.console import RenderableType
from rich.table import Table

from auvsim.base.errors import unknown_name
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.studies.trials import LATER, Summary, docking_trial, share

_EAST = {"kind": "uniform", "direction_deg": {"uniform": [-180.0, 180.0]}}
_POOR = {"compass": {"heading_bias_deg": 3.0}, "usbl": {"dock_heading_bias_deg": 3.0}}
_GUSTS = {"kind": "gust", "correlation_time": 30.0}
_STEADY = {**_EAST, "speed": {"uniform": [0.0, 0.3]}}

# Conditions by name: what differs from the default plan.
CONDITIONS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "default plan": {},
        "compasses of 3 deg": {"sensors": _POOR},
        "the same, told": {"sensors": _POOR, "estimator": {"compass_bias_deg": 3.0, "dock_heading_deg": 3.0}},
        "60 % of fixes lost": {"acoustics": {"dropout_probability": 0.6}},
        "a fix every 20 s": {"sensors": {"usbl": {"interval": 20.0}}},
        "delay of 5 s": {"acoustics": {"delay": 5.0}},
        "current of 0.8 m/s": {"current": {**_EAST, "speed": 0.8}},
        "current of 1.0 m/s": {"current": {**_EAST, "speed": 1.0}},
        "0.5 m/s turning": {"current": {**_EAST, "kind": "approach_turn", "speed": 0.5}},
        "gusts of 0.1 m/s": {"current": {"kind": "sum", "terms": [_STEADY, {**_GUSTS, "intensity": 0.1}]}},
        "gusts of 0.2 m/s": {"current": {"kind": "sum", "terms": [_STEADY, {**_GUSTS, "intensity": 0.2}]}},
        "dock at 100 m": {"dock": {"depth": 100.0}, "world": {"sea_floor": 120.0}},
        "depth gauge of 0.5 m": {"sensors": {"depth": {"bias": 0.5}}},
        "burst of 15 s": {"sensors": {"usbl": {"burst_range": {"uniform": [15.0, 80.0]}}}},
        "20 % outliers": {"sensors": {"usbl": {"outlier_probability": 0.2}}},
        "20 % small outliers": {
            "sensors": {"usbl": {"outlier_probability": 0.2, "outlier_minimum": 1.0, "outlier_maximum": 3.0}}
        },
        "bad day": {
            "current": {"kind": "sum", "terms": [{**_EAST, "speed": 0.4}, {**_GUSTS, "intensity": 0.1}]},
            "sensors": {
                "compass": {"heading_bias_deg": 2.0},
                "usbl": {"outlier_probability": 0.1, "interval": 8.0},
            },
            "acoustics": {"dropout_probability": 0.3, "delay": 3.0},
        },
    }
)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    trials: int = 40
    """Trials in each condition."""
    seed: int = 18
    """Seed of every random number."""
    conditions: tuple[str, ...] = tuple(CONDITIONS)
    """Conditions, by name; by default all."""
    estimator: str | None = None
    """Kind of the estimator; by default the scenario's."""
    jobs: int | None = None
    """Processes; by default one for each core."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Score:
    """Results of the trials of a condition."""

    trials: int
    first: int  # docked on the first attempt
    within: int  # docked within LATER attempts
    approaches: float  # begun, mean over all trials
    miss_rms: float  # of those that docked, at the mouth [m]
    cross_rms: float  # its part across the axis [m]
    nees: float  # of the horizontal position per degree of freedom, mean over all estimates
    nees_relative: float  # the same in the dock's own axes
    reasons: Counter[str]  # of the trials that did not dock


def run_one(condition: str, estimator: str | None, seed: int, trial: int) -> Summary:
    """Runs one trial of a condition.

    Args:
        condition: One of CONDITIONS.
        estimator: Kind of the estimator; None: the scenario's.
        seed: Seed of all random streams.
        trial: Number of the trial under that seed.
    """
    kind = {"estimator": {"kind": estimator}} if estimator else {}
    return docking_trial(seed, trial, kind, CONDITIONS[condition])


def score(summaries: Sequence[Summary]) -> Score:
    """Scores the trials of one condition, weighting all estimates equally."""
    docked = [s for s in summaries if s.docked]
    qualities = [s.estimate["all"] for s in summaries if s.estimate["all"].samples]

    def mean(name: str) -> float:
        pairs = [(q.samples, getattr(q, name, None)) for q in qualities]
        known = [(n, value) for n, value in pairs if value is not None]
        return sum(n * v for n, v in known) / sum(n for n, _ in known) if known else math.nan

    return Score(
        trials=len(summaries),
        first=sum(s.attempts == 1 for s in docked),
        within=sum(s.attempts <= LATER for s in docked),
        approaches=sum(s.approaches for s in summaries) / len(summaries),
        miss_rms=_rms([s.miss_distance for s in docked]),
        cross_rms=_rms([s.cross_track for s in docked]),
        nees=mean("nees_per_dof"),
        nees_relative=mean("nees_relative"),
        reasons=Counter((s.failure_text or s.failure_reason or "") for s in summaries if not s.docked),
    )


def run_study(
    trials: int,
    seed: int,
    conditions: Sequence[str] = tuple(CONDITIONS),
    estimator: str | None = None,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> dict[str, tuple[Summary, ...]]:
    """Runs trials 0 .. trials-1 of a seed in each condition and returns their summaries.

    Raises:
        InputError: There is no such condition.
    """
    for name in conditions:
        if name not in CONDITIONS:
            raise unknown_name("condition", name, list(CONDITIONS))
    tasks = [
        Task(key=(name, n), work=partial(run_one, name, estimator, seed, n))
        for name in conditions
        for n in range(trials)
    ]
    done = run_tasks(tasks, jobs, progress)
    return {name: tuple(done[name, n] for n in range(trials)) for name in conditions}


def table(study: Mapping[str, Sequence[Summary]], seed: int) -> Table:
    """Makes a table with one row for each condition."""
    count = max(map(len, study.values()), default=0)
    result = Table("condition", title=f"{count} docking trials of seed {seed} in each condition")
    headings = (
        "first attempt [%]",
        f"within {LATER} [%]",
        "approaches",
        "miss rms [m]",
        "across [m]",
        "NEES",
        "in the dock's axes",
    )
    for heading in headings:
        result.add_column(heading, justify="right")
    for name, summaries in study.items():
        s = score(summaries)
        numbers = (
            f"{s.approaches:.2f}",
            f"{s.miss_rms:.3f}",
            f"{s.cross_rms:.3f}",
            f"{s.nees:.2f}",
            f"{s.nees_relative:.2f}",
        )
        result.add_row(name, share(s.first, s.trials), share(s.within, s.trials), *numbers)
    return result


def report(options: Options, progress: Progress | None = None) -> list[RenderableType]:
    """Runs the study; returns its table, and a line for each reason for which trials did not dock."""
    study = run_study(
        options.trials, options.seed, options.conditions, options.estimator, jobs=options.jobs, progress=progress
    )
    failures = [
        f"{name}, {count} of {len(summaries)}: {text}"
        for name, summaries in study.items()
        for text, count in score(summaries).reasons.most_common()
    ]
    return [table(study, options.seed), *failures]


def _rms(values: Sequence[float | None]) -> float:
    known = [value**2 for value in values if value is not None]
    return math.sqrt(sum(known) / len(known)) if known else math.nan
