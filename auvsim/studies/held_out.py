"""Identification from 300 s of manoeuvres of the MuJoCo vehicle, judged by predicting manoeuvres of other kinds."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.identification.pipeline import STEPS, identify
from auvsim.identification.readers import read
from auvsim.studies.trials import record_manoeuvre

FITTED = {"multisine": 150.0, "zigzag": 150.0}  # duration of each, including the approach [s]
HELD_OUT = {"circle": 300.0, "spiral": None}  # None: as long as it takes
FIRST_SEED = 50  # none from there on was used while the fits were built


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    seeds: int = 10
    """Number of seeds."""
    first: int = FIRST_SEED
    """The first seed."""
    jobs: int | None = None
    """Processes; by default one for each core."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """Result of the identification of one seed."""

    seed: int
    shares: dict[str, float]  # position error after 120 s relative to distance run, rms over starts, by manoeuvre
    start_shares: dict[str, float]  # the same of the model that the fit started from
    converged: bool


def run_one(seed: int, fitted: dict[str, float], held_out: dict[str, float | None], steps: Sequence[str]) -> Outcome:
    """Runs the manoeuvres of one seed, identifies the model and predicts those held out.

    Args:
        seed: Seed of the current, of all noises and constant errors.
        fitted, held_out: Kinds of manoeuvres and their durations [s].
        steps: Steps of the identification.
    """
    with tempfile.TemporaryDirectory() as folder:
        paths = {kind: _record(kind, time, seed, Path(folder)) for kind, time in {**fitted, **held_out}.items()}
        found = identify(read([paths[kind] for kind in fitted]), read([paths[kind] for kind in held_out]), steps=steps)
    return Outcome(
        seed=seed,
        shares={judged.record.kind: judged.share for judged in found.judged},
        start_shares={judged.record.kind: judged.start_share for judged in found.judged},
        converged=found.fit.converged,
    )


def _record(kind: str, duration: float | None, seed: int, folder: Path) -> Path:
    pinned = {} if duration is None else {"manoeuvre": {"kind": kind, "duration": duration}}
    path = folder / f"{kind}.nc"
    record_manoeuvre(kind, seed, path, pinned)
    return path


def run_study(
    seeds: Sequence[int],
    fitted: dict[str, float] | None = None,
    held_out: dict[str, float | None] | None = None,
    steps: Sequence[str] = STEPS,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Returns the outcomes of seeds in their order, see `run_one`; `progress` is called with seeds done and total."""
    arguments = fitted or FITTED, held_out or HELD_OUT, steps
    tasks = [Task(key=(seed,), work=partial(run_one, seed, *arguments)) for seed in seeds]
    done = run_tasks(tasks, jobs, progress)
    return [done[seed,] for seed in seeds]


def table(outcomes: Sequence[Outcome]) -> Table:
    """Makes a table with one row for each seed, then the median and the largest."""
    kinds = list(outcomes[0].shares)
    result = Table(title="Position error after 120 s open loop, relative to the distance run")
    for heading in ("seed", *kinds, *(f"{kind}, its start" for kind in kinds), "converged"):
        result.add_column(heading, justify="right")
    for one in outcomes:
        shares = [*one.shares.values(), *one.start_shares.values()]
        result.add_row(str(one.seed), *map(_percent, shares), "yes" if one.converged else "no")
    result.add_section()
    columns = np.array([[*one.shares.values(), *one.start_shares.values()] for one in outcomes]).T.tolist()
    result.add_row("median", *(_percent(float(np.median(column))) for column in columns), "")
    result.add_row("largest", *(_percent(max(column)) for column in columns), "")
    return result


def _percent(share: float) -> str:
    return f"{100.0 * share:.2f} %" if math.isfinite(share) else "-"


def report(options: Options, progress: Progress | None = None) -> list[RenderableType]:
    """Runs the study and returns its table."""
    seeds = range(options.first, options.first + options.seeds)
    return [table(run_study(seeds, jobs=options.jobs, progress=progress))]
