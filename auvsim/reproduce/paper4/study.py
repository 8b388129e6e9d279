"""The study of paper 4: every formation, speed, variance of the ranges and step, by every filter, on the same noise."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from auvsim.base.frames import Array
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.reproduce.paper4 import line, runs, uwb
from auvsim.reproduce.paper4.formations import DURATION, FORMATIONS, SPEEDS, VARIANCES
from auvsim.reproduce.paper4.runs import FILTERS, NOISE, Case
from estimators.formation import bounds
from estimators.formation.models import DeadReckoning

STEPS = (1.0, 7.5)  # the paper does not state it: 1 s, and that with which its table 3 is met [s]
MIDDLE = 4.0  # the variance of table 2 [m^2]
RUNS, QUICK_RUNS = 100, 12
LINE_RUNS, QUICK_LINE_RUNS = 60, 12
UWB_RUNS, QUICK_UWB_RUNS = 200, 60


class Key(NamedTuple):
    """A cell of the study."""

    step: float  # [s]
    speed: float  # [m/s]
    variance: float  # [m^2]
    formation: int


class Result(NamedTuple):
    """A filter in a cell."""

    a_rms: float  # mean over runs (eq. 30) [m]
    half: float  # half of its 95 % interval [m]
    rms: float  # over all runs and times [m]
    nees: float  # of the position, over 2


class Trace(NamedTuple):
    """The extended filter in the first run of a cell."""

    time: Array  # (s,) [s]
    errors: Array  # (s, 2) north, east [m]
    s1: Array  # (s,) of the formation as it is seen from the estimate (fig. 11)


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """All that was found."""

    seed: int
    quick: bool
    runs: int
    results: Mapping[Key, Mapping[str, Result]]  # by filter
    traces: Mapping[int, Trace]  # by formation, at 1 m/s, the middle variance, and a step of 1 s
    offsets: Mapping[
        tuple[str, float], line.Trap
    ]  # by sides and offset of the leaders of formation 8 from the line [m]
    manoeuvres: Mapping[str, Mapping[str, line.Trap]]  # by manoeuvre, by filter
    uwb: Mapping[float, uwb.Experiment]  # by heading bias [deg]

    def bound(self, key: Key) -> float:
        """Least rms error in steady motion [m]; infinite where there is none."""
        return steady_bound(key)


def reproduce(seed: int, *, quick: bool, jobs: int | None = None, progress: Progress | None = None) -> Study:
    """Runs the study.

    Args:
        seed: Of all noise.
        quick: Few runs.
        jobs: Processes; None for all cores.
        progress: Called after each task.
    """
    count, line_count = (QUICK_RUNS, QUICK_LINE_RUNS) if quick else (RUNS, LINE_RUNS)
    tasks = [
        Task(key=("cell", key), work=partial(cell, key, seed, count), weight=len(filters(key)) / key.step)
        for key in keys()
    ]
    tasks += [Task(key=("trace", f), work=partial(trace, f, seed), weight=0.1) for f in FORMATIONS]
    tasks += [
        Task(key=("line", (sides, offset)), work=partial(line.trapped, sides, offset, seed, line_count), weight=2.0)
        for sides in line.SIDES
        for offset in line.OFFSETS
    ]
    tasks += [
        Task(key=("manoeuvre", name), work=partial(line.compared, name, seed, line_count), weight=4.0)
        for name in line.MANOEUVRES
    ]
    uwb_count = QUICK_UWB_RUNS if quick else UWB_RUNS
    tasks += [
        Task(key=("uwb", bias), work=partial(uwb.experiment, bias, seed, uwb_count), weight=0.5) for bias in uwb.BIASES
    ]
    done = run_tasks(tasks, jobs, progress)
    found = {kind: {key[1]: value for key, value in done.items() if key[0] == kind} for kind in {k[0] for k in done}}
    return Study(
        seed=seed, quick=quick, runs=count, results=found["cell"], traces=found["trace"], offsets=found["line"],
        manoeuvres=found["manoeuvre"], uwb=found["uwb"],
    )  # fmt: skip


def keys() -> list[Key]:
    """All cells: both steps, table 2's speeds at the middle variance, table 3's variances at 1 m/s."""
    conditions = [(SPEEDS[0], v) for v in VARIANCES] + [(SPEEDS[1], MIDDLE)]
    return [Key(step, speed, v, f) for step in STEPS for speed, v in conditions for f in FORMATIONS]


def filters(key: Key) -> tuple[str, ...]:
    """Those that run in a cell: all at the middle variance, else the paper's."""
    return FILTERS if key.variance == MIDDLE else ("ekf",)


def case(key: Key) -> Case:
    """The formation of a cell."""
    leaders = FORMATIONS[key.formation]
    return Case(leaders=leaders, speed=key.speed, variance=key.variance, step=key.step, duration=DURATION)


def cell(key: Key, seed: int, count: int) -> dict[str, Result]:
    """Every filter in a cell, over the same noise as in all cells of that step."""
    this = case(key)
    noise = runs.noise(seed, count, this.steps, len(this.leaders))
    found = {}
    for name in filters(key):
        tracks = runs.follow(this, noise, name)
        mean, half = runs.interval(runs.a_rms(tracks))
        rms = math.sqrt(float((tracks.errors**2).sum(axis=-1).mean()))
        found[name] = Result(mean, half, rms, float(tracks.nees.mean()))
    return found


def trace(formation: int, seed: int) -> Trace:
    """The extended filter in one run of a formation."""
    this = case(Key(STEPS[0], SPEEDS[0], MIDDLE, formation))
    errors = runs.follow(this, runs.noise(seed, 1, this.steps, len(this.leaders)), "ekf").errors[:, 0]
    away = errors[:, None, :] - this.leaders
    theta = np.arctan2(away[..., 1], away[..., 0])
    first, second = np.triu_indices(len(this.leaders), 1)
    s1 = (np.sin(theta[:, first] - theta[:, second]) ** 2).sum(axis=1)
    return Trace(this.step * np.arange(1.0, this.steps + 1), errors, s1)


def steady_bound(key: Key) -> float:
    """Least rms error of a cell in steady motion [m]; infinite on the leaders' line."""
    place, u = np.zeros(2), (key.speed, 0.0)
    return bounds.steady_rms(
        place, FORMATIONS[key.formation], math.sqrt(key.variance), DeadReckoning(NOISE), u, key.step
    )
