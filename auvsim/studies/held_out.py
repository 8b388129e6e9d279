"""Identification from 300 s of manoeuvres of the MuJoCo vehicle, judged on manoeuvres of other kinds.

From the checkout: `python -m auvsim.studies.held_out --seeds 10 --first 50`.
"""

import argparse
import math
import multiprocessing
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from auvsim.data import log
from auvsim.identification.pipeline import STEPS, identify
from auvsim.identification.readers import read
from auvsim.simulation import sampling, scenario
from auvsim.simulation.trial import run_trial

FITTED = {"multisine": 150.0, "zigzag": 150.0}  # duration of each, approach and all [s]
HELD_OUT = {"circle": 300.0, "spiral": None}  # None: as long as it takes
FIRST_SEED = 50  # none from there on was used while the fits were built


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """What the identification of one seed came to."""

    seed: int
    shares: dict[str, float]  # position error after 120 s by the distance run, rms over starts, by what was held out
    start_shares: dict[str, float]  # the same of the condensed model it started from
    converged: bool


def run_one(seed: int, fitted: dict[str, float], held_out: dict[str, float | None], steps: Sequence[str]) -> Outcome:
    """Drives, identifies and judges.

    Args:
        seed: Of the current, of all noises and constant errors.
        fitted, held_out: Kinds of manoeuvres and their durations [s].
        steps: Of the identification.
    """
    with tempfile.TemporaryDirectory() as folder:
        paths = {kind: _drive(kind, time, seed, Path(folder)) for kind, time in {**fitted, **held_out}.items()}
        found = identify(read([paths[kind] for kind in fitted]), read([paths[kind] for kind in held_out]), steps=steps)
    return Outcome(
        seed=seed,
        shares={judged.record.kind: judged.share for judged in found.judged},
        start_shares={judged.record.kind: judged.start_share for judged in found.judged},
        converged=found.fit.converged,
    )


def _drive(kind: str, duration: float | None, seed: int, folder: Path) -> Path:
    pinned = {} if duration is None else {"manoeuvre": {"kind": kind, "duration": duration}}
    plan = sampling.merge(sampling.manoeuvre_plan(kind), pinned)
    path = folder / f"{kind}.nc"
    log.write(run_trial(scenario.parse(sampling.draw(plan, seed, 0)), seed=seed, trial=0), path)
    return path


def run_study(
    seeds: Sequence[int],
    fitted: dict[str, float] | None = None,
    held_out: dict[str, float | None] | None = None,
    steps: Sequence[str] = STEPS,
    *,
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[Outcome]:
    """The outcomes of seeds, in their order; `progress` is called with how many are done."""
    jobs = fitted or FITTED, held_out or HELD_OUT, steps
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = [pool.submit(run_one, seed, *jobs) for seed in seeds]
        for done, future in enumerate(as_completed(futures), start=1):
            future.result()
            if progress:
                progress(done)
        return [future.result() for future in futures]


def table(outcomes: Sequence[Outcome]) -> Table:
    """A row of each seed, then the median and the largest."""
    kinds = list(outcomes[0].shares)
    result = Table(title="Position error after 120 s open loop, by the distance run")
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


def main(arguments: Sequence[str] | None = None) -> None:
    """The command; `arguments` are those of the command line if None."""
    parser = argparse.ArgumentParser(description="Identification of the MuJoCo vehicle, judged on other manoeuvres.")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=FIRST_SEED)
    parser.add_argument("--workers", type=int, help="processes; all cores if not given")
    options = parser.parse_args(arguments)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("seeds", total=options.seeds)
        outcomes = run_study(
            range(options.first, options.first + options.seeds),
            workers=options.workers,
            progress=lambda done: bar.update(task, completed=done),
        )
    Console(width=None if Console().is_terminal else 120).print(table(outcomes))


if __name__ == "__main__":
    main()
