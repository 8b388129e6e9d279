"""Fits of planar vehicles whose parameters are known: coverage, convergence, process noise."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from auvsim.analysis.statistics import wilson
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.identification import compiled
from auvsim.identification.fit import DEFAULT_FREE, Fit, with_values
from auvsim.identification.identifiability import WEAK, assess, sizes
from auvsim.identification.prediction_error import PredictionErrorOptions, fit_prediction_error
from auvsim.identification.segments import SegmentOptions, fit_segments
from auvsim.identification.simulated import SHEETS, Vessel, simulate
from auvsim.identification.states import first_belief
from auvsim.physics.planar_fit import fit_planar_model
from estimators.core.consistency import nees
from estimators.core.types import Array
from estimators.planar.model import PRESTERO, PlanarParameters

FIRST_SEED = 5000  # none from there on was used while the fits were built
NOISE = (0.0, 0.0, 0.0, 1e-4, 1e-4, 1e-5)  # 0.01 m/s2/sqrt(Hz); in yaw that times a lever of a third of a metre
# Prestero's vehicle has no propeller of its own: a constant thrust, and one speed, at which drag and thrust are one.
PRESTERO_FREE = ("X_uu", "X_dd", *(name for name in DEFAULT_FREE if name[0] in "YN"))
OPTIONS = SegmentOptions(nuisances=SHEETS)
SETTLED = 200  # samples after which a filter has forgotten its start


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    seeds: int = 50
    """Records of the coverage; a quarter as many, and at least twelve, of the other parts."""
    jobs: int | None = None
    """Processes; by default one for each core."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Case:
    """A vehicle, its free parameters, and how it starts."""

    parameters: PlanarParameters
    free: tuple[str, ...]
    shaft_speed: float
    surge: float

    def vessel(self, densities: Sequence[float] = (0.0,) * 6) -> Vessel:
        """Returns the vehicle with process noise of given densities."""
        return Vessel(
            parameters=self.parameters, shaft_speed=self.shaft_speed, surge=self.surge, densities=tuple(densities)
        )

    @property
    def values(self) -> Array:
        """True values of the free parameters (k,)."""
        return np.array([getattr(self.parameters, name) for name in self.free])


