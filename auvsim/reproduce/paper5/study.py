"""The study of paper 5, whole: rows of conditions, methods over paired seeds, on all cores."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.reproduce.paired import run_seed
from auvsim.reproduce.paper5 import checks
from auvsim.reproduce.paper5.methods import METHODS, Track
from auvsim.reproduce.paper5.scenes import Conditions, Run, arc, simulate
from estimators.core.types import Array

REFERENCE = "dead_reckoning"
ALL = ("dead_reckoning", "literal", "per_frame", "dp_point", "dp", "window", "particles", "graph", "landmarks")
TWO = ("dead_reckoning", "dp", "window")
LONG = ("dead_reckoning", "dp", "window", "particles", "gps_60", "gps_120")
COST = {"window": 2.0, "graph": 3.0, "particles": 1.5, "landmarks": 1.0}  # processor seconds a minute, about


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """One line of the study."""

    title: str
    conditions: Conditions
    methods: tuple[str, ...]
    runs: int = 24
    quick_runs: int = 1


BASE = Conditions()
ROCKS = Conditions(frames="floor", snr=6.0)
ROUGH = replace(ROCKS, density=0.0)
ROWS: dict[str, Row] = {
    "straight": Row(title="straight, 0 dB", conditions=BASE, methods=ALL, quick_runs=4),
    "arc": Row(title="arc, 0 dB", conditions=arc(BASE), methods=ALL, quick_runs=4),
    **{
        f"snr_{snr:g}": Row(title=f"arc, {snr:+g} dB", conditions=arc(replace(BASE, snr=snr)), methods=TWO)
        for snr in (-6.0, 6.0, 12.0)
    },
    **{
        f"density_{density:g}": Row(
            title=f"arc, {density:g} features/m2", conditions=arc(replace(BASE, density=density)), methods=TWO
        )
        for density in (0.02, 0.05, 0.2)
    },
    "drift": Row(title="straight, 240 s", conditions=replace(BASE, duration=240), methods=LONG),
    "bad": Row(
        title="arc, 30 % bad frames", conditions=arc(replace(BASE, bad_frames=0.3)), methods=(*TWO, "particles")
    ),
    "array_0": Row(title="arc, array, 0 dB", conditions=arc(replace(BASE, frames="array")), methods=TWO),
    "array_6": Row(title="arc, array, +6 dB", conditions=arc(replace(BASE, frames="array", snr=6.0)), methods=TWO),
    "rocks_straight": Row(title="straight, rocks, +6 dB", conditions=ROCKS, methods=TWO),
    "rocks_arc": Row(title="arc, rocks, +6 dB", conditions=arc(ROCKS), methods=TWO),
    "rough_straight": Row(title="straight, rough, +6 dB", conditions=ROUGH, methods=TWO),
    "rough_arc": Row(title="arc, rough, +6 dB", conditions=arc(ROUGH), methods=TWO),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Score:
    """How a method did in one run."""

    errors: Array  # (k,) of the position [m]
    heading: float  # rms error of the heading [rad]
    nees: float  # of the pose at the end, per degree of freedom; NaN where no covariance is said
    refused: Mapping[str, int]  # frames
    seconds: float  # of processor time

    @property
    def mean_square(self) -> float:
        """Of the position after the start [m^2]."""
        return float(np.mean(self.errors[1:] ** 2))


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """How a method did over all runs of a row, and relative to dead reckoning over the same runs."""

    rms: float  # [m]
    end: float  # rms position error at the end [m]
    heading: float  # rms [rad]
    nees: float  # mean
    ratio: float
    ratio_deviation: float  # by leaving out one run at a time; NaN of a single run
    speed: float  # times real time, median over the runs
    growth: Array  # (k,) rms error at each second [m]
    refused: Mapping[str, int]  # frames of all runs
    squares: Array  # (runs,) mean squares [m^2]


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """Results of the study."""

    seed: int
    quick: bool
    runs: Mapping[str, int]  # by row
    results: Mapping[str, Mapping[str, Result]]  # by row and method
    tracks: Mapping[str, tuple[Run, Mapping[str, Track]]]  # the first run of figure 2's rows
    biases: Mapping[str, tuple[Array, Array]]  # mean and its deviation (2,) of matches at 20 dB [m], by row
    inertial: Array  # (k,) rms error of an inertial system [m] at each second of the long row
    speed_log: Array  # (k,) the same of a speed log with a known heading


def reproduce(
    seed: int = 0,
    *,
    quick: bool = False,
    jobs: int | None = None,
    rows: Sequence[str] = tuple(ROWS),
    runs: int | None = None,
    progress: Progress | None = None,
) -> Study:
    """Runs the study in processes of their own; its numbers, processor times apart, do not depend on how many.

    Args:
        seed: Of all runs, 0 or more.
        quick: Few runs a row: a first look, with wide intervals.
        jobs: Processes; all cores if None.
        rows: Which of ROWS.
        runs: Of every row, instead of what the row says.
        progress: Called with what is done and the total of it.
    """
    counts = {name: runs or (ROWS[name].quick_runs if quick else ROWS[name].runs) for name in rows}
    tasks = []
    for name, count in counts.items():
        weight = ROWS[name].conditions.duration / 60.0 * sum(COST.get(m, 0.3) for m in ROWS[name].methods)
        tasks += [
            Task(key=(name, k), work=partial(scores, name, run_seed(seed, k)), weight=weight) for k in range(count)
        ]
    shown = [name for name in ("straight", "arc") if name in counts]
    tasks += [Task(key=("tracks", name), work=partial(_tracks, name, run_seed(seed, 0))) for name in shown]
    per_bias = 1 if quick else 8
    for name in shown:
        conditions = replace(ROWS[name].conditions, snr=20.0, duration=30)
        seeds = [run_seed(seed, k) for k in range(per_bias)]
        tasks.append(Task(key=("bias", name), work=partial(checks.match_bias, conditions, seeds), weight=per_bias))
    done = run_tasks(tasks, jobs, progress)
    results = {}
    for name, count in counts.items():
        each: list[dict[str, Score]] = [done[name, k] for k in range(count)]
        results[name] = {m: summarise([s[m] for s in each], [s[REFERENCE] for s in each]) for m in ROWS[name].methods}
    return Study(
        seed=seed,
        quick=quick,
        runs=counts,
        results=results,
        tracks={name: done["tracks", name] for name in shown},
        biases={name: done["bias", name] for name in shown},
        inertial=checks.inertial_growth(240, seed),
        speed_log=checks.speed_log_growth(240, seed),
    )


def scores(name: str, seed: int) -> dict[str, Score]:
    """The scores of a row's methods in the run of a seed."""
    run = simulate(ROWS[name].conditions, seed)
    return {method: score(run, METHODS[method](run)) for method in ROWS[name].methods}


