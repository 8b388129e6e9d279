"""The same docking trials with one estimator after another, in steady and in turning currents, on MuJoCo truth."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, Literal

from rich.console import RenderableType
from rich.table import Table

from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.navigation.registry import ESTIMATORS as FACTORIES
from auvsim.studies.trials import LATER, Summary, docking_trial, share

_HALF = {"speed": 0.5, "direction_deg": {"uniform": [-180.0, 180.0]}}
_TURN = {"kind": "approach_turn", **_HALF}
CELLS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "steady": {"current": {"kind": "uniform", **_HALF}},
        "turning": {"current": _TURN},
        "turning, 2 s fixes": {
            "current": _TURN,
            "sensors": {"usbl": {"near_range": 60.0, "near_interval": 2.0}},
        },
    }
)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    trials: int = 100
    """Trials with each estimator in each current."""
    seed: int = 9
    """Seed of every random number."""
    cells: tuple[Literal["steady", "turning", "turning, 2 s fixes"], ...] = ("steady", "turning", "turning, 2 s fixes")
    """Currents."""
    estimators: tuple[str, ...] = tuple(FACTORIES)
    """Estimators; by default all that have a name."""
    jobs: int | None = None
    """Processes; by default one for each core."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Score:
    """Results of one estimator over the trials of a cell."""

    trials: int
    first: int  # docked on the first attempt
    within: int  # docked within LATER attempts
    miss_rms: float  # of those that docked, at the mouth [m]
    position_rms: float  # over all estimates outside the docked phase [m]
    nees_per_dof: float  # of the horizontal position over the same estimates; NaN without a covariance


def run_one(cell: str, estimator: str, seed: int, trial: int) -> Summary:
    """Runs one trial of a cell: the same truth, start and noises for each estimator.

    Args:
        cell: One of CELLS.
        estimator: Estimator, as `estimator.factory` of a scenario.
        seed: Seed of all random streams.
        trial: Number of the trial under that seed.
    """
    return docking_trial(seed, trial, CELLS[cell], {"estimator": {"factory": estimator}})


def score(summaries: Sequence[Summary]) -> Score:
    """Scores the trials of one cell and estimator, weighting all estimates equally."""
    docked = [s for s in summaries if s.docked]
    qualities = [s.estimate["all"] for s in summaries]
    positions = [(q.samples, q.position_rms**2) for q in qualities if q.position_rms is not None]
    nees = [(q.samples, q.nees_per_dof) for q in qualities if q.nees_per_dof is not None]
    return Score(
        trials=len(summaries),
        first=sum(s.attempts == 1 for s in docked),
        within=sum(s.attempts <= LATER for s in docked),
        miss_rms=math.sqrt(_mean([(1, s.miss_distance**2) for s in docked if s.miss_distance is not None])),
        position_rms=math.sqrt(_mean(positions)),
        nees_per_dof=_mean(nees),
    )


def run_study(
    trials: int,
    seed: int,
    cells: Sequence[str] = tuple(CELLS),
    estimators: Sequence[str] = tuple(FACTORIES),
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> dict[tuple[str, str], tuple[Summary, ...]]:
    """Runs trials 0 .. trials-1 of a seed and returns their summaries by cell and estimator.

    Args:
        trials: Number of trials in each cell with each estimator.
        seed: Seed of all of them.
        cells: Some of CELLS.
        estimators: Names of estimators.
        jobs: Number of processes; one per core if None.
        progress: Called with the number of trials done and their total.
    """
    keys = [(cell, name) for cell in cells for name in estimators]
    tasks = [Task(key=(*key, n), work=partial(run_one, *key, seed, n)) for key in keys for n in range(trials)]
    done = run_tasks(tasks, jobs, progress)
    return {key: tuple(done[*key, n] for n in range(trials)) for key in keys}


def table(study: Mapping[tuple[str, str], Sequence[Summary]], seed: int) -> Table:
    """Makes a table with one row for each cell and estimator."""
    count = max(map(len, study.values()), default=0)
    result = Table(title=f"{count} docking trials in 0.5 m/s, seed {seed}, the same for each estimator")
    for heading in ("current", "estimator"):
        result.add_column(heading)
    for heading in ("first attempt [%]", f"within {LATER} [%]", "miss rms [m]", "position rms [m]", "NEES"):
        result.add_column(heading, justify="right")
    previous = None
    for (cell, name), summaries in study.items():
        s = score(summaries)
        if previous not in (None, cell):
            result.add_section()
        result.add_row(
            "" if cell == previous else cell,
            name,
            share(s.first, s.trials, 0),
            share(s.within, s.trials, 0),
            f"{s.miss_rms:.2f}",
            f"{s.position_rms:.2f}",
            f"{s.nees_per_dof:.2f}",
        )
        previous = cell
    return result


def report(options: Options, progress: Progress | None = None) -> list[RenderableType]:
    """Runs the study; returns its table and a line for each trial that did not dock."""
    study = run_study(
        options.trials, options.seed, options.cells, options.estimators, jobs=options.jobs, progress=progress
    )
    failures = [
        f"{cell}, {name}, trial {number}: {s.failure_text}"
        for (cell, name), summaries in study.items()
        for number, s in enumerate(summaries)
        if not s.docked
    ]
    return [table(study, options.seed), *failures]


def _mean(pairs: Sequence[tuple[float, float]]) -> float:
    """Weighted mean of (weight, value) pairs; NaN if there are none."""
    total = sum(weight for weight, _ in pairs)
    return sum(weight * value for weight, value in pairs) / total if total else math.nan
