"""The comparison of paper 1's filter with others: its rows and filters as data, and one score of each pair and seed."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from auvsim.reproduce.paper1.runs import TICK, Conditions, Track, Trajectory, simulate, track
from estimators.core.consistency import nees
from estimators.docking.estimator import (
    INTERACTING_NOISE,
    PAPER_NOISE,
    REFERENCE_NOISE,
    REGULAR_NOISE,
    AugmentedFilter,
    InteractingFilter,
    PaperFilter,
)
from estimators.planar.model import PRESTERO

C = TypeVar("C")


@dataclass(frozen=True, kw_only=True, slots=True)
class Row(Generic[C]):
    """One line of the study."""

    title: str
    conditions: C  # of its runs
    window: tuple[float, float]  # the errors that count, first and last time [s]
    runs: int = 100  # of the full study
    quick_runs: int = 6


SETTLED = Conditions(duration=6000.0)
STEADY, TURN = Conditions(), Conditions(turn=(120.0, 130.0))
AFTER = (60.0, 300.0)
ROWS: dict[str, Row[Conditions]] = {
    **{
        f"settled_{radius}": Row(
            title=f"settled, {radius} m",
            conditions=replace(SETTLED, radius=radius),
            window=(100.0, 6000.0),
            runs=4,
            quick_runs=1,
        )
        for radius in (200, 100, 40, 12)
    },
    "start": Row(title="start, first 60 s", conditions=replace(STEADY, duration=60.0), window=(0.0, 60.0)),
    "turn_40": Row(title="current turns by 90 degrees, 40 m", conditions=TURN, window=(120.0, 180.0)),
    "turn_100": Row(title="the same at 100 m", conditions=replace(TURN, radius=100), window=(120.0, 180.0)),
    "after_turn": Row(title="70 to 170 s after that turn, 40 m", conditions=TURN, window=(200.0, 300.0)),
    "dropped": Row(title="40 % of fixes lost", conditions=replace(STEADY, dropped=0.4), window=AFTER),
    "late": Row(title="30 % of fixes out of order", conditions=replace(STEADY, late=0.3), window=AFTER),
    "jitter": Row(title="a fix every 3 to 8 s", conditions=replace(STEADY, interval=(3.0, 8.0)), window=AFTER),
    "outliers": Row(title="10 % outliers of 10 to 30 m", conditions=replace(STEADY, outliers=0.1), window=AFTER),
    "small_outliers": Row(
        title="10 % outliers of 1 to 3 m",
        conditions=replace(STEADY, outliers=0.1, outlier_distance=(1.0, 3.0)),
        window=AFTER,
    ),
    "thrust": Row(title="thrust 10 % below belief", conditions=replace(STEADY, thrust=0.9), window=AFTER),
    "compass": Row(
        title="compass 2 degrees off", conditions=replace(STEADY, compass_bias=math.radians(2.0)), window=AFTER
    ),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Candidate:
    """One column of the study."""

    title: str
    make: Callable[[], Any]  # the filter
    options: Mapping[str, Any] = field(default_factory=dict)  # of the DockingEstimator


LATE = {"compensate_delay": False}
FILTERS: dict[str, Candidate] = {
    "paper": Candidate(title="paper: delay and eq. 11", make=partial(PaperFilter, PRESTERO)),
    "paper_euler": Candidate(
        title="paper, Euler's method", make=partial(PaperFilter, PRESTERO, integrator="euler", max_substep=TICK)
    ),
    "regular": Candidate(
        title="regular, same noise", make=partial(PaperFilter, PRESTERO, PAPER_NOISE, weights=None), options=LATE
    ),
    "regular_best": Candidate(
        title="regular, best noise", make=partial(PaperFilter, PRESTERO, REGULAR_NOISE, weights=None), options=LATE
    ),
    "delay_only": Candidate(
        title="delay, no current", make=partial(PaperFilter, PRESTERO, REGULAR_NOISE, weights=None)
    ),
    "current_only": Candidate(title="eq. 11, no delay", make=partial(PaperFilter, PRESTERO), options=LATE),
    "augmented": Candidate(
        title="augmented, current 1e-5",
        make=partial(AugmentedFilter, PRESTERO, replace(REFERENCE_NOISE, current=1e-5), gate=None),
    ),
    "augmented_constant": Candidate(
        title="augmented, current 1e-8", make=partial(AugmentedFilter, PRESTERO, REFERENCE_NOISE, gate=None)
    ),
    "unscented": Candidate(
        title="unscented, current 1e-8",
        make=partial(AugmentedFilter, PRESTERO, REFERENCE_NOISE, gate=None, transform="unscented"),
    ),
    "imm": Candidate(
        title="interacting, eight states",
        make=partial(InteractingFilter, PRESTERO, INTERACTING_NOISE, currents=(1e-6, 0.02)),
    ),
    "imm_biases": Candidate(title="interacting, with biases", make=partial(InteractingFilter, PRESTERO)),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Score:
    """How one filter did in one run, in the window of its row."""

    mean_square: float  # of the horizontal error [m^2]
    mean: float  # of the horizontal error [m]
    maximum: float  # [m]
    nees: float  # of the position, mean per degree of freedom
    state_nees: float  # of all eight states; NaN where the covariance leaves some out
    refused: int  # fixes, outliers included


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """How one filter did over all runs of a row, and against the paper's over the same runs."""

    rms: float  # [m]
    mean: float  # [m]
    variance: float  # of the error's norm [m^2]
    maximum: float  # of all runs [m]
    peak: float  # mean of the runs' maxima [m]
    worst_rms: float  # of one run [m]
    nees: float  # of the position per degree of freedom
    state_nees: float  # of all eight states
    ratio: float  # rms relative to the reference
    ratio_deviation: float  # its standard deviation, by leaving out one run at a time; NaN of a single run


