"""The error to expect where a bound of first order says nothing: posteriors of drawn missions, by splitting filters.

Where ranges leave a direction open, or a second solution, what they say of it is of second order: errors across a
range make it longer by their square. The Cramér-Rao bound does not know that. A Gaussian sum whose terms are split
until a range is straight over each comes near to the true posterior, and the mean of its variance over drawn missions
is the least mean squared error that any estimator can have (that of the posterior mean).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from auvsim.base.frames import Array
from estimators.core.history import Node
from estimators.core.models.odometry import Displacement, N, OdometryNoise
from estimators.core.odometry_bounds import Told
from estimators.core.types import Gaussian
from estimators.motion_radius.bank import BENT, BankFilter
from estimators.motion_radius.ranges import leader_range

DRAWS = 8  # missions that are enough for a figure of some 10 %


class Ranges(NamedTuple):
    """What a follower ranges to, as planned: one after another, none late."""

    times: Array  # (k,) [s]
    displacements: Array  # (k, 6) through the water since the range before, rows as `Displacement`
    relative: Array  # (k, 3) from what is ranged to the vehicle, north and east, and how deep below it that is [m]
    variance: Array  # (k,) [m^2]; inf: no range
    told: Told | None  # errors of the places of what is ranged to


def expected_error(
    ranges: Ranges, prior: Array, walks: Array, after: float, generator: Generator, draws: int = DRAWS
) -> float:
    """Rms error [m] of the position's posterior mean from `after` [s] on, over drawn missions.

    Args:
        ranges: As planned.
        prior: Covariance (9, 9) of the states of `core.models.odometry` at the start, diagonal.
        walks: Densities (9,) of random walks of the states, which only the filter assumes.
        after: From when on the error counts [s].
        generator: Of what is drawn.
        draws: Missions.
    """
    return math.sqrt(float(np.mean([_mean_variance(ranges, prior, walks, after, generator) for _ in range(draws)])))


def _mean_variance(ranges: Ranges, prior: Array, walks: Array, after: float, generator: Generator) -> float:
    """Of the position, north and east together, in one mission [m^2]."""
    start = Gaussian(mean=np.zeros(N), covariance=prior)
    sources, variance, memory = _remembered(ranges)
    bank = BankFilter(start, OdometryNoise(), walks=walks, memory=memory, bend=BENT)
    state = bank.start([Node(0.0, (), [], True)], 0)
    deviation = math.sqrt(variance)
    found = []
    for k, (measured, place, distance) in enumerate(_drawn(ranges, prior, generator)):
        row = (ranges.displacements[k, 0], *measured, *ranges.displacements[k, 3:])
        since = Displacement(*(a + b for a, b in zip(state.since, row, strict=True)))
        state = state._replace(since=since, verdicts=())
        if math.isfinite(ranges.variance[k]):
            m = leader_range(
                distance, place, deviation=math.sqrt(ranges.variance[k]), depth=0.0, stamp=ranges.times[k],
                leader_deviation=deviation if sources[k] >= 0 else 0.0, source=str(sources[k]),
            )  # fmt: skip
            state = bank.correct(state, ranges.times[k], [m])
        if ranges.times[k] >= after:
            found.append(float(np.trace(state.belief.covariance[:2, :2])))
    return float(np.mean(found)) if found else math.nan


def _drawn(ranges: Ranges, prior: Array, generator: Generator):
    """Measured displacement (2,), told place (3,) and range of each sight of a drawn mission, in still water.

    The filter takes all states for zero; the truth is drawn about that, and the motion relative to what is ranged to
    is as planned.
    """
    x = np.sqrt(np.diagonal(prior)) * generator.standard_normal(N)
    c, s = math.cos(x[8]), math.sin(x[8])
    turn = (1.0 + x[7]) * np.array(((c, -s), (s, c)))
    own, errors = x[:2].copy(), {}
    for k, (duration, north, east, nn, ne, ee) in enumerate(ranges.displacements.tolist()):
        own = own + (north, east) + duration * x[2:4]
        noise = generator.multivariate_normal(np.zeros(2), ((nn, ne), (ne, ee)))
        error = np.zeros(2)
        if ranges.told is not None and (source := int(ranges.told.sources[k])) >= 0:
            new = math.sqrt(ranges.told.added[k]) * generator.standard_normal(2)
            error = errors[source] = ranges.told.kept[k] * errors.get(source, np.zeros(2)) + new
        off = ranges.relative[k]
        white = math.sqrt(v) if math.isfinite(v := ranges.variance[k]) else 0.0
        seen = (1.0 + x[6]) * float(np.linalg.norm(off)) + x[4] + x[5] * ranges.times[k]
        place = own - off[:2] + error
        yield turn @ (north, east) + noise, (*place.tolist(), off[2]), seen + white * generator.standard_normal()


def _remembered(ranges: Ranges) -> tuple[NDArray[np.int64], float, float]:
    """Who tells each place (k,), and the variance [m^2] and time constant [s] of what all err by, once settled."""
    told = ranges.told
    if told is None:
        return np.full(len(ranges.times), -1), 0.0, 0.0
    variances, decays = [], []
    for source in range(int(told.sources.max()) + 1):
        of = np.flatnonzero(told.sources == source)
        variance = 0.0
        for k in of:
            variance = told.kept[k] ** 2 * variance + told.added[k]
        variances.append(variance)
        decays.append(-np.sum(np.log(np.maximum(told.kept[of[1:]], 1e-9))) / max(1e-9, np.ptp(ranges.times[of])))
    return told.sources, float(np.mean(variances)), 1.0 / max(float(np.mean(decays)), 1e-9)
