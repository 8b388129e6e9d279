"""Random docking trials of one seed: of the default plan, or of a scenario on top of it."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from statistics import median, stdev
from typing import Annotated, Any

import tyro
from rich.console import RenderableType
from rich.table import Table

from auvsim.analysis.statistics import wilson
from auvsim.base.errors import InputError
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.simulation import sampling
from auvsim.simulation.loading import find
from auvsim.studies.trials import LATER, Summary, docking_trial


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    trials: int = 100
    """Number of trials."""
    seed: int = 7
    """Seed of every random number."""
    scenario: Annotated[str | None, tyro.conf.arg(metavar="NAME|FILE.yaml")] = None
    """What is pinned on top of the default plan: a shipped scenario, such as dock_by_ranges, or a file."""
    jobs: int | None = None
    """Processes; by default one for each core."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """Summaries of trials 0 .. n-1 of one seed."""

    seed: int
    summaries: tuple[Summary, ...]

    def docked_within(self, attempts: int) -> int:
        """Number of trials that docked within a number of attempts."""
        return sum(s.docked and s.attempts <= attempts for s in self.summaries)

    @property
    def docked(self) -> list[Summary]:
        """Summaries of the trials that docked."""
        return [s for s in self.summaries if s.docked]

    def estimate_rms(self, quantity: str, phase: str = "all") -> float:
        """Rms error over all estimates of all trials in a phase; `quantity` such as `position_rms`."""
        pairs = [(q.samples, getattr(q, quantity)) for s in self.summaries if (q := s.estimate.get(phase))]
        pairs = [(samples, value) for samples, value in pairs if value is not None]
        total = sum(samples for samples, _ in pairs)
        return math.sqrt(sum(samples * value**2 for samples, value in pairs) / total) if total else math.nan

    @property
    def nees_per_dof(self) -> float:
        """Mean over trials of the NEES of the horizontal position per degree of freedom."""
        return _mean(self._nees)

    @property
    def nees_deviation(self) -> float:
        """Standard deviation of `nees_per_dof`, from the differences between the trials."""
        return stdev(self._nees) / math.sqrt(len(self._nees)) if len(self._nees) > 1 else math.nan

    @property
    def _nees(self) -> list[float]:
        return _known(s.estimate["all"].nees_per_dof for s in self.summaries)

    def failures(self) -> list[str]:
        """One line for each trial that did not dock: its number, reason, and the event's text."""
        return [
            f"trial {number}: {s.failure_reason}: {s.failure_text}"
            for number, s in enumerate(self.summaries)
            if not s.docked
        ]

    def go_arounds(self) -> list[str]:
        """One line for each trial that docked, but not on its first attempt."""
        return [f"trial {n}: attempt {s.attempts}" for n, s in enumerate(self.summaries) if s.docked and s.attempts > 1]


def run_study(
    trials: int,
    seed: int,
    pinned: Mapping | None = None,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Study:
    """Runs trials 0 .. trials-1 of a seed.

    Args:
        trials: Number of trials.
        seed: Seed of all of them.
        pinned: Nested values on top of the default plan.
        jobs: Number of processes; one per core if None.
        progress: Called with the number of trials done and their total.
    """
    tasks = [Task(key=(n,), work=partial(docking_trial, seed, n, pinned or {})) for n in range(trials)]
    done = run_tasks(tasks, jobs, progress)
    return Study(seed=seed, summaries=tuple(done[n,] for n in range(trials)))


def table(study: Study) -> Table:
    """Makes a table of success rates, accuracy at the mouth, contact and estimation errors."""
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
    row("miss distance at the mouth, rms and max", (_rms(misses), max(misses, default=math.nan)), "m", ".3f")
    parts = [_rms(_known(values)) for values in ((s.cross_track for s in docked), (s.vertical for s in docked))]
    row("its parts across and downward, rms", parts, "m", ".3f")
    headings = [abs(value) for value in _known(s.heading_error_deg for s in docked)]
    row("heading error there, rms and max", (_rms(headings), max(headings, default=math.nan)), "deg")
    row("contact impulse, median and max", _middle_and_max([s.contact_impulse for s in docked]), "N s", ".1f")
    row("contact force, median and max", _middle_and_max([s.peak_contact_force for s in docked]), "N", ".0f")
    row("contacts, median and max", _middle_and_max([float(s.contacts) for s in docked]), "1", ".0f")
    energies = [1e-3 * energy for energy in _known(s.shaft_energy for s in docked)]
    row("shaft energy to dock, median and max", _middle_and_max(energies), "kJ", ".1f")
    row("way through the water, median and max", _middle_and_max([s.way for s in docked]), "m", ".0f")
    row("time to dock, median and max", _middle_and_max([s.time for s in docked]), "s", ".0f")
    for phase in ("all", "homing", "approach", "final", "go_around"):
        values = (study.estimate_rms("position_rms", phase), study.estimate_rms("current_rms", phase))
        row(f"estimate rms, {phase}: position and current", values, "m, m/s", ".3f")
    result.add_row("NEES of position per degree of freedom, 95 %", _interval(study), "1 expected")
    inside = _known(s.estimate["all"].coverage_95 for s in study.summaries)
    row("truth inside the 95 % ellipse", (100.0 * _mean(inside),), "%", ".0f")
    factors = _known(s.real_time_factor for s in study.summaries)
    row("real-time factor of one core, median", _middle_and_max(factors)[:1], "", ".0f")
    return result


def report(options: Options, progress: Progress | None = None) -> list[RenderableType]:
    """Runs the study; returns its table and a line for each trial that did not dock at once."""
    pinned: Mapping[str, Any] = {}
    if options.scenario is not None:
        pinned, _ = sampling.load_plan(find(options.scenario))
        if "vehicles" in pinned:
            raise InputError(
                f"command line: --scenario {options.scenario} is of several vehicles; give one of one vehicle"
            )
    study = run_study(options.trials, options.seed, pinned, jobs=options.jobs, progress=progress)
    lines = study.failures() or ["no trial failed"]
    if study.go_arounds():
        lines.append(f"docked later: {'; '.join(study.go_arounds())}")
    return [table(study), *lines]


def _interval(study: Study) -> str:
    nees, half = study.nees_per_dof, 1.96 * study.nees_deviation
    return f"{nees:.2f}" + (f"  ({nees - half:.2f} to {nees + half:.2f})" if math.isfinite(half) else "")


def _known(values: Iterable[float | None]) -> list[float]:
    return [value for value in values if value is not None]


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else math.nan


def _rms(values: list[float]) -> float:
    return math.sqrt(_mean([value**2 for value in values]))


def _middle_and_max(values: list[float]) -> tuple[float, float]:
    return (median(values), max(values)) if values else (math.nan, math.nan)
