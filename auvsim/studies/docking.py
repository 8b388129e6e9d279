"""Random docking trials of one seed on all cores, and what they come to.

From the checkout: `python -m auvsim.studies.docking --trials 100 --seed 7`.
"""

import argparse
import math
import multiprocessing
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from statistics import median

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from auvsim.missions.docking.metrics import Summary, summarise, wilson
from auvsim.simulation import sampling, scenario
from auvsim.simulation.trial import run_trial

LATER = 3  # attempts that the default guidance has


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """The summaries of trials 0 .. n-1 of one seed."""

    seed: int
    summaries: tuple[Summary, ...]

    def docked_within(self, attempts: int) -> int:
        """How many trials docked within so many attempts."""
        return sum(s.docked and s.attempts <= attempts for s in self.summaries)

    @property
    def docked(self) -> list[Summary]:
        """The trials that docked."""
        return [s for s in self.summaries if s.docked]

    def estimate_rms(self, quantity: str, phase: str = "all") -> float:
        """Root mean square over all estimates of all trials in a phase, of `position_rms` or the like; NaN if none."""
        pairs = [(q.samples, getattr(q, quantity)) for s in self.summaries if (q := s.estimate.get(phase))]
        pairs = [(samples, value) for samples, value in pairs if value is not None]
        total = sum(samples for samples, _ in pairs)
        return math.sqrt(sum(samples * value**2 for samples, value in pairs) / total) if total else math.nan

    @property
    def nees_per_dof(self) -> float:
        """Mean over trials of the normalised error squared of the horizontal position, for each degree of freedom."""
        return _mean(_known(s.estimate["all"].nees_per_dof for s in self.summaries))

    def failures(self) -> list[str]:
        """One line for each trial that did not dock: its number, reason, and the log's words."""
        return [
            f"trial {number}: {s.failure_reason}: {s.failure_text}"
            for number, s in enumerate(self.summaries)
            if not s.docked
        ]

    def go_arounds(self) -> list[str]:
        """One line for each trial that docked, but not on its first attempt."""
        return [f"trial {n}: attempt {s.attempts}" for n, s in enumerate(self.summaries) if s.docked and s.attempts > 1]


def run_one(trial: int, seed: int, pinned: Mapping) -> Summary:
    """One trial of the default plan with some values pinned."""
    plan = sampling.merge(sampling.default_plan(), pinned)
    return summarise(run_trial(scenario.parse(sampling.draw(plan, seed, trial)), seed=seed, trial=trial))


def run_study(
    trials: int,
    seed: int,
    pinned: Mapping | None = None,
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Study:
    """Runs trials 0 .. trials-1 of a seed in processes of their own.

    Args:
        trials: how many.
        seed: of all of them.
        pinned: nested values on top of the default plan.
        workers: processes; all cores if None.
        progress: called with the number of trials done.
    """
    work = partial(run_one, seed=seed, pinned=pinned or {})
    # Spawned, not forked: MuJoCo, OpenGL and BLAS may hold threads and locks of this process.
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = [pool.submit(work, trial) for trial in range(trials)]
        for done, future in enumerate(as_completed(futures), start=1):
            future.result()
            if progress:
                progress(done)
        return Study(seed=seed, summaries=tuple(future.result() for future in futures))


def table(study: Study) -> Table:
    """What the study came to."""
    count, docked = len(study.summaries), study.docked
    result = Table("quantity", "value", "unit", title=f"{count} docking trials, seed {study.seed}")

    def row(name: str, values: Iterable[float], unit: str, form: str = ".2f") -> None:
        texts = [f"{value:{form}}" for value in values if math.isfinite(value)]
        if texts:
            result.add_row(name, "  ".join(texts), unit)

    for name, attempts in (("docked on the first attempt", 1), (f"docked within {LATER} attempts", LATER)):
        successes = study.docked_within(attempts)
        low, high = wilson(successes, count)
        result.add_row(name, f"{successes} of {count}  ({100 * low:.1f} to {100 * high:.1f} %)", "95 % Wilson")
    misses = _known(s.miss_distance for s in docked)
    row("miss distance at the mouth, rms and max", (_rms(misses), max(misses, default=math.nan)), "m")
    headings = [abs(value) for value in _known(s.heading_error_deg for s in docked)]
    row("heading error there, rms and max", (_rms(headings), max(headings, default=math.nan)), "deg")
    row("contact impulse, median and max", _middle_and_max([s.contact_impulse for s in docked]), "N s", ".1f")
    row("contact force, median and max", _middle_and_max([s.peak_contact_force for s in docked]), "N", ".0f")
    row("time to dock, median and max", _middle_and_max([s.time for s in docked]), "s", ".0f")
    for phase in ("all", "homing", "approach", "final", "go_around"):
        values = (study.estimate_rms("position_rms", phase), study.estimate_rms("current_rms", phase))
        row(f"estimate rms, {phase}: position and current", values, "m, m/s", ".3f")
    row("NEES of position for each degree of freedom", (study.nees_per_dof,), "1 expected")
    inside = _known(s.estimate["all"].coverage_95 for s in study.summaries)
    row("truth inside the 95 % ellipse", (100.0 * _mean(inside),), "%", ".0f")
    factors = _known(s.real_time_factor for s in study.summaries)
    row("real-time factor of one core, median", _middle_and_max(factors)[:1], "", ".0f")
    return result


def main(arguments: Sequence[str] | None = None) -> None:
    """The command; `arguments` are those of the command line if None."""
    parser = argparse.ArgumentParser(description="Random docking trials of the default plan on all cores.")
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--workers", type=int, help="processes; all cores if not given")
    options = parser.parse_args(arguments)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("trials", total=options.trials)
        study = run_study(
            options.trials,
            options.seed,
            workers=options.workers,
            progress=lambda done: bar.update(task, completed=done),
        )
    console = Console(width=None if Console().is_terminal else 120)
    console.print(table(study))
    for line in study.failures() or ["no trial failed"]:
        console.print(line, highlight=False)
    if study.go_arounds():
        console.print("docked later:", "; ".join(study.go_arounds()), highlight=False)


def _known(values: Iterable[float | None]) -> list[float]:
    return [value for value in values if value is not None]


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else math.nan


def _rms(values: list[float]) -> float:
    return math.sqrt(_mean([value**2 for value in values]))


def _middle_and_max(values: list[float]) -> tuple[float, float]:
    return (median(values), max(values)) if values else (math.nan, math.nan)


if __name__ == "__main__":
    main()
