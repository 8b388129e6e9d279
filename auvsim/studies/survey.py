"""Surveys by sonar: errors over the lanes with and without loop closures, beside dead reckoning's on equal readings.

The shipped scenario `survey`, steered by its own estimator, with closures. Dead reckoning and the sonar without them
are given the same readings beside it. No frame shows where the dive began or a turn of the whole path, so each is also
judged from the dive point on, as it is believed at the time (what is learnt later of the DVL moves it too),
after the rotation about it that brings the path closest to the true one.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from auvsim.base.errors import AuvsimError
from auvsim.base.frames import Array
from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.missions.survey.mission import HOME, LANES
from auvsim.navigation import registry
from auvsim.navigation.estimate import Estimate
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.run import Simulation
from auvsim.simulation.setups import navigator_setup
from estimators.map_path.poses import rotation_to, turned

RECKONING, OPEN, CLOSED, WHOLE = "dead reckoning", "sonar, no closures", "sonar", "sonar, path at the end"
FIXED = "sonar, path after a second fix"
PINNED = {"vehicles": {"remus100": {"mission": {"second_fix": True}}}}
# Without closures frames that leave the window are of no use, and all of them would be kept in the state.
BESIDE: Mapping[str, Mapping[str, Any]] = {RECKONING: {"match": False}, OPEN: {"closures": False, "keyframes": 1000}}


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    trials: int = 8
    """Missions."""
    seed: int = 30
    """Seed of every random number."""
    jobs: int | None = None
    """Processes; by default one for each core."""
    second_fix: bool = False
    """Surfaces again for a fix after the lanes; the path after it is one more row of errors."""


class Errors(NamedTuple):
    """Of one estimator over the lanes of one mission."""

    raw: float  # horizontal, rms [m]
    turned: float  # the same from the dive point on, after the rotation about it [m]
    nees: float  # of the horizontal position, over 2


class Trial(NamedTuple):
    """What one mission came to."""

    errors: dict[str, Errors]  # by estimator
    floor: float  # the compass' constant error times the distance from the dive point, rms [m]
    closures: int  # believed on the lanes
    docked: bool


class Shown(NamedTuple):
    """What an estimator believes at a time."""

    place: Array  # (2,)
    covariance: Array  # (2, 2)
    dive: Array | None  # (2,) where the dive began; None if it does not keep that


class Beside:
    """A navigator, with others that are given the same."""

    def __init__(self, first: Any, others: Mapping[str, Any]) -> None:
        self.first, self.others, self.states = first, others, first.states
        self.latest: dict[str, Estimate] = {}

    def update(self, *arguments: Any) -> Estimate:
        """The first one's estimate; those of all are in `latest`."""
        found = self.first.update(*arguments)
        self.latest = {CLOSED: found, **{name: other.update(*arguments) for name, other in self.others.items()}}
        return found

    def reset(self) -> None:
        """Forgets everything."""
        for navigator in (self.first, *self.others.values()):
            navigator.reset()


def run_one(seed: int, trial: int, pinned: Mapping[str, Any] | None = None) -> Trial:
    """Runs one mission.

    Args:
        seed: of all random streams.
        trial: number of the mission under that seed.
        pinned: values of the scenario on top of its own.
    """
    scenario = load_scenario("survey", **(pinned or {}))
    simulation = Simulation(scenario, seed, trial, record=False)
    (agent,) = simulation.agents
    assumed = scenario.vehicles[agent.name].estimator
    others = {
        name: registry.build(
            navigator_setup(scenario, agent.name, agent.vehicle, assumed.model_copy(update=dict(changed)))
        )
        for name, changed in BESIDE.items()
    }
    sonar: Any = agent.navigator
    agent.navigator = beside = Beside(sonar, others)
    (bias,) = (s.heading_bias for s, _, _ in agent.sensors if hasattr(s, "heading_bias"))
    true: list[tuple[float, int, Array]] = []  # time, phase, place
    shown: dict[str, list[Shown]] = {name: [] for name in (CLOSED, *BESIDE)}
    kept: dict[str, Any] = {}  # the path, and the pose where the dive began, at the end of the lanes and after a fix
    closures = 0
    last = math.ceil(scenario.duration * scenario.rates.control - 1e-6)
    while simulation.ticks < last and not simulation.over:
        before = agent.estimate
        simulation.step()
        phase = agent.mission.phase
        if agent.estimate is not before and agent.estimate.initialised and phase <= LANES:
            true.append((simulation.time, phase, simulation.truths[agent.name].position[:2].copy()))
            for name, e in beside.latest.items():
                navigator: Any = sonar if name == CLOSED else others[name]
                dive = None if navigator.dive is None else navigator.dive[1][:2].copy()
                shown[name].append(Shown(e.position[:2].copy(), e.horizontal_covariance.copy(), dive))
        elif phase > LANES and WHOLE not in kept:
            kept[WHOLE], closures = (sonar.path, sonar.dive[1]), sonar.closed
        elif phase == HOME and FIXED not in kept and agent.mission.fixed_again:
            kept[FIXED] = sonar.path, sonar.dive[1]  # before any fix by the dock
    if sonar.dive is None or not any(phase == LANES for _, phase, _ in true):
        raise AuvsimError(f"survey, seed {seed}, trial {trial}: ended before the lanes, at {simulation.time:g} s")
    if WHOLE not in kept:
        kept[WHOLE], closures = (sonar.path, sonar.dive[1]), sonar.closed
    stamp = sonar.dive[0]
    times, places = np.array([t for t, _, _ in true]), np.array([place for _, _, place in true])
    dived, on_lanes = int(np.argmin(np.abs(times - stamp))), np.array([phase == LANES for _, phase, _ in true])
    at = places[dived]
    errors = {
        name: judged(
            np.array([own.place for own, on in zip(rows, on_lanes, strict=True) if on]),
            np.array([own.covariance for own, on in zip(rows, on_lanes, strict=True) if on]),
            places[on_lanes],
            np.array([rows[dived].place if own.dive is None else own.dive
                      for own, on in zip(rows, on_lanes, strict=True) if on]),
            at,
        )
        for name, rows in shown.items()
    }  # fmt: skip
    lanes = times[on_lanes]
    for name, ((stamps, poses, _), dive) in kept.items():
        there = (stamps >= lanes[0]) & (stamps <= lanes[-1])
        truth = np.column_stack([np.interp(stamps[there], times, places[:, k]) for k in range(2)])
        errors[name] = judged(poses[there, :2], None, truth, dive[:2], at)
    floor = abs(float(bias)) * rms(places[on_lanes] - at)
    return Trial(errors, floor, closures, agent.mission.at_rest)


