"""Leaders on a line with the follower, and what leads out of it: offsets, with their mirror trap, and manoeuvres."""

import math
from typing import NamedTuple

import numpy as np

from auvsim.reproduce.paper4 import runs
from auvsim.reproduce.paper4.formations import FORMATIONS
from auvsim.reproduce.paper4.runs import Case
from estimators.formation import bounds, manoeuvres
from estimators.formation.manoeuvres import Manoeuvre
from estimators.formation.models import DeadReckoning

FORMATION = 8  # on a line, 100 m away
OFFSETS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # of the leaders from the follower's line [m]
SIDES = {"alternate sides": manoeuvres.stagger, "one side": manoeuvres.aside}
SPEED, VARIANCE, DURATION = 1.0, 4.0, 1000.0
SETTLED = 200.0  # errors are counted from then on [s]
MANOEUVRES = ("hold", "stagger 5 m", "stagger 50 m", "weave 30 m", "line turns")
FILTERS = ("ekf", "second_order", "smooth")


class Trap(NamedTuple):
    """What a filter makes of it."""

    rms: float  # [m]
    nees: float  # of the position, over 2
    mirrored: float  # share of time nearer to the mirror image of the truth than to it, by more than 3 m
    claimed: float  # rms that the filter's covariance claims [m]
    bound: float  # least rms error where leaders keep their places [m]


def trapped(sides: str, offset: float, seed: int, count: int) -> Trap:
    """The extended filter with leaders off their line, to the SIDES named, starting 3 m off at random."""
    leaders = SIDES[sides](FORMATIONS[FORMATION], offset)(0.0)
    return _judged(manoeuvres.hold(leaders), leaders, "ekf", seed, count)


def compared(name: str, seed: int, count: int) -> dict[str, Trap]:
    """Filters in a manoeuvre."""
    leaders = FORMATIONS[FORMATION]
    return {key: _judged(manoeuvre(name), leaders, key, seed, count) for key in FILTERS}


def manoeuvre(name: str) -> Manoeuvre:
    """A manoeuvre of MANOEUVRES."""
    leaders = FORMATIONS[FORMATION]
    return {
        "hold": manoeuvres.hold(leaders),
        "stagger 5 m": manoeuvres.stagger(leaders, 5.0),
        "stagger 50 m": manoeuvres.stagger(leaders, 50.0),
        "weave 30 m": manoeuvres.weave(leaders, 30.0, 400.0),
        "line turns": manoeuvres.rotating_line(leaders, 2.0 * math.pi / 2000.0),
    }[name]


def _judged(way: Manoeuvre, leaders: np.ndarray, name: str, seed: int, count: int) -> Trap:
    case = Case(leaders=leaders, speed=SPEED, variance=VARIANCE, duration=DURATION)
    noise = runs.noise(seed, count, case.steps, len(leaders))
    tracks = runs.follow(case, noise, name, manoeuvre=way, start_errors=start_errors(seed, count))
    first = round(SETTLED / case.step)
    errors, nees = tracks.errors[first:], tracks.nees[first:]
    times = case.step * np.arange(first + 1, case.steps + 1)
    mirrors = np.array([manoeuvres.mirrored(np.zeros(2), way(time)) for time in times])
    nearer = np.linalg.norm(errors, axis=-1) - np.linalg.norm(errors - mirrors[:, None], axis=-1) > 3.0
    bound = bounds.steady_rms(np.zeros(2), way(0.0), math.sqrt(VARIANCE), DeadReckoning(), (SPEED, 0.0), case.step)
    rms = math.sqrt(float((errors**2).sum(axis=-1).mean()))
    claimed = math.sqrt(float(tracks.variances[first:].mean()))
    return Trap(rms, float(nees.mean()), float(nearer.mean()), claimed, bound)


def start_errors(seed: int, count: int) -> np.ndarray:
    """Errors (count, 2) of the first belief, 3 m north or south [m]."""
    signs = np.where(np.random.default_rng((seed, 41)).uniform(size=count) < 0.5, -1.0, 1.0)
    return np.column_stack((3.0 * signs, np.zeros(count)))
