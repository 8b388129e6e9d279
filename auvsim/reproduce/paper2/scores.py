"""How far filters are off in paper 2's study, and how sure they are: of one run, and of all."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from auvsim.reproduce.paper2.filters import TIMES, Followed
from auvsim.reproduce.paper2.runs import CYCLE, Run
from estimators.core.consistency import normalised_square

SETTLED = 500.0  # from then on it is judged [s]
LOST = 200.0  # position error at the end that counts as lost [m]


class Score(NamedTuple):
    """Of one run."""

    late: float  # mean squared position error after SETTLED [m^2]
    final: float  # squared position error at the end [m^2]
    nees: float  # of the position after SETTLED, per axis
    current_500: float  # current error [m/s]
    current_1000: float
    current_bias: float  # size of the mean error of the current after SETTLED [m/s]
    peak: float  # largest position error up to SETTLED [m]
    rank: int = 4  # of the information, as the filter says
    mirror: bool = False  # whether it says that there is a second solution


class Result(NamedTuple):
    """Of all runs."""

    runs: int
    rms: float  # of the position after SETTLED [m]
    rms_deviation: float  # standard deviation of that, over draws of the runs
    median: float  # of the runs' rms [m]
    final: float  # rms at the end [m]
    nees: float
    nees_deviation: float
    current_500: float  # medians over the runs
    current_1000: float
    current_bias: float
    peak: float  # median [m]
    lost: float  # share of the runs
    rank_2: float
    rank_3: float
    mirror: float


def score(run: Run, followed: Followed) -> Score:
    """The score of a filter in a run."""
    error = followed.means - run.truth[CYCLE::CYCLE]
    place, late = error[:, :2], TIMES > SETTLED
    distance = np.hypot(*place.T)
    current = np.hypot(*error[:, 2:].T)
    covariances = followed.covariances[late, :2, :2]
    degenerate = not (np.linalg.det(covariances) > 0.0).all()
    nees = math.nan if degenerate else float(normalised_square(place[late], covariances).mean()) / 2.0
    at_500, at_1000 = np.searchsorted(TIMES, (500.0, 1000.0))
    warnings = getattr(followed.state, "warnings", ())
    geometry = getattr(followed.state, "geometry", None)
    return Score(
        late=float(np.mean(distance[late] ** 2)),
        final=float(distance[-1] ** 2),
        nees=nees,
        current_500=float(current[at_500]),
        current_1000=float(current[at_1000]),
        current_bias=float(np.hypot(*error[late, 2:].mean(axis=0))),
        peak=float(distance[~late].max()),
        rank=geometry.rank if geometry else 4,
        mirror=any(text.startswith("mirror") for text in warnings),
    )


def summarise(scores: Sequence[Score]) -> Result:
    """All runs together."""
    table = np.array(scores, dtype=float)  # (runs, values)
    by = {name: table[:, k] for k, name in enumerate(Score._fields)}
    rms = math.sqrt(by["late"].mean())
    return Result(
        runs=len(scores),
        rms=rms,
        rms_deviation=_deviation(by["late"]) / (2.0 * rms),
        median=float(np.median(np.sqrt(by["late"]))),
        final=math.sqrt(by["final"].mean()),
        nees=float(by["nees"].mean()),
        nees_deviation=_deviation(by["nees"]),
        current_500=float(np.median(by["current_500"])),
        current_1000=float(np.median(by["current_1000"])),
        current_bias=float(np.median(by["current_bias"])),
        peak=float(np.median(by["peak"])),
        lost=float(np.mean(by["final"] > LOST**2)),
        rank_2=float(np.mean(by["rank"] == 2)),
        rank_3=float(np.mean(by["rank"] == 3)),
        mirror=float(by["mirror"].mean()),
    )


def _deviation(values: np.ndarray) -> float:
    """Standard deviation of the mean; NaN of a single run."""
    return float(values.std(ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else math.nan
