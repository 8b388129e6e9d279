"""A formation of four vehicles in MuJoCo: how well they keep station, and what the shape is worth to the follower.

The shipped scenario `formation` in a current of 0.3 m/s of any direction that the follower does not know, with a start
that is wrong by 3 m on each axis. The same trials with leaders at the best bearings, on a line with the follower along
the course, and on that line with a follower that may move 60 m and chooses its station by the bound.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from auvsim.analysis.statistics import bootstrap_rms_ratio
from auvsim.base.randomness import stream
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.data.log import VehicleLog
from auvsim.missions.formation.metrics import SETTLED, formation_metrics
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.run import run

LEADERS = ("leader_1", "leader_2", "leader_3")
LINE = {"leader_1": (150.0, 0.0), "leader_2": (-150.0, 0.0), "leader_3": (90.0, 0.0)}  # ahead, starboard [m]
REACH = 60.0  # of a follower that chooses [m]
SHAPES = ("optimum", "line", "line, follower chooses")
CURRENT, START = 0.3, 3.0  # [m/s], error of the start, sd on each axis [m]


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    trials: int = 40
    """Trials of each shape."""
    duration: float = 300.0
    """Duration of a trial [s]."""
    seed: int = 20
    """Seed of every random number."""
    jobs: int | None = None
    """Processes; by default one for each core."""


class Trial(NamedTuple):
    """What one trial came to."""

    station: dict[str, float]  # true distance from the station, rms, by vehicle [m]
    position: float  # error of the follower's estimate, rms [m]
    nees: float  # of it, over 2
    contacts: int  # that the log has of vehicles


def run_one(shape: str, seed: int, trial: int, duration: float) -> Trial:
    """Runs one trial; all shapes have the same current, start and noises."""
    log = run(load_scenario("formation", **pinned(shape, seed, trial, duration)), seed=seed, trial=trial)
    found = {name: formation_metrics(log.vehicle(name))["station_rms"] for name in (*LEADERS, "follower")}
    station = {name: math.nan if value is None else float(value) for name, value in found.items()}
    position, nees = position_error(log.vehicle("follower"))
    contacts = sum(len(log.vehicle(name)["contact"]["time"]) for name in (*LEADERS, "follower"))
    return Trial(station, position, nees, contacts)


def pinned(shape: str, seed: int, trial: int, duration: float) -> dict[str, Any]:
    """What a trial has in place of the scenario's values."""
    rng = stream(seed, trial, "formation study")
    direction = float(rng.uniform(0.0, 360.0))
    north, east = (START * rng.standard_normal(2)).tolist()
    vehicles: dict[str, Any] = {
        "follower": {
            "start": {"north": north, "east": east},
            "estimator": {"north": 0.0, "east": 0.0},
            "mission": {"follow": {"reach": REACH if shape == SHAPES[2] else 0.0}},
        }
    }
    if shape != SHAPES[0]:
        for name, (ahead, starboard) in LINE.items():
            place = {"north": ahead, "east": starboard}
            vehicles[name] = {"start": place, "mission": {"ahead": ahead, "starboard": starboard}}
    water = {"current": {"kind": "uniform", "speed": CURRENT, "direction_deg": direction}}
    return {"duration": duration, "water": water, "vehicles": vehicles}


def position_error(log: VehicleLog) -> tuple[float, float]:
    """Rms error of a follower's estimated position [m], and its NEES over 2, later than SETTLED."""
    estimate, truth = log["estimate"], log["truth"]
    late = (estimate["time"] >= SETTLED) & (estimate["initialised"] > 0)
    times = estimate["time"][late]
    there = np.column_stack([np.interp(times, truth["time"], truth["position"][:, k]) for k in range(2)])
    error = estimate["position"][late, :2] - there
    P = estimate["covariance"][late, :2, :2]
    nees = np.einsum("ki,ki->k", error, np.linalg.solve(P, error[..., None])[..., 0]) / 2.0
    return math.sqrt(float((error**2).sum(axis=1).mean())), float(nees.mean())


def report(options: Options, progress: Progress | None = None) -> Sequence[RenderableType]:
    """Runs the study and returns its table."""
    tasks = [
        Task(key=(shape, k), work=partial(run_one, shape, options.seed, k, options.duration))
        for shape in SHAPES
        for k in range(options.trials)
    ]
    return [table(run_tasks(tasks, options.jobs, progress), options)]


def table(done: Mapping[tuple, Trial], options: Options) -> Table:
    """One line a shape: rms over trials; the ratio of the follower's error to that on the line, with its interval."""
    lines = Table(
        title=f"formation of four in {CURRENT:g} m/s: {options.trials} paired trials of {options.duration:g} s"
    )
    headings = ("shape", "station, leaders [m]", "station, follower [m]", "trials within 5 m", "position, follower [m]",
                "NEES", "contacts", "position over that on the line")  # fmt: skip
    for heading in headings:
        lines.add_column(heading, justify="left" if heading == "shape" else "right")
    positions = {shape: [done[shape, k].position for k in range(options.trials)] for shape in SHAPES}
    for shape in SHAPES:
        trials = [done[shape, k] for k in range(options.trials)]
        leaders = _rms([t.station[name] for t in trials for name in LEADERS])
        kept = sum(max(t.station.values()) <= 5.0 for t in trials)
        ratio = _rms(positions[shape]) / _rms(positions[SHAPES[1]])
        text = f"{ratio:.2f}"
        if shape != SHAPES[1] and options.trials > 1:
            low, high = interval(positions[shape], positions[SHAPES[1]])
            text += f" ({low:.2f} to {high:.2f})"
        lines.add_row(
            shape, f"{leaders:.2f}", f"{_rms([t.station['follower'] for t in trials]):.2f}",
            f"{kept} of {options.trials}", f"{_rms(positions[shape]):.2f}", f"{np.mean([t.nees for t in trials]):.2f}",
            str(sum(t.contacts for t in trials)), text,
        )  # fmt: skip
    return lines


def interval(above: Sequence[float], below: Sequence[float]) -> tuple[float, float]:
    """95 % bootstrap interval of a ratio of rms values over paired trials."""
    first, second = (np.column_stack((np.ones(len(v)), np.square(v))) for v in (above, below))
    return bootstrap_rms_ratio(first, second)


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))
