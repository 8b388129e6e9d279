"""The same docking trials with one estimator after another, in steady and in turning currents, on MuJoCo truth.

From the checkout: `python -m auvsim.studies.comparison --trials 100 --seed 9`.
"""

import argparse
import math
import multiprocessing
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from auvsim.missions.docking.metrics import Summary, summarise, wilson
from auvsim.navigation.navigator import FACTORIES
from auvsim.simulation import sampling, scenario
from auvsim.simulation.trial import run_trial

LATER = 3  # attempts that the default guidance has

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


@dataclass(frozen=True, kw_only=True, slots=True)
class Score:
    """What one estimator came to over the trials of a cell."""

    trials: int
    first: int  # docked on the first attempt
    within: int  # docked within LATER attempts
    miss_rms: float  # of those that docked, at the mouth [m]
    position_rms: float  # over all estimates outside the docked phase [m]
    nees_per_dof: float  # of the horizontal position over the same estimates; NaN without a covariance


def run_one(cell: str, estimator: str, seed: int, trial: int) -> Summary:
    """One trial of a cell: the same truth, start and noises for each estimator.

    Args:
        cell: Of CELLS.
        estimator: As `estimator.factory` of a scenario.
        seed: Of all random streams.
        trial: Number of the trial under that seed.
    """
    plan = sampling.merge(sampling.default_plan(), CELLS[cell])
    plan = sampling.merge(plan, {"estimator": {"factory": estimator}})
    return summarise(run_trial(scenario.parse(sampling.draw(plan, seed, trial)), seed=seed, trial=trial))


def score(summaries: Sequence[Summary]) -> Score:
    """The score of trials of one cell and estimator; all estimates weigh alike."""
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
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> dict[tuple[str, str], tuple[Summary, ...]]:
    """The summaries of trials 0 .. trials-1 of a seed, by cell and estimator.

    Args:
        trials: How many of each cell and estimator.
        seed: Of all of them.
        cells: Of CELLS.
        estimators: Factories.
        workers: Processes; all cores if None.
        progress: Called with the number of trials done.
    """
    # Spawned, not forked: MuJoCo, OpenGL and BLAS may hold threads and locks of this process.
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = {
            (cell, name): [pool.submit(run_one, cell, name, seed, trial) for trial in range(trials)]
            for cell in cells
            for name in estimators
        }
        for done, future in enumerate(as_completed([f for row in futures.values() for f in row]), start=1):
            future.result()
            if progress:
                progress(done)
        return {key: tuple(future.result() for future in row) for key, row in futures.items()}


def table(study: Mapping[tuple[str, str], Sequence[Summary]], seed: int) -> Table:
    """A row of each cell and estimator."""
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
            _share(s.first, s.trials),
            _share(s.within, s.trials),
            f"{s.miss_rms:.2f}",
            f"{s.position_rms:.2f}",
            f"{s.nees_per_dof:.2f}",
        )
        previous = cell
    return result


def main(arguments: Sequence[str] | None = None) -> None:
    """The command; `arguments` are those of the command line if None."""
    parser = argparse.ArgumentParser(description="The same docking trials with each estimator on all cores.")
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=9)
    parser.add_argument("--cells", nargs="+", choices=CELLS, default=list(CELLS))
    parser.add_argument("--estimators", nargs="+", default=list(FACTORIES), help="all that have a name if not given")
    parser.add_argument("--workers", type=int, help="processes; all cores if not given")
    options = parser.parse_args(arguments)
    total = options.trials * len(options.cells) * len(options.estimators)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("trials", total=total)
        study = run_study(
            options.trials,
            options.seed,
            options.cells,
            options.estimators,
            workers=options.workers,
            progress=lambda done: bar.update(task, completed=done),
        )
    console = Console(width=None if Console().is_terminal else 120)
    console.print(table(study, options.seed))
    for (cell, name), summaries in study.items():
        for number, s in enumerate(summaries):
            if not s.docked:
                console.print(f"{cell}, {name}, trial {number}: {s.failure_text}", highlight=False)


def _share(successes: int, trials: int) -> str:
    """A rate with its 95 % Wilson interval."""
    low, high = wilson(successes, trials)
    rate = 100.0 * successes / trials if trials else math.nan
    return f"{rate:.0f} ({100.0 * low:.0f}-{100.0 * high:.0f})"


def _mean(pairs: Sequence[tuple[float, float]]) -> float:
    """Weighted mean of (weight, value); NaN of nothing."""
    total = sum(weight for weight, _ in pairs)
    return sum(weight * value for weight, value in pairs) / total if total else math.nan


if __name__ == "__main__":
    main()
