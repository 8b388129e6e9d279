"""The study of paper 3: rows of conditions, the methods that follow each, and what becomes of them over paired runs."""

import math
import pickle
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.reproduce.paper3.follow import Track, follow
from auvsim.reproduce.paper3.methods import METHODS
from auvsim.reproduce.paper3.truths import (
    NOISES,
    SCENES,
    SOUND,
    START,
    STEP,
    Conditions,
    Run,
    simulate,
    undelayed,
)
from estimators.core.types import Array
from estimators.path_prediction.bound import Sighting, position_bounds
from estimators.path_prediction.messages import Pulse

PAPER = ("dr", "ekf", "dekf", "iiru")
MAIN = (*PAPER, "sc", "rt", "choosing", "oracle")
ALL = (*MAIN, "ekf_e1", "ekf_e3", "iiru_full", "iiru_reduced")
LATE = ("ekf", "dekf", "iiru", "sc", "rt", "choosing", "oracle")
LOSSES = (0.0, 0.2, 0.4, 0.6)
DELAYS = (1.0, 2.0, 3.0, 5.0, 8.0, 15.0, 30.0, 60.0)
BLOCK = 10  # runs of a task
SETTLED = 200.0  # from then on NEES is averaged [s]
BOUND_RUNS = 20
BOUND_TIMES = tuple(range(100, 1001, 100))


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """One line of the study."""

    title: str
    conditions: Conditions
    methods: tuple[str, ...] = MAIN
    runs: int = 100
    quick_runs: int = 5


def _rows() -> dict[str, Row]:
    rows = {}
    for noise in NOISES:
        for mode in ("process", "sensor"):
            for scene in SCENES:
                conditions = Conditions(scene=scene, mode=mode, noise=noise)
                rows[f"{noise}_{mode}_{scene}"] = Row(
                    title=f"{noise} noise, {mode}, {scene}",
                    conditions=conditions,
                    methods=ALL if scene in ("straight", "weave") else MAIN,
                    runs=200,
                    quick_runs=10,
                )
    sweeps = {
        "fine": Conditions(),
        "paper": Conditions(noise="paper"),
        "turning": Conditions(scene="lweave", mode="sensor"),
    }
    lossy = ("dekf", "iiru", "sc", "sc_plain", "rt", "choosing")
    for name, base in sweeps.items():
        for loss in LOSSES:
            title = f"{base.noise} noise, {base.mode}, {base.scene}, {loss:.0%} of packets lost"
            row = Row(title=title, conditions=replace(base, loss=loss), methods=lossy)
            rows[f"loss_{name}_{loss:.0%}"] = row
    both = replace(Conditions(), loss=0.6, pulse_loss=0.6)
    rows["loss_both"] = Row(
        title="fine noise, process, weave, 60 % of packets and of pulses lost", conditions=both, methods=lossy
    )
    for name in ("fine", "turning"):
        for delay in DELAYS:
            conditions = replace(sweeps[name], delay=delay)
            title = f"fine noise, {conditions.mode}, {conditions.scene}, packets {delay:g} s late"
            rows[f"delay_{name}_{delay:g}"] = Row(title=title, conditions=conditions, methods=LATE)
    rows["shuffled"] = Row(
        title="fine noise, process, weave, packets out of order",
        conditions=Conditions(delay_deviation=6.0),
        methods=LATE,
    )
    rows["accelerating"] = Row(
        title="fine noise, process, the leader's speed varies",
        conditions=Conditions(scene="accelerating", delay=30.0),
        methods=("iiru", "iiru_speed", "sc", "rt", "oracle"),
    )
    usbl = ("sc", "rt", "oracle")
    for scene in ("weave", "inline"):
        for name, ranged, bearing in (("range", True, math.nan), ("bearing", False, 1.0), ("range_bearing", True, 1.0)):
            conditions = Conditions(scene=scene, ranged=ranged, bearing=math.radians(bearing))
            title = f"fine noise, process, {scene}, {name.replace('_', ' and ')}"
            rows[f"usbl_{scene}_{name}"] = Row(title=title, conditions=conditions, methods=usbl)
    for noise in NOISES:
        rows[f"yardsticks_{noise}"] = Row(
            title=f"{noise} noise, process, weave, with yardsticks",
            conditions=Conditions(noise=noise),
            methods=("iiru", "sc", "rt", "choosing", "oracle", "map", "particle"),
            runs=30,
            quick_runs=2,
        )
    for scene in ("weave", "lweave"):
        for name, loss, delay in (("", 0.0, 15.0), ("_60%", 0.6, 15.0), ("_late", 0.0, 60.0)):
            conditions = Conditions(scene=scene, mode="sensor", carried=True, loss=loss, delay=delay)
            title = f"MuJoCo, fine noise, {scene}, {conditions.loss:.0%} lost, packets {conditions.delay:g} s late"
            rows[f"{MUJOCO}{scene}{name}"] = Row(
                title=title, conditions=conditions, methods=MAIN, runs=40, quick_runs=2
            )
    return rows