def score(run: Run, track: Track) -> Score:
    """The score of a track."""
    error = track.poses - run.poses
    error[:, 2] = np.angle(np.exp(1j * error[:, 2]))
    P, nees = track.covariances[-1], math.nan
    if np.isfinite(P).all():
        nees = float(error[-1] @ np.linalg.solve(P, error[-1])) / 3.0
    return Score(
        errors=np.hypot(error[:, 0], error[:, 1]),
        heading=float(np.sqrt(np.mean(error[:, 2] ** 2))),
        nees=nees,
        refused=track.refused,
        seconds=track.seconds,
    )


def summarise(scores: Sequence[Score], reference: Sequence[Score]) -> Result:
    """One method's scores over the seeds, beside those of the reference over the same seeds."""
    squares, base = (np.array([s.mean_square for s in group]) for group in (scores, reference))
    ratio, deviation = paired_ratio(squares, base)
    growth = np.sqrt(np.mean([s.errors**2 for s in scores], axis=0))
    refused: Counter[str] = Counter()
    for s in scores:
        refused.update(s.refused)
    duration = len(growth) - 1
    return Result(
        rms=math.sqrt(float(squares.mean())),
        end=float(growth[-1]),
        heading=math.sqrt(float(np.mean([s.heading**2 for s in scores]))),
        nees=float(np.mean([s.nees for s in scores])),
        ratio=ratio,
        ratio_deviation=deviation,
        speed=duration / float(np.median([s.seconds for s in scores])),
        growth=growth,
        refused=dict(refused),
        squares=squares,
    )


def paired_ratio(squares: Array, base: Array) -> tuple[float, float]:
    """Ratio of two rms over the same runs, and its standard deviation by leaving out one run at a time."""
    count = len(squares)
    left_out = np.sqrt((squares.sum() - squares) / np.maximum(base.sum() - base, 1e-300))
    deviation = math.sqrt((count - 1) * float(left_out.var())) if count > 1 else math.nan
    return math.sqrt(float(squares.sum() / base.sum())), deviation


def _tracks(name: str, seed: int) -> Any:
    run = simulate(ROWS[name].conditions, seed)
    tracks = {method: METHODS[method](run) for method in ("dead_reckoning", "dp", "window")}
    return run, tracks
