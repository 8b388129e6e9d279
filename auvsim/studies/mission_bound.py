"""Missions in MuJoCo against the map of their Cramér-Rao bound: rms errors where the leader starts at stations of it.

The shipped scenario `leader_follower`, shortened, with paper 2's bank of filters and states for the clocks; each run
draws its current and the error of the follower's assumed start as the filter expects them. Blind stations are run,
too: far off, where packets are lost and bearings hardly change, and beside a leader on the follower's own course.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from auvsim.analysis.mission_bounds import FollowerBound, mission_bounds
from auvsim.analysis.statistics import bootstrap
from auvsim.base.frames import Array
from auvsim.base.randomness import stream
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.data.log import VehicleLog
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.run import run
from auvsim.simulation.scenario import Scenario
from estimators.core.consistency import normalised_square

START, CURRENT = 3.0, 0.5  # errors of the follower's assumed start [m] and current [m/s], sd along each axis
ENDS = 10.0  # from the end of the tracks to that of the run [s]
CLOCKS = {"clock_offset": 1e-4, "clock_drift_ppm": 0.02}  # the scenario's
ESTIMATOR = {"kind": "motion_radius", "position": START, "current": CURRENT, **CLOCKS}
NEAR, FAR = (800.0, 41), (12_000.0, 25)  # width [m] of maps and stations along their axes


class Station(NamedTuple):
    """Where the leader starts from the follower's start, and what is special there."""

    north: float  # [m]
    east: float  # [m]
    title: str = "weaves"
    straight: bool = False  # whether both hold one course
    map: tuple[float, int] = NEAR


STATIONS = (
    Station(-100.0, 0.0),
    Station(80.0, -80.0),
    Station(0.0, 200.0),
    Station(240.0, -200.0),
    Station(-260.0, 160.0),
    Station(0.0, 5000.0, "far off", map=FAR),
    Station(-100.0, 0.0, "one course", straight=True),
)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    trials: int = 24
    """Runs at each station."""
    duration: float = 600.0
    """Duration of a run [s]."""
    seed: int = 31
    """Seed of every random number."""
    jobs: int | None = None
    """Processes; by default one for each core."""


class Found(NamedTuple):
    """Error and consistency of a run, over the times that the bound counts."""

    square: float  # mean squared error of the position [m2]
    nees: float  # mean of it, per degree of freedom


def plan(station: Station, duration: float, error: Sequence[float] = (0.0, 0.0), water: Any = None) -> Scenario:
    """The scenario with the leader at a station, a follower that takes its start to be elsewhere, another current."""
    own = load_scenario("leader_follower").start_position("follower")
    course: dict[str, Any] = {"pattern": {"amplitude_deg": 0.0}} if station.straight else {}
    mission = {"lasts": duration - ENDS, **course}
    assumed = {"north": own[0] + error[0], "east": own[1] + error[1]}
    start = {"heading_deg": 8.0} if station.straight else {}
    return load_scenario(
        "leader_follower", duration=duration, water=water or {},
        vehicles={
            "leader": {"start": {"north": own[0] + station.north, "east": own[1] + station.east}, "mission": mission},
            "follower": {"start": start, "mission": mission, "estimator": {**ESTIMATOR, **assumed}},
        },
    )  # fmt: skip


class AtStation(NamedTuple):
    """What the map says of a station."""

    bound: float  # least rms error to first order [m]
    expected: float  # rms error to expect [m]
    rank: int
    after: float  # from when on they count [s]


def bound_at(station: Station, duration: float) -> AtStation:
    """What the map says."""
    span, side = station.map
    found: FollowerBound = mission_bounds(plan(station, duration), moved="leader", span=span, side=side)[0]
    i, j = (int(np.abs(axis - at).argmin()) for axis, at in zip((found.north, found.east), found.start, strict=True))
    return AtStation(float(found.settled[i, j]), float(found.expected[i, j]), int(found.rank[i, j]), found.after)


def run_one(station: Station, duration: float, seed: int, trial: int) -> Found:
    """One run; the same trial has the same noises, current and start at each station."""
    draws = stream(seed, trial, "mission bound study")
    error, (north, east) = (START * draws.standard_normal(2)).tolist(), (CURRENT * draws.standard_normal(2)).tolist()
    current = {
        "kind": "uniform",
        "speed": math.hypot(north, east),
        "direction_deg": math.degrees(math.atan2(east, north)),
    }
    log = run(plan(station, duration, error, {"current": current}), seed=seed, trial=trial)
    errors, P = errors_of(log.vehicle("follower"), (duration - ENDS) / 3.0)
    return Found(float((errors**2).sum(axis=1).mean()), float(normalised_square(errors, P).mean()) / 2.0)


def errors_of(log: VehicleLog, since: float) -> tuple[Array, Array]:
    """Errors (k, 2) [m] of a vehicle's estimated position and their covariances (k, 2, 2), from a time on [s]."""
    estimate, truth = log["estimate"], log["truth"]
    late = estimate["time"] >= since
    times = estimate["time"][late]
    there = np.column_stack([np.interp(times, truth["time"], truth["position"][:, k]) for k in range(2)])
    return estimate["position"][late, :2] - there, estimate["covariance"][late, :2, :2]


def report(options: Options, progress: Progress | None = None) -> Sequence[RenderableType]:
    """Runs the study and returns its table."""
    tasks = [Task(key=("bound", s), work=partial(bound_at, s, options.duration), weight=4.0) for s in STATIONS]
    for s in STATIONS:
        for k in range(options.trials):
            tasks.append(Task(key=(s, k), work=partial(run_one, s, options.duration, options.seed, k)))
    return [table(run_tasks(tasks, options.jobs, progress), options)]


def table(done: Mapping[tuple, Any], options: Options) -> Table:
    """One line a station: bound, error to expect, rms error over the runs, its ratio with interval, and NEES."""
    lines = Table(
        title=f"{options.trials} runs of {options.duration:g} s at each station, seed {options.seed}: the follower's "
        f"position from {(options.duration - ENDS) / 3.0:.0f} s on"
    )
    headings = (
        "leader starts [m]",
        "courses",
        "rank",
        "bound [m]",
        "to expect [m]",
        "rms [m]",
        "rms / to expect (95 %)",
        "NEES",
    )
    for heading in headings:
        lines.add_column(heading, justify="left" if heading in ("leader starts [m]", "courses") else "right")
    for row in rows(done, options):
        lines.add_row(*row)
    return lines


def rows(done: Mapping[tuple, Any], options: Options) -> Iterator[tuple[str, ...]]:
    """The cells of the lines."""
    for s in STATIONS:
        bound, least, rank, _ = done["bound", s]
        found = [done[s, k] for k in range(options.trials)]
        squares = np.array([f.square for f in found])
        rms = math.sqrt(squares.mean())
        ratio = f"{rms / least:.2f}"
        if options.trials > 1:
            low, high = (math.sqrt(max(0.0, x)) / least for x in bootstrap(squares))
            ratio += f" ({low:.2f} to {high:.2f})"
        yield (
            f"{s.north:+.0f} N, {s.east:+.0f} E", s.title, f"{rank} of 4", f"{bound:.2f}", f"{least:.2f}", f"{rms:.2f}",
            ratio, f"{np.mean([f.nees for f in found]):.2f}",
        )  # fmt: skip
