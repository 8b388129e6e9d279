"""The same docking trials with an estimator that uses the fitted, the identified or a wrong planar model.

Fitted is the planar model fitted to the simulator's own forces. Wrong by 20 % means every coefficient of drag, thrust,
lift, cross-flow and rudder of the fitted model times 1.2 or 0.8, each drawn with equal chance, anew in each trial;
masses and added masses stay.
"""

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import tyro
from rich.console import RenderableType
from rich.markup import escape
from rich.table import Table

from auvsim.analysis.statistics import bootstrap_rms_ratio
from auvsim.base.randomness import stream
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.identification.fit import DEFAULT_FREE, with_values
from auvsim.physics import planar_sets
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.studies.trials import Summary, docking_trial
from estimators.planar.model import PlanarParameters

MODELS = ("fitted", "identified", "wrong")
WRONG = 0.2
SHOWN = (  # quantity, phase and unit
    ("position", "all", "m"), ("position", "approach", "m"), ("position", "final", "m"),
    ("velocity", "all", "m/s"), ("current", "all", "m/s"),
)  # fmt: skip
VEHICLE, SPEED = "remus100", 1.0  # speed at which the default trial fits its planar model [m/s]


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    identified: tyro.conf.Positional[Path]
    """The identified model: parameters.yaml of `auvsim identify`."""
    trials: int = 100
    """Trials with each model."""
    seed: int = 10
    """Seed of every random number."""
    jobs: int | None = None
    """Processes; by default one for each core."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Ratio:
    """Ratio of rms errors over the same trials with two models."""

    value: float
    low: float  # of its 95 % bootstrap interval
    high: float


def wrong(seed: int, trial: int) -> PlanarParameters:
    """Returns the wrong model of one trial: the fitted one with each coefficient 20 % too large or too small."""
    right = fit_planar_model(VEHICLE, SPEED).parameters
    signs = stream(seed, trial, "wrong model").choice([-1.0, 1.0], len(DEFAULT_FREE))
    values = np.array([getattr(right, name) for name in DEFAULT_FREE])
    return with_values(right, DEFAULT_FREE, values * (1.0 + WRONG * signs))


def run_one(model: str, identified: Path, seed: int, trial: int) -> Summary:
    """Runs one trial with the same truth, start and noises whatever model the estimator uses.

    Args:
        model: One of MODELS.
        identified: File of the identified model.
        seed: Seed of all random streams.
        trial: Number of the trial under that seed.
    """
    with tempfile.TemporaryDirectory() as folder:
        assumed = planar_sets.CONDENSE
        if model == "identified":
            assumed = str(identified)
        elif model == "wrong":
            assumed = str(Path(folder) / "wrong.yaml")
            planar_sets.write(model_set(wrong(seed, trial)), Path(assumed))
        return docking_trial(seed, trial, {"estimator": {"model": assumed}})


def model_set(parameters: PlanarParameters) -> planar_sets.PlanarSet:
    """Makes the content of a parameter file from parameters that were not identified."""
    return planar_sets.PlanarSet(
        vehicle=VEHICLE, speed=SPEED, method="made up", start="-", version="-", sources=(),
        parameters=planar_sets.coefficients(parameters, {}),
    )  # fmt: skip


def run_study(
    identified: Path,
    trials: int,
    seed: int,
    models: Sequence[str] = MODELS,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> dict[str, tuple[Summary, ...]]:
    """Runs trials 0 .. trials-1 of a seed and returns their summaries by model.

    Args:
        identified: File of the identified model.
        trials: Number of trials with each model.
        seed: Seed of all of them.
        models: Some of MODELS.
        jobs: Number of processes; one per core if None.
        progress: Called with the number of trials done and their total.
    """
    tasks = [
        Task(key=(model, n), work=partial(run_one, model, identified, seed, n))
        for model in models
        for n in range(trials)
    ]
    done = run_tasks(tasks, jobs, progress)
    return {model: tuple(done[model, n] for n in range(trials)) for model in models}


def squares(summaries: Sequence[Summary], quantity: str = "position", phase: str = "all") -> np.ndarray:
    """Returns the number of estimates of each trial and the sum of their squared errors of a quantity (n, 2)."""
    found = [s.estimate.get(phase) for s in summaries]
    values = [getattr(q, f"{quantity}_rms") if q else None for q in found]
    rows = [
        (q.samples, q.samples * value**2) if q and value is not None else (0, 0.0)
        for q, value in zip(found, values, strict=True)
    ]
    return np.array(rows, dtype=float).reshape(-1, 2)


def rms(rows: np.ndarray) -> float:
    """Rms over all estimates of all trials, weighted equally."""
    count, total = rows.sum(axis=0)
    return math.sqrt(total / count) if count else math.nan


def ratio(ours: Sequence[Summary], theirs: Sequence[Summary], quantity: str = "position", phase: str = "all") -> Ratio:
    """Ratio of rms errors over the trials in which both have estimates, with its bootstrap interval."""
    a, b = squares(ours, quantity, phase), squares(theirs, quantity, phase)
    both = (a[:, 0] > 0) & (b[:, 0] > 0)
    a, b = a[both], b[both]
    low, high = bootstrap_rms_ratio(a, b)
    return Ratio(value=rms(a) / rms(b), low=low, high=high)


def table(study: Mapping[str, Sequence[Summary]], seed: int) -> Table:
    """Makes a table of the rms of each quantity with each model, and of the identified model relative to the others."""
    count = max(map(len, study.values()), default=0)
    result = Table(title=f"{count} docking trials, seed {seed}, the same for each model")
    others = [model for model in study if model != "identified" and "identified" in study]
    for heading in ("", *study, *(f"identified relative to {model}" for model in others)):
        result.add_column(heading, justify="right")
    result.add_row("docked", *(str(sum(s.docked for s in summaries)) for summaries in study.values()))
    for quantity, phase, unit in SHOWN:
        values = [f"{rms(squares(summaries, quantity, phase)):.3f}" for summaries in study.values()]
        ratios = [ratio(study["identified"], study[model], quantity, phase) for model in others]
        label = f"{quantity}{'' if phase == 'all' else f', {phase}'}, rms [{unit}]"
        result.add_row(escape(label), *values, *(f"{r.value:.3f} ({r.low:.3f}-{r.high:.3f})" for r in ratios))
    result.add_row("NEES of the position", *(f"{_nees(summaries):.2f}" for summaries in study.values()))
    return result


def _nees(summaries: Sequence[Summary]) -> float:
    """Mean NEES per degree of freedom over all estimates."""
    found = [(q.samples, q.nees_per_dof) for s in summaries if (q := s.estimate["all"]).nees_per_dof is not None]
    return sum(n * value for n, value in found) / sum(n for n, _ in found) if found else math.nan


def report(options: Options, progress: Progress | None = None) -> list[RenderableType]:
    """Runs the study and returns its table.

    Raises:
        InputError: If the file of the identified model cannot be used.
    """
    planar_sets.load(str(options.identified), VEHICLE)
    study = run_study(options.identified, options.trials, options.seed, jobs=options.jobs, progress=progress)
    return [table(study, options.seed)]