def judged(path: Array, covariances: Array | None, true: Array, believed: Array, at: Array) -> Errors:
    """Errors of a path (n, 2) with covariances (n, 2, 2), whose NEES is NaN without, against the true one (n, 2).

    The dive began where the estimator believed, (2,) or as it came to believe in time (n, 2), in truth `at` (2,).
    """
    off = path - true
    nees = math.nan
    if covariances is not None:
        nees = float(np.einsum("ki,ki->k", off, np.linalg.solve(covariances, off[..., None])[..., 0]).mean()) / 2.0
    p, q = path - believed, true - at
    return Errors(rms(off), rms(turned(p, rotation_to(p, q)) - q), nees)


def rms(off: Array) -> float:
    """Root of the mean square of the lengths of vectors (n, 2)."""
    return math.sqrt(float((off**2).sum(axis=1).mean()))


def report(options: Options, progress: Progress | None = None) -> Sequence[RenderableType]:
    """Runs the study and returns its table."""
    pinned = PINNED if options.second_fix else None
    tasks = [Task(key=(k,), work=partial(run_one, options.seed, k, pinned)) for k in range(options.trials)]
    done = run_tasks(tasks, options.jobs, progress)
    trials = [done[k,] for k in range(options.trials)]
    return [turned_table(trials, options), raw_table(trials, options)]


def turned_table(trials: Sequence[Trial], options: Options) -> Table:
    """A row a mission and one of all: errors from the dive point on after the rotation about it, and what it led to."""
    return _table(
        trials,
        Table(
            title=f"survey, seed {options.seed}: rms over the lanes after the rotation about the dive point, in m",
            caption="path: of the keyframes when the lanes are done"
            + ("; fix: that path after a second fix" if options.second_fix else ""),
        ),
        ("dead reckoning", "no closures", "sonar", "path", *_fixed(options), "sonar / d. r.", "path / d. r.",
         "closures", "docked"),
        partial(_turned, names=_names(options)),
    )  # fmt: skip


def raw_table(trials: Sequence[Trial], options: Options) -> Table:
    """A row a mission and one of all: errors as they are, their floor, and NEES."""
    return _table(
        trials,
        Table(
            title="the same without that rotation, in m, and mean NEES of the position per degree of freedom",
            caption="floor: the compass' constant error times the distance from the dive point",
        ),
        ("dead reckoning", "no closures", "sonar", "path", *_fixed(options), "floor", "NEES d. r.", "NEES no closures",
         "NEES sonar"),
        partial(_raw, names=_names(options)),
    )  # fmt: skip


def _fixed(options: Options) -> tuple[str, ...]:
    return ("fix",) if options.second_fix else ()


def _names(options: Options) -> tuple[str, ...]:
    return (RECKONING, OPEN, CLOSED, WHOLE, *((FIXED,) if options.second_fix else ()))


def _table(
    trials: Sequence[Trial], shown: Table, headings: Sequence[str], cells: Callable[[Sequence[Trial]], Sequence[str]]
) -> Table:
    for heading in ("trial", *headings):
        shown.add_column(heading, justify="right")
    for k, trial in enumerate(trials):
        shown.add_row(str(k), *cells([trial]))
    shown.add_section()
    shown.add_row("all", *cells(trials))
    return shown


def _turned(trials: Sequence[Trial], names: Sequence[str]) -> list[str]:
    """Rms over missions of errors, their ratios, the mean number of closures, and how many docked."""
    values = _together(trials, names, "turned")
    numbers = [f"{value:.2f}" for value in (*values, values[2] / values[0], values[3] / values[0])]
    docked = sum(t.docked for t in trials)
    said = f"{docked} of {len(trials)}" if len(trials) > 1 else ("yes" if docked else "no")
    return [*numbers, f"{np.mean([t.closures for t in trials]):.0f}", said]


def _raw(trials: Sequence[Trial], names: Sequence[str]) -> list[str]:
    """Rms over missions of errors and of their floor, and mean NEES."""
    nees = [float(np.mean([t.errors[name].nees for t in trials])) for name in names[:3]]
    values = (*_together(trials, names, "raw"), _root([t.floor for t in trials]), *nees)
    return [f"{value:.2f}" for value in values]


def _together(trials: Sequence[Trial], names: Sequence[str], field: str) -> list[float]:
    return [_root([getattr(t.errors[n], field) if n in t.errors else math.nan for t in trials]) for n in names]


def _root(values: Sequence[float]) -> float:
    return math.sqrt(float(np.mean(np.square(values))))
