"""What filters are measured against in paper 1's study: the bound that none beats, and the most probable trajectory."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auvsim.reproduce.paper1.runs import TICK, Track, Trajectory, follow, simulate, track
from auvsim.reproduce.paper1.study import FILTERS, Row
from estimators.core import batch
from estimators.core.bounds import PosteriorBound
from estimators.core.types import Array
from estimators.docking.estimator import REFERENCE_NOISE, DockingEstimator
from estimators.docking.models import PlanarModels
from estimators.docking.sensors import COMPASS, USBL
from estimators.planar.model import PRESTERO

# When the batch estimate is made [s]. Errors of the two estimates are nearly the same, so that the ratio needs few of
# them: a single one scatters by 0.8 % at most. Each takes the whole way so far, so that what the filter has linearised
# wrongly at the start counts; later than this it is forgotten, and what remains costs ever more.
BATCH_TIMES = (100.0, 150.0, 200.0, 250.0, 300.0)


def bound(row: Row, seed: int) -> float:
    """Mean square [m^2] of the posterior Cramér-Rao bound of the position in a row without turns, losses or outliers.

    That of filters which know the truth's own noises and start as the augmented filter does, given the true way.
    """
    run = simulate(row.conditions, seed)
    models = PlanarModels(PRESTERO, REFERENCE_NOISE)
    return mean_square(row, run, track(run, along(run, models)))


def along(run: Trajectory, models: PlanarModels) -> PosteriorBound:
    """The bound of a filter of these models, given the true way of a run; constant errors are taken as zero."""
    columns = [*run.states.T, *np.zeros((len(models.noise.biases), len(run.times)))]
    columns[2] = np.unwrap(columns[2])

    def truths(time: float) -> Array:
        return np.array([[np.interp(time, run.times, column) for column in columns]])

    def first(nodes: Sequence[Any], index: int) -> Array | None:
        start = models.first(nodes, index)
        return None if start is None else start[0].covariance

    sensors = {COMPASS: models.heading, USBL: models.position}
    return PosteriorBound(models.process, sensors, truths, first, models.noise)


def mean_square(row: Row, run: Trajectory, followed: Track) -> float:
    """Mean square [m^2] of the position that a track's covariances claim, in the row's window."""
    begin, end = row.window
    counted = (run.times >= begin) & (run.times <= end) & np.isfinite(followed.means[:, 0])
    return float(np.trace(followed.covariances[counted, :2, :2], axis1=1, axis2=2).mean())


def batch_and_filter(row: Row, seed: int, times: Sequence[float] = BATCH_TIMES) -> tuple[float, float]:
    """Mean squares [m^2] of two estimates' position errors at `times` [s], from all that had arrived by then.

    The first is the most probable trajectory (batch MAP), the second the augmented filter, whose trajectory the batch
    starts from: it is to show what the filter loses by linearising only once.
    """
    run = simulate(replace(row.conditions, duration=times[-1]), seed)
    docking_filter = FILTERS["augmented_constant"].make()
    models = docking_filter.models
    sensors = {COMPASS: models.heading, USBL: models.position}
    estimator = DockingEstimator(docking_filter, run.usbl, step=TICK, keep=run.conditions.duration)
    errors = []
    for estimate, truth in zip(follow(run, estimator), run.states, strict=True):
        if estimate.time in times:
            beliefs = [node.state.belief for node in estimator.nodes if node.state is not None]
            nodes, guess = estimator.nodes[-len(beliefs) :], np.array([belief.mean for belief in beliefs])
            found = batch.solve(nodes, beliefs[0], models.process, sensors, guess)
            errors.append([(mean - truth)[:2] for mean in (found.means[-1], estimate.mean)])
    of_batch, of_filter = np.mean(np.sum(np.square(errors), axis=2), axis=0).tolist()
    return of_batch, of_filter