MUJOCO = "mujoco_"  # begins the names of rows on physical truth
ROWS = _rows()
POOLED = "paper_process_weave"  # the row of tables 2, in which the order of the paper holds
POOLED_RUNS = 250
QUICK_POOLED_RUNS = 40


class Runs(NamedTuple):
    """What one method did in the runs of a row."""

    final: Array  # (n, 2) error of the position at the end, north and east [m]
    squares: Array  # (n, k) squared error along the run [m^2]
    nees: Array  # (n,) of the position, mean after `SETTLED`, per degree of freedom
    final_nees: Array  # (n,)
    relative: Array  # (n, 2) error at the end less that of the leader's place which the method uses [m]
    leader: Array  # (n, 2) that error [m]
    own: Array  # (n, 2) of the leader's own estimate at the end [m]
    cpu: Array  # (n,) [s]
    memory: Array  # (n,) [byte]

    @property
    def rms(self) -> float:
        """Of the position at the end [m]."""
        return root_mean_square(self.final)

    @property
    def signed_mean(self) -> float:
        """Norm of the mean error at the end [m]: what the paper's tables list."""
        return float(np.hypot(*self.final.mean(axis=0)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """Results of the study."""

    seed: int
    quick: bool
    results: Mapping[str, Mapping[str, Runs]]  # by row and method
    bounds: Mapping[str, Array]  # rms [m] of the posterior bound at BOUND_TIMES, by row
    inversions: Mapping[str, int]  # packets that come after a newer one, by row


def reproduce(
    seed: int = 0,
    *,
    quick: bool = False,
    jobs: int | None = None,
    rows: Sequence[str] = tuple(ROWS),
    runs: int | None = None,
    progress: Progress | None = None,
) -> Study:
    """Runs the study in processes of their own; its outcome does not depend on how many.

    Args:
        seed: Of all runs, 0 or more.
        quick: Few runs a row: a first look, with wide intervals.
        jobs: Processes; all cores if None.
        rows: Which of ROWS.
        runs: Of every row, instead of what the row says.
        progress: Called with what is done and the total of it.
    """
    tasks, counts = [], {}
    for name in rows:
        row = ROWS[name]
        counts[name] = runs or (row.quick_runs if quick else row.runs)
        if name == POOLED and runs is None:
            counts[name] = QUICK_POOLED_RUNS if quick else POOLED_RUNS
        for first in range(0, counts[name], BLOCK):
            numbers = range(first, min(first + BLOCK, counts[name]))
            work = partial(block, row.conditions, row.methods, seed, numbers)
            tasks.append(Task(key=("runs", name, first), work=work, weight=len(numbers) * len(row.methods)))
        if "_process_" in name:
            work = partial(bound, row.conditions, seed, 4 if quick else BOUND_RUNS)
            tasks.append(Task(key=("bound", name), work=work, weight=40.0))
    done = run_tasks(tasks, jobs, progress)
    results, inversions = {}, {}
    for name, count in counts.items():
        blocks = [done["runs", name, first] for first in range(0, count, BLOCK)]
        results[name] = {key: joined([b[0][key] for b in blocks]) for key in ROWS[name].methods}
        inversions[name] = sum(b[1] for b in blocks)
    bounds = {key[1]: value for key, value in done.items() if key[0] == "bound"}
    return Study(seed=seed, quick=quick, results=results, bounds=bounds, inversions=inversions)


def block(
    conditions: Conditions, methods: Sequence[str], seed: int, numbers: Sequence[int]
) -> tuple[dict[str, Runs], int]:
    """Some runs of a row by all its methods, and how many packets in them come after a newer one."""
    found: dict[str, list[Runs]] = {key: [] for key in methods}
    inversions = 0
    for number in numbers:
        run = simulate(conditions, seed, number)
        order = [event.number for event in run.events if not isinstance(event, Pulse)]
        inversions += sum(n < max(order[:k], default=-1) for k, n in enumerate(order))
        own = (run.leader_own[-1] - run.leader[-1])[:2]
        for key in methods:
            track, cpu, size = _followed(key, run)
            columns = (
                track.errors[-1],
                (track.errors**2).sum(axis=1),
                track.nees[track.times >= SETTLED].mean(),
                track.nees[-1],
                track.relative[-1],
                track.leader[-1],
                own,
                cpu,
                size,
            )
            found[key].append(Runs(*(np.array([column], dtype=float) for column in columns)))
    return {key: joined(each) for key, each in found.items()}, inversions


def _followed(key: str, run: Run) -> tuple[Track, float, float]:
    """Track of a method, CPU time [s], and size of its state [byte]; NaN of a yardstick."""
    method, began = METHODS[key], time.process_time()
    if method.track is not None:
        return method.track(run), time.process_time() - began, math.nan
    follower = method.make(run)
    began = time.process_time()
    track = follow(follower, undelayed(run) if method.prompt else run)
    return track, time.process_time() - began, len(pickle.dumps(follower))


def joined(parts: Sequence[Runs]) -> Runs:
    """Runs of one method, in order."""
    return Runs(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def bound(conditions: Conditions, seed: int, count: int) -> Array:
    """The posterior bound at BOUND_TIMES, rms [m], over some runs of the row."""
    runs = [simulate(conditions, seed, k) for k in range(count)]
    variance = (SOUND * conditions.detection_deviation) ** 2
    seen = [[Sighting(e.emitted, e.detected, variance) for e in run.events if isinstance(e, Pulse)] for run in runs]
    noise = NOISES[conditions.noise]
    covariances = position_bounds(
        np.array([run.leader for run in runs]),
        np.array([run.follower for run in runs]),
        STEP,
        (noise.leader, noise.follower),
        (START, START),
        seen,
        BOUND_TIMES,
    )
    return np.sqrt(np.trace(covariances, axis1=1, axis2=2))


def root_mean_square(errors: Array) -> float:
    """Of vectors (n, 2)."""
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def ratio(one: Runs, other: Runs, probability: float = 0.95) -> tuple[float, float, float]:
    """Ratio of the rms of two methods in the same runs, with the bounds of its interval by the jackknife.

    The interval is two-sided; its upper bound is passed with half of the rest.
    """
    squares = [np.sum(r.final**2, axis=1) for r in (one, other)]
    n = len(squares[0])
    value = math.sqrt(squares[0].sum() / squares[1].sum())
    if n < 2:
        return value, math.nan, math.nan
    left_out = np.sqrt((squares[0].sum() - squares[0]) / (squares[1].sum() - squares[1]))
    deviation = math.sqrt((n - 1) * float(left_out.var()))
    wide = {0.9: 1.645, 0.95: 1.960}[probability] * deviation
    return value, value - wide, value + wide
