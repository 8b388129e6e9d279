"""The same docking trials with an estimator that believes the condensed, the identified, or a wrong planar model.

From the checkout, after `auvsim identify LOG... --out model`:
`python -m auvsim.studies.identified_docking model/parameters.yaml --trials 100 --seed 10`.

Wrong by 20 %: every coefficient of drag, thrust, lift, cross-flow and rudder of the condensed model times 1.2 or 0.8,
a fair draw for each, anew in each trial; masses and added masses stay.
"""

import argparse
import math
import multiprocessing
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from auvsim.base.randomness import stream
from auvsim.identification.fit import DEFAULT_FREE, with_values
from auvsim.missions.docking.metrics import Summary, summarise
from auvsim.physics import planar_sets
from auvsim.physics.planar_fit import fit_planar_model
from auvsim.simulation import sampling, scenario
from auvsim.simulation.trial import run_trial
from estimators.planar.model import PlanarParameters

MODELS = ("condensed", "identified", "wrong")
WRONG = 0.2
SHOWN = (  # quantity, phase and unit
    ("position", "all", "m"), ("position", "approach", "m"), ("position", "final", "m"),
    ("velocity", "all", "m/s"), ("current", "all", "m/s"),
)  # fmt: skip
VEHICLE, SPEED = "remus100", 1.0  # at which the default trial condenses [m/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Ratio:
    """Paired: the rms over all trials with one model by that with another."""

    value: float
    low: float  # 95 % interval, by drawing trials again
    high: float


def wrong(seed: int, trial: int) -> PlanarParameters:
    """The condensed model, wrong by 20 %, of one trial."""
    right = fit_planar_model(VEHICLE, SPEED).parameters
    signs = stream(seed, trial, "wrong model").choice([-1.0, 1.0], len(DEFAULT_FREE))
    values = np.array([getattr(right, name) for name in DEFAULT_FREE])
    return with_values(right, DEFAULT_FREE, values * (1.0 + WRONG * signs))


def run_one(model: str, identified: Path, seed: int, trial: int) -> Summary:
    """One trial: the same truth, start and noises whatever is believed.

    Args:
        model: Of MODELS.
        identified: The file of the identified one.
        seed: Of all random streams.
        trial: Number of the trial under that seed.
    """
    with tempfile.TemporaryDirectory() as folder:
        believed = planar_sets.CONDENSE
        if model == "identified":
            believed = str(identified)
        elif model == "wrong":
            believed = str(Path(folder) / "wrong.yaml")
            planar_sets.write(model_set(wrong(seed, trial)), Path(believed))
        plan = sampling.merge(sampling.default_plan(), {"estimator": {"model": believed}})
        return summarise(run_trial(scenario.parse(sampling.draw(plan, seed, trial)), seed=seed, trial=trial))


def model_set(parameters: PlanarParameters) -> planar_sets.PlanarSet:
    """A file's content of parameters that were not identified."""
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
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> dict[str, tuple[Summary, ...]]:
    """The summaries of trials 0 .. trials-1 of a seed, by model.

    Args:
        identified: The file of the identified model.
        trials: How many with each model.
        seed: Of all of them.
        models: Of MODELS.
        workers: Processes; all cores if None.
        progress: Called with the number of trials done.
    """
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = {
            model: [pool.submit(run_one, model, identified, seed, trial) for trial in range(trials)] for model in models
        }
        for done, future in enumerate(as_completed([f for row in futures.values() for f in row]), start=1):
            future.result()
            if progress:
                progress(done)
        return {model: tuple(future.result() for future in row) for model, row in futures.items()}


def squares(summaries: Sequence[Summary], quantity: str = "position", phase: str = "all") -> np.ndarray:
    """Of each trial the number of estimates and the sum of their squared errors of a quantity (n, 2)."""
    found = [s.estimate.get(phase) for s in summaries]
    values = [getattr(q, f"{quantity}_rms") if q else None for q in found]
    rows = [
        (q.samples, q.samples * value**2) if q and value is not None else (0, 0.0)
        for q, value in zip(found, values, strict=True)
    ]
    return np.array(rows, dtype=float).reshape(-1, 2)


def rms(rows: np.ndarray) -> float:
    """Over all estimates of trials, which weigh alike."""
    count, total = rows.sum(axis=0)
    return math.sqrt(total / count) if count else math.nan


def ratio(
    ours: Sequence[Summary],
    theirs: Sequence[Summary],
    quantity: str = "position",
    phase: str = "all",
    draws: int = 2000,
) -> Ratio:
    """Ratio of rms errors, with an interval by drawing trials again in pairs (Efron 1979)."""
    a, b = squares(ours, quantity, phase), squares(theirs, quantity, phase)
    generator = np.random.default_rng(0)
    picks = generator.integers(0, len(a), (draws, len(a)))
    drawn = [rms(a[pick]) / rms(b[pick]) for pick in picks]
    low, high = np.percentile(drawn, (2.5, 97.5)).tolist()
    return Ratio(value=rms(a) / rms(b), low=low, high=high)


def table(study: Mapping[str, Sequence[Summary]], seed: int) -> Table:
    """A row of each quantity: its rms with each model, and the identified one's by those of the others."""
    count = max(map(len, study.values()), default=0)
    result = Table(title=f"{count} docking trials, seed {seed}, the same for each model")
    others = [model for model in study if model != "identified" and "identified" in study]
    for heading in ("", *study, *(f"identified by {model}" for model in others)):
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
    """A degree of freedom, in the mean over all estimates."""
    found = [(q.samples, q.nees_per_dof) for s in summaries if (q := s.estimate["all"]).nees_per_dof is not None]
    return sum(n * value for n, value in found) / sum(n for n, _ in found) if found else math.nan


def main(arguments: Sequence[str] | None = None) -> None:
    """The command; `arguments` are those of the command line if None."""
    parser = argparse.ArgumentParser(description="The same docking trials with each planar model believed.")
    parser.add_argument("identified", type=Path, help="parameters.yaml of auvsim identify")
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=10)
    parser.add_argument("--workers", type=int, help="processes; all cores if not given")
    options = parser.parse_args(arguments)
    planar_sets.load(str(options.identified), VEHICLE)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("trials", total=options.trials * len(MODELS))
        study = run_study(
            options.identified,
            options.trials,
            options.seed,
            workers=options.workers,
            progress=lambda done: bar.update(task, completed=done),
        )
    Console(width=None if Console().is_terminal else 130).print(table(study, options.seed))


if __name__ == "__main__":
    main()
