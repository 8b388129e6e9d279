"""Where a follower should stand: what it hears of its leaders, and the station of the least bound."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvsim.acoustics.message import Delivery
from auvsim.acoustics.payload import STATE, StateReport
from auvsim.base.frames import Array
from auvsim.missions.formation.settings import ChoiceSettings
from estimators.formation import placement
from estimators.formation.models import DeadReckoning, InputNoise
from estimators.formation.placement import NOTHING, Reach

HEADING = math.radians(2.0)  # error of the course of dead reckoning that the bound assumes [rad]


class Heard(NamedTuple):
    """The last word of a leader."""

    time: float  # when it came [s]
    report: StateReport


class Choice(NamedTuple):
    """A station, and the least error there."""

    station: Array  # (2,) ahead, starboard of the point [m]
    bound: float  # least rms error of the position in steady motion [m]; infinite if a direction is open


def listen(heard: dict[str, Heard], leaders: Sequence[str], messages: Sequence[Delivery]) -> None:
    """Keeps the last report of each leader."""
    for delivery in messages:
        message = delivery.message
        if message.kind == STATE and message.source in leaders:
            heard[message.source] = Heard(delivery.received, StateReport(*message.payload))


def present(heard: Mapping[str, Heard], time: float, silent: float) -> dict[str, Heard]:
    """The leaders that are not silent, by name, in the order of names."""
    return {name: heard[name] for name in sorted(heard) if time - heard[name].time <= silent}


def stations(leaders: Mapping[str, Heard], point: Array, velocity: Array, time: float) -> Array:
    """Where leaders are about the moving point now (n, 2), ahead and starboard [m], by their last words."""
    course = velocity / np.linalg.norm(velocity)
    to_ahead = np.array([course, (-course[1], course[0])])
    found = []
    for word in leaders.values():
        r, age = word.report, time - word.time
        place = np.array([r.north + r.speed_north * age, r.east + r.speed_east * age])
        found.append(to_ahead @ (place - point))
    return np.array(found).reshape(-1, 2)


def deviations(leaders: Mapping[str, Heard], settings: ChoiceSettings) -> Array:
    """Of the ranges (n,) [m]: their own error, and that of the leaders' positions."""
    own = [0.5 * (w.report.north_north + w.report.east_east) for w in leaders.values()]
    return np.sqrt(settings.range_noise**2 + np.maximum(own, 0.0))


def bound_at(station: Array, places: Array, sigma: Array, speed: float, step: float, settings: ChoiceSettings) -> float:
    """Least rms error at a station [m]; infinite if a direction is open."""
    if len(places) < 2:
        return math.inf
    value = _objective(sigma, speed, step, settings)(station, places)
    return math.inf if value >= NOTHING else value


def choose(planned: Array, places: Array, sigma: Array, speed: float, step: float, settings: ChoiceSettings) -> Choice:
    """The best station within reach of the planned one, or that; a step is the time between two sets of ranges [s]."""
    station = planned
    if settings.reach > 0.0 and len(places) >= 2:
        reach = Reach(distance=settings.reach, apart=settings.apart)
        station = placement.best_station(planned, places, _objective(sigma, speed, step, settings), reach)
    return Choice(station, bound_at(station, places, sigma, speed, step, settings))


def _objective(sigma: Array, speed: float, step: float, settings: ChoiceSettings) -> placement.Objective:
    """In the frame of the moving point the course is ahead: heading 0."""
    process = DeadReckoning(InputNoise(settings.drift, HEADING))
    return placement.steady_rms_in_motion(sigma, process, (speed, 0.0), step)