def evaluate(row: Row[Conditions], seed: int, filters: Sequence[str] = tuple(FILTERS)) -> dict[str, Score]:
    """The scores of filters in the run of a seed."""
    run = simulate(row.conditions, seed)
    return {name: score(row, run, track(run, FILTERS[name].make(), **FILTERS[name].options)) for name in filters}


def score(row: Row, run: Trajectory, followed: Track) -> Score:
    """The score of a track in the row's window; ticks before the first estimate do not count."""
    begin, end = row.window
    counted = (run.times >= begin) & (run.times <= end) & np.isfinite(followed.means[:, 0])
    errors = followed.errors(run)[counted]
    means, covariances, truths = followed.means[counted], followed.covariances[counted], run.states[counted]
    squares = nees(means[:, :2], covariances[:, :2, :2], truths[:, :2])
    holds_all = bool((np.diagonal(covariances, axis1=1, axis2=2) > 0.0).all())
    return Score(
        mean_square=float(np.mean(errors**2)),
        mean=float(errors.mean()),
        maximum=float(errors.max()),
        nees=float(squares.mean()) / 2.0,
        state_nees=float(nees(means, covariances, truths, angles=(2,)).mean()) / 8.0 if holds_all else math.nan,
        refused=sum(followed.refused.values()),
    )


def summarise(scores: Sequence[Score], reference: Sequence[Score]) -> Result:
    """One filter's scores over the seeds, beside those of the reference over the same seeds."""
    squares, base = (np.array([s.mean_square for s in group]) for group in (scores, reference))
    count = len(squares)
    mean, mean_square = float(np.mean([s.mean for s in scores])), float(squares.mean())
    left_out = np.sqrt((squares.sum() - squares) / np.maximum(base.sum() - base, 1e-300))
    deviation = math.sqrt((count - 1) * float(left_out.var())) if count > 1 else math.nan
    return Result(
        rms=math.sqrt(mean_square),
        mean=mean,
        variance=mean_square - mean**2,
        maximum=max(s.maximum for s in scores),
        peak=float(np.mean([s.maximum for s in scores])),
        worst_rms=math.sqrt(float(squares.max())),
        nees=float(np.mean([s.nees for s in scores])),
        state_nees=float(np.mean([s.state_nees for s in scores])),
        ratio=math.sqrt(mean_square / float(base.mean())),
        ratio_deviation=deviation,
    )