def case(name: str) -> Case:
    """Returns the case `remus100`, fitted to MuJoCo's forces at 1 m/s, or `prestero`."""
    if name == "prestero":
        return Case(parameters=PRESTERO, free=PRESTERO_FREE, shaft_speed=0.0, surge=0.8)
    condensed = fit_planar_model("remus100", 1.0)
    return Case(
        parameters=condensed.parameters, free=DEFAULT_FREE, shaft_speed=condensed.shaft_speed, surge=condensed.speed
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Covered:
    """Errors of a fit."""

    scores: Array  # (k,) errors of the free parameters in units of the fit's own standard deviations
    converged: bool


def coverage(name: str, seed: int, duration: float = 300.0) -> Covered:
    """Fits from a start in which each parameter is wrong by up to a half, as drawn from the seed."""
    truth = case(name)
    run = simulate(truth.vessel(), "multisine", seed, duration)
    fit = fit_segments([run.record], _wrong(truth, seed), truth.free, OPTIONS)
    return Covered(scores=(fit.values - truth.values) / fit.deviations, converged=fit.converged)


def _wrong(truth: Case, seed: int) -> PlanarParameters:
    wrong = truth.values * np.random.default_rng(seed).uniform(0.5, 1.5, len(truth.free))
    return with_values(truth.parameters, truth.free, wrong)


def convergence(seed: int, factor: float, duration: float = 300.0) -> float:
    """Returns the largest difference between fits from the true and from a wrong start, in standard deviations.

    Each parameter of the wrong start is too large or too small by `factor`, as drawn from the seed; 0 starts from
    zeros. Infinite where a fit has not converged.
    """
    truth = case("remus100")
    run = simulate(truth.vessel(), "multisine", seed, duration)
    sides = np.random.default_rng(seed).choice([-1.0, 1.0], len(truth.free))
    wrong = truth.values * (factor**sides if factor else 0.0)
    right = fit_segments([run.record], truth.parameters, truth.free, OPTIONS)
    other = fit_segments([run.record], with_values(truth.parameters, truth.free, wrong), truth.free, OPTIONS)
    if not (right.converged and other.converged):
        return math.inf
    return float(np.max(np.abs((other.values - right.values) / right.deviations)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Noisy:
    """Results of one record with process noise."""

    polished: float  # median error of identifiable combinations, prediction error [relative]
    output: float  # that of output-error fitting
    worst_output: float  # the largest of those
    covered: Covered  # the polished parameters beside the truth
    nees: float  # of the filter with fitted parameters and noise, per degree of freedom


def noisy(seed: int, duration: float = 300.0) -> Noisy:
    """Fits one record by prediction error, from a start wrong by up to a half, and by output error, from the truth."""
    truth = case("remus100")
    run = simulate(truth.vessel(NOISE), "multisine", seed, duration)
    whole = SegmentOptions(nuisances=SHEETS, length=math.inf)
    output = fit_segments([run.record], truth.parameters, truth.free, whole)
    start = _wrong(truth, seed)
    rough = fit_segments([run.record], start, truth.free, OPTIONS)
    options, guess = PredictionErrorOptions(nuisances=SHEETS), rough.parameters if rough.converged else None
    polished = fit_prediction_error([run.record], start, truth.free, options, guess=guess)
    size = sizes(polished)
    known = np.array([c.weights for c in assess(polished).combinations if c.deviation <= WEAK])
    errors = [np.abs(known @ ((fit.values - truth.values) / size)) for fit in (polished, output)]
    return Noisy(
        polished=float(np.median(errors[0])),
        output=float(np.median(errors[1])),
        worst_output=float(np.max(errors[1])),
        covered=Covered(scores=(polished.values - truth.values) / polished.deviations, converged=polished.converged),
        nees=filter_nees(polished, run.record, run.states),
    )


def filter_nees(fit: Fit, record: Any, states: Array) -> float:
    """NEES per degree of freedom of position, heading and velocities, of a filter with a fit's parameters and noise."""
    assert fit.noise is not None
    mean, covariance = first_belief(record, fit.parameters, SHEETS.vector())
    q = np.zeros(12)
    q[:6] = fit.noise
    means, covariances = compiled.filters().trace(
        mean, covariance, record.inputs, record.measured, record.deviations**2, fit.parameters.vector(), q,
        record.step, 1,
    )  # fmt: skip
    late = slice(SETTLED, None)
    return float(np.mean(nees(means[late, :6], covariances[late, :6, :6], states[late, :6], (2,)))) / 6.0


def run_study(seeds: int, *, jobs: int | None = None, progress: Progress | None = None) -> dict[str, list[Any]]:
    """Runs all fits and returns their results by part of the study.

    Args:
        seeds: Number of records of the coverage; a quarter as many, and at least twelve, of the others.
        jobs: Number of processes; one per core if None.
        progress: Called with the number of fits done and their total.
    """
    few = max(12, seeds // 4)
    first = FIRST_SEED
    parts: dict[str, list[Callable[[], Any]]] = {
        "coverage remus100": [partial(coverage, "remus100", first + s) for s in range(seeds)],
        "coverage prestero": [partial(coverage, "prestero", first + s) for s in range(seeds)],
        "starts": [partial(convergence, first + s, 5.0) for s in range(12)],
        "zero": [partial(convergence, first + s, 0.0) for s in range(12)],
        "noisy": [partial(noisy, first + s) for s in range(few)],
    }
    tasks = [Task(key=(name, s), work=work) for name, part in parts.items() for s, work in enumerate(part)]
    done = run_tasks(tasks, jobs, progress)
    return {name: [done[name, s] for s in range(len(part))] for name, part in parts.items()}


def share_inside(fits: Sequence[Covered]) -> tuple[int, int]:
    """Returns how many errors lie inside their 95 % interval, and their number; unconverged fits count too."""
    together = np.abs(np.concatenate([fit.scores for fit in fits]))
    return int(np.sum(together <= 1.96)), together.size


def table(study: dict[str, list[Any]]) -> Table:
    """Makes a table with one row for each claim."""
    result = Table(title="Fits of 300 s of a planar vehicle whose parameters are known")
    for heading in ("what", "found", "wanted"):
        result.add_column(heading)
    for name in ("remus100", "prestero"):
        rows = study[f"coverage {name}"]
        result.add_row(f"parameters inside their 95 % interval, {name}", _covered(rows), "90 to 99 %")
    for name, text in (("starts", "starts wrong by a factor of 5"), ("zero", "from zero")):
        good = sum(value < 0.1 for value in study[name])
        found = f"{good} of {len(study[name])}, worst {max(study[name]):.1g} deviations off"
        result.add_row(f"converged, {text}", found, "all")
    rows = study["noisy"]
    result.add_section()
    worst = f"{100.0 * float(np.median([row.worst_output for row in rows])):.0f} %"
    result.add_row("process noise: median error, prediction error", _percent([r.polished for r in rows]), "10 %")
    result.add_row("the same, output error (worst combination)", f"{_percent([r.output for r in rows])} ({worst})", "")
    result.add_row("parameters inside their 95 % interval", _covered([r.covered for r in rows]), "")
    values = [row.nees for row in rows]
    found = f"{np.mean(values):.2f} (single records {min(values):.2f} to {max(values):.2f})"
    result.add_row("NEES per degree of freedom", found, "0.8 to 1.3")
    return result


def report(options: Options, progress: Progress | None = None) -> list[RenderableType]:
    """Runs the study and returns its table."""
    return [table(run_study(options.seeds, jobs=options.jobs, progress=progress))]


def _percent(values: Sequence[float]) -> str:
    return f"{100.0 * float(np.median(values)):.1f} % (at most {100.0 * max(values):.1f})"


def _covered(fits: Sequence[Covered]) -> str:
    lost = sum(not fit.converged for fit in fits)
    return f"{_share(*share_inside(fits))} of {len(fits)} seeds x {len(fits[0].scores)}, {lost} not converged"


def _share(successes: int, trials: int) -> str:
    """Formats a rate with its 95 % Wilson interval."""
    low, high = wilson(successes, trials)
    return f"{100.0 * successes / trials:.1f} % ({100.0 * low:.1f} to {100.0 * high:.1f})"
