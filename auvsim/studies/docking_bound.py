"""How near the default estimator comes to the bound, relative to the dock: the same trials, by the distance to it."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from auvsim.analysis.estimates import estimate_errors, fix_fates
from auvsim.base.frames import Array
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.data import log as log_files
from auvsim.data.log import VehicleLog
from auvsim.data.phases import interpolate
from auvsim.missions.docking.dock_frame import to_body
from auvsim.navigation.docking import navigator, steady_noise
from auvsim.navigation.estimate import DOCK_HEADING_BIAS
from auvsim.replay import trial_logs
from auvsim.replay.recording import Recording
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import run
from estimators.core.bounds import PosteriorBound
from estimators.core.types import Array as StateArray
from estimators.docking.models import PlanarModels

CREEP = 1e-4  # by which of its deviations a constant error walks in a second, since the noise must reach all states
QUIET = 0.01  # factor on the process noise of a vehicle that moves nearly as the model says
DENSITIES = ("position", "heading", "surge", "sway", "yaw_rate", "current")
BANDS = ((0.0, 20.0), (20.0, 60.0), (60.0, 200.0))  # distances of the vehicle from the mouth [m]


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    trials: int = 60
    """Number of trials."""
    seed: int = 7
    """Seed of every random number."""
    jobs: int | None = None
    """Processes; by default one for each core."""


class Squares(NamedTuple):
    """Sums over the estimates of one trial in one band."""

    count: int
    error: float  # squared errors of the position relative to the dock [m2]
    bound: float  # their bound [m2]
    quiet: float  # their bound where the vehicle moves nearly as the model says [m2]
    nees: float  # of the estimator's own covariance


def along(log: VehicleLog, parameters: Any, noise: Any, **options: Any) -> PosteriorBound:
    """The bound of a filter of these models, given the true way of a run; constant errors are taken as zero.

    Args:
        log: Of the run.
        parameters: Of the planar model.
        noise: That it assumes.
        **options: Of the `PlanarModels`.
    """
    models, truth = PlanarModels(parameters, noise, **options), log["truth"]
    assert log.structure is not None
    through_water = truth["nu"][:, [0, 1, 5]]
    through_water[:, :2] -= to_body(truth["quaternion"], truth["current"])[:, :2]
    states = np.column_stack((
        truth["position"][:, :2] - log.structure.position[:2], np.unwrap(truth["attitude"][:, 2]), through_water,
        truth["current"][:, :2], np.zeros((len(truth["time"]), len(noise.bias_names))),
    ))  # fmt: skip

    def truths(time: float) -> StateArray:
        return interpolate(np.array([time]), truth["time"], states)

    def first(nodes: Sequence[Any], index: int) -> StateArray | None:
        start = models.first(nodes, index)
        return None if start is None else start[0].covariance

    return PosteriorBound(models.process, models.sensors, truths, first, models.noise)


def bound_of(recording: Recording, log: VehicleLog, factor: float = 1.0) -> Array:
    """Covariances (n, 2, 2) [m2] that no estimate of the position relative to the dock stays below, at each estimate.

    Of fixes, only those that the run's estimator took are used: the bound knows which are outliers.

    Args:
        recording: What the estimator was given.
        log: Of the same run.
        factor: On the process noise that the estimator assumes in steady water.
    """
    setup = recording.setup(recording.own)
    noise = steady_noise(recording.own)
    noise = replace(noise, **{name: factor * getattr(noise, name) for name in DENSITIES})
    walking = {name: replace(bias, density=(CREEP * bias.deviation) ** 2) for name, bias in noise.biases.items()}
    bound = navigator(setup, partial(along, log), replace(noise, biases=walking))
    refused = {n for n, why in zip(log["usbl"]["sequence"].tolist(), fix_fates(log).tolist(), strict=True) if why}
    position = interpolate(log["estimate"]["time"], log["truth"]["time"], log["truth"]["position"])[:, :2]
    found, names = [], list(bound.states)
    turns = names.index(DOCK_HEADING_BIAS)
    assert log.structure is not None
    for tick, (north, east) in zip(recording.ticks(), position - log.structure.position[:2], strict=True):
        readings = [r for r in tick.readings if r.sensor != "usbl" or r.sequence not in refused]
        covariance = bound.update(tick.time, readings, (), tick.commands).covariance
        slope = np.eye(2, len(names))
        slope[:, turns] = -east, north  # an error of the dock's compass turns what it sees, and its axis with it
        found.append(slope @ covariance @ slope.T)
    return np.array(found)


def trial(seed: int, number: int) -> tuple[Squares, ...]:
    """Flies a trial of the default plan and sums its errors and their bound in each band."""
    found = run(scenario.parse(sampling.draw(sampling.default_plan(), seed, number)), seed=seed, trial=number)
    with tempfile.TemporaryDirectory() as folder:
        log_files.write(found, Path(folder) / "trial.nc")
        (recording,) = trial_logs.recordings(Path(folder) / "trial.nc")
    log = found.vehicle()
    assert log.structure is not None
    errors = estimate_errors(log)
    docked = [*log.phases].index("docked")
    position = interpolate(errors.time, log["truth"]["time"], log["truth"]["position"])
    away = np.hypot(*(position - log.structure.position)[:, :2].T)
    counted = errors.initialised & (errors.phase != docked)
    bounds = [np.trace(bound_of(recording, log, factor), axis1=1, axis2=2) for factor in (1.0, QUIET)]
    values = (np.sum(errors.relative**2, axis=1), *bounds, errors.nees_relative)
    bands = [counted & (away >= near) & (away < far) for near, far in BANDS]
    return tuple(Squares(int(band.sum()), *(float(value[band].sum()) for value in values)) for band in bands)


def report(options: Options, progress: Progress | None = None) -> list[RenderableType]:
    """Runs the study; returns its table and what its bounds are."""
    tasks = [Task(key=(n,), work=partial(trial, options.seed, n)) for n in range(options.trials)]
    done = run_tasks(tasks, options.jobs, progress)
    text = (
        "bound: posterior Cramér-Rao, with all noises as the estimator assumes them in steady water; quiet: with "
        f"{QUIET:g} of its process noise, as if the vehicle moved as the model says and the current stood"
    )
    return [table([done[n,] for n in range(options.trials)], options.seed), text]


def table(trials: Sequence[Sequence[Squares]], seed: int) -> Table:
    """Makes a table with one row for each band of distance."""
    result = Table(
        "distance from the mouth [m]",
        title=f"position relative to the dock, {len(trials)} docking trials of seed {seed}",
    )
    for heading in ("error rms [m]", "bound [m]", "error / bound (95 %)", "quiet bound [m]", "error / it", "NEES"):
        result.add_column(heading, justify="right")
    for k, (near, far) in enumerate(BANDS):
        sums = np.array([squares[k] for squares in trials])  # (n, 5)
        count, error, bound, quiet, nees = sums.sum(axis=0).tolist()
        ratios = [ratio_of_roots(sums[:, 1], sums[:, column]) for column in (2, 3)]
        first, second = (f"{ratio:.2f} ({ratio - half:.2f} to {ratio + half:.2f})" for ratio, half in ratios)
        roots = [f"{math.sqrt(square / count):.3f}" for square in (error, bound, quiet)]
        result.add_row(f"{near:g} to {far:g}", *roots[:2], first, roots[2], second, f"{nees / (2.0 * count):.2f}")
    return result


def ratio_of_roots(squares: Array, bounds: Array) -> tuple[float, float]:
    """Root of the ratio of two sums over trials (n,), and half its 95 % interval, from how trials scatter about it."""
    total = bounds.sum()
    ratio = squares.sum() / total
    deviation = math.sqrt(np.sum((squares - ratio * bounds) ** 2)) / total
    return math.sqrt(ratio), 1.96 * deviation / (2.0 * math.sqrt(ratio))
