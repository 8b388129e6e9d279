"""The study of paper 2: its rows as data, and all of it on all cores, on planar truth and on MuJoCo's."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.reproduce.paper2.filters import METHODS, SWEEP, TIMES, follow, prior
from auvsim.reproduce.paper2.runs import (
    CYCLE,
    CYCLES,
    NOISES,
    SOUND_SPEED,
    Conditions,
    Errors,
    Motion,
    Run,
    measured,
    planar_motion,
    simulate,
)
from auvsim.reproduce.paper2.scores import SETTLED, Result, Score, score, summarise
from estimators.core.odometry_bounds import Sights, bounds, displacements_between, sampled
from estimators.core.types import Array

SEEDS_APART = 1_000_000  # more than any row has runs
CHUNK = 10  # runs a task
BOUND_RUNS = 40  # truths, or draws of losses, over which a bound is averaged
MAIN = ("reckoning", "paper", "paper_c", "paper_small", "ekf", "bank", "batch")
ROBUST = ("paper", "ekf", "bank")
LOSSES = (0.0, 0.2, 0.4, 0.6)


NOMINAL = Conditions()


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """Runs of one kind, and who follows them."""

    title: str
    conditions: Conditions = NOMINAL
    methods: tuple[str, ...]
    runs: int = 60
    quick_runs: int = 10


ROWS = {
    **{
        noise: Row(title=f"weave, {noise}", conditions=Conditions(noise=noise), methods=MAIN, runs=300, quick_runs=30)
        for noise in ("nominal", "coarse", "matched")
    },
    "clean": Row(title="weave, no noise", conditions=Conditions(noise="clean"), methods=("paper", "paper_c"), runs=1,
                 quick_runs=1),
    "terms": Row(title="weave, nominal, N + 1 terms", methods=("paper_nine",)),
    **{
        tracks: Row(title=f"{title}, nominal", conditions=Conditions(tracks=tracks), methods=("reckoning", *ROBUST))
        for tracks, title in (
            ("leaderweave", "the leader weaves"), ("followerweave", "the follower weaves"),
            ("close", "close (60 m)"), ("far", "far (500 m)"), ("parallel", "parallel"), ("oblique", "oblique"),
        )
    },
    **{
        f"loss_{100 * loss:.0f}": Row(title=f"weave, nominal, {loss:.0%} lost", conditions=Conditions(loss=loss),
                                      methods=ROBUST)
        for loss in LOSSES
    },
    "p1": Row(title="weave, nominal, P1 swept", methods=tuple(f"p1_{k}" for k in range(len(SWEEP)))),
    **{
        f"turn_{degrees}": Row(title=f"current turns by {degrees} deg", methods=(*ROBUST, "bank_walk"),
                               conditions=Conditions(turn=math.radians(degrees)))
        for degrees in (5, 45)
    },
    "held": Row(title="the leader holds its course over ground", methods=ROBUST,
                conditions=Conditions(shear=(-0.5, -0.5))),
}  # fmt: skip

ERRORS = {
    "none": (Errors(), {}),
    "compass": (Errors(compass_bias=math.radians(2.0)), {"compass_bias": math.radians(2.0)}),
    "speed": (Errors(speed_scale=0.03), {"speed_scale": 0.03}),
    "sound": (Errors(sound_speed=0.01), {"range_scale": 0.01}),
    "clock": (Errors(clock_drift=1e-6), {"range_offset": 0.1, "range_drift": 1e-6 * SOUND_SPEED}),
}
TOGETHER = (
    Errors(*np.sum([errors for errors, _ in ERRORS.values()], axis=0).tolist()),
    {name: deviation for _, states in ERRORS.values() for name, deviation in states.items()},
)
PHYSICAL = {**ERRORS, "together": TOGETHER}  # by row: what is wrong, and deviations of the states that answer it
PHYSICAL_TITLES = {
    "none": "nothing wrong", "compass": "compass bias 2 deg", "speed": "speed scale 3 %", "sound": "sound speed +1 %",
    "clock": "clock 1 ppm", "together": "all together",
}  # fmt: skip
PHYSICAL_NOISE = replace(NOISES["nominal"], sway=0.02)
PHYSICAL_RUNS = 300
MOTIONS, QUICK_MOTIONS = 10, 2  # ways of the vehicle, among which the runs are shared out
QUICK_PHYSICAL_RUNS = 20


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """Results of the study."""

    seed: int
    quick: bool
    results: Mapping[str, Mapping[str, Result]] = field(default_factory=dict)  # by row and filter
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # by row: rms after 500 s, at the end [m]
    physical: Mapping[str, Mapping[str, Result]] = field(default_factory=dict)
    physical_bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def reproduce(
    seed: int = 0,
    *,
    quick: bool = False,
    jobs: int | None = None,
    planar: bool = True,
    mujoco: bool = True,
    progress: Progress | None = None,
) -> Study:
    """Runs the study in processes of their own; its outcome does not depend on how many.

    Args:
        seed: Of all runs, 0 or more.
        quick: Few runs a row: a first look, with wide intervals.
        jobs: Processes; all cores if None.
        planar: Whether the rows on planar truth are run.
        mujoco: Whether those on MuJoCo's truth are.
        progress: Called with what is done and the total of it.
    """
    counts = {name: row.quick_runs if quick else row.runs for name, row in ROWS.items()} if planar else {}
    tasks = [task for name, count in counts.items() for task in _planar_tasks(name, count, seed)]
    if mujoco:
        tasks += _physical_tasks(seed, quick)
    done = run_tasks(tasks, jobs, progress)
    chunks = [value for key, value in done.items() if key[0] == "physical"]
    return Study(
        seed=seed,
        quick=quick,
        results={name: _joined([v for key, v in done.items() if key[:2] == ("scores", name)]) for name in counts},
        bounds={name: done["bound", name] for name in counts if name != "clean"},
        physical={row: _joined([chunk[0][row] for chunk in chunks]) for row in PHYSICAL} if mujoco else {},
        physical_bounds={
            row: (rms([c[1][row][0] for c in chunks]), rms([c[1][row][1] for c in chunks])) for row in PHYSICAL
        } if mujoco else {},
    )  # fmt: skip


def _joined(chunks: list[Mapping[str, list[Score]]]) -> dict[str, Result]:
    return {key: summarise([s for chunk in chunks for s in chunk[key]]) for key in chunks[0]}


def _planar_tasks(name: str, count: int, seed: int) -> list[Task]:
    seeds = [SEEDS_APART * seed + k for k in range(count)]
    chunks = [seeds[k : k + CHUNK] for k in range(0, count, CHUNK)]
    methods = len(ROWS[name].methods)
    tasks = [
        Task(key=("scores", name, k), work=partial(planar_scores, name, chunk), weight=len(chunk) * methods)
        for k, chunk in enumerate(chunks)
    ]
    if name != "clean":
        tasks.append(Task(key=("bound", name), work=partial(planar_bound, name, seeds[:BOUND_RUNS]), weight=20.0))
    return tasks


def planar_scores(name: str, seeds: list[int]) -> dict[str, list[Score]]:
    """Scores by filter, of a row's runs."""
    row = ROWS[name]
    runs = [simulate(row.conditions, seed) for seed in seeds]
    return {key: [score(run, follow(run, METHODS[key])) for run in runs] for key in row.methods}


def planar_bound(name: str, seeds: list[int]) -> tuple[float, float]:
    """Rms of the posterior Cramér-Rao bound after 500 s and at the end, of a row."""
    conditions = ROWS[name].conditions
    runs = [simulate(conditions, seed) for seed in seeds]
    return run_bound(planar_motion(conditions), runs, {})


def run_bound(motion: Motion, runs: list[Run], extra: Mapping[str, float]) -> tuple[float, float]:
    """Rms of the bound, its information averaged over the runs' truths and its covariance over their losses."""
    noise, ends = runs[0].noise, CYCLE * np.arange(CYCLES + 1)
    rows = displacements_between(sampled(motion.through_water, 1.0, noise.odometry), ends)
    heard = np.array([[second in run.packets for second in ends.tolist()] for run in runs])
    arrivals = np.unique(np.where(heard, ends.astype(float), np.inf), axis=0)
    below = np.zeros(CYCLES + 1)
    relative = np.array([np.column_stack(((run.truth[:, :2] - run.leader)[ends], below)) for run in runs])
    variance = np.full(CYCLES + 1, noise.range**2 + noise.leader**2)
    sights = Sights(ends.astype(float), rows, variance, np.full(CYCLES + 1, np.inf), arrivals)
    found = bounds(prior(noise, extra).covariance, sights, relative[None], np.arange(1, CYCLES + 1))[0]
    square = found[:, 0, 0] + found[:, 1, 1]
    return math.sqrt(square[TIMES > SETTLED].mean()), math.sqrt(square[-1])


def _physical_tasks(seed: int, quick: bool) -> list[Task]:
    motions, runs = (QUICK_MOTIONS, QUICK_PHYSICAL_RUNS) if quick else (MOTIONS, PHYSICAL_RUNS)
    share = runs // motions
    return [
        Task(key=("physical", k), work=partial(physical_scores, SEEDS_APART * seed + k, share), weight=40.0 * share)
        for k in range(motions)
    ]


def physical_scores(seed: int, count: int) -> tuple[dict[str, dict[str, list[Score]]], dict[str, tuple[float, float]]]:
    """Scores by row and filter, and bounds by row, of runs that share one way of the vehicle in MuJoCo.

    `bank` knows nothing of what is wrong; `states` has a state for it, `all` for everything that may be.
    """
    from auvsim.reproduce.paper2.physical import motion as physical_motion

    motion = physical_motion(seed)
    seeds = [SEEDS_APART // 2 + count * seed + k for k in range(count)]
    scores: dict[str, dict[str, list[Score]]] = {}
    limits = {}
    for row, (errors, states) in PHYSICAL.items():
        runs = [measured(motion, PHYSICAL_NOISE, s, errors=errors) for s in seeds]
        followers: dict[str, tuple[str, Mapping[str, float]]] = {
            "reckoning": ("reckoning", {}), "paper": ("paper", {}), "bank": ("bank", {}), "states": ("bank", states),
            "all": ("bank", TOGETHER[1]),
        }  # fmt: skip
        scores[row] = {
            key: [score(run, follow(run, METHODS[method], extra)) for run in runs]
            for key, (method, extra) in followers.items()
        }
        limits[row] = run_bound(motion, runs[:1], states)
    return scores, limits


def rms(values: list[float]) -> float:
    """Root of the mean square."""
    return math.sqrt(float(np.mean(np.square(values))))


def example(seed: int, noise: str = "nominal") -> tuple[Run, dict[str, tuple[Array, Array]]]:
    """The first run of the study and, by filter, its means (k, 4) and deviations (k, 4), for figures 2 to 5."""
    run = simulate(Conditions(noise=noise), SEEDS_APART * seed)
    tracks = {}
    for key in ("reckoning", "paper", "bank"):
        followed = follow(run, METHODS[key])
        spread = np.sqrt(np.diagonal(followed.covariances, axis1=1, axis2=2))
        tracks[key] = (followed.means, spread)
    return run, tracks
