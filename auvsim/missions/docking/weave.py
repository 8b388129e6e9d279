"""A weave on the approach line, no wider than the position across it needs to be known at the mouth.

A range tells nothing across the line of sight: on a straight line to a beacon, neither the position across the line
nor the current across it can be told. Swinging to both sides turns the line of sight. How much that tells is foretold
by the Cramér-Rao bound along the planned way (`estimators.core.odometry_bounds`), from the estimate at the gate on.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from auvsim.base.frames import Array
from auvsim.missions.docking.speeds import SLOWEST, ground_speed_along
from auvsim.missions.fixes import FixSource
from auvsim.navigation.estimate import COMPASS_BIAS, Estimate
from estimators.core.models.odometry import SPACE, N
from estimators.core.odometry_bounds import Sights, bounds
from estimators.docking.noise import DockingNoise

NEEDED = 3.0  # standard deviations of the miss that are to fit into the mouth
STEPS = 10  # amplitudes that are tried, up to the largest
SHORTEST = 60.0  # way on which it is worth to weave [m]
GAINED = 0.9  # deviation over that of a straight line from which a weave that does not suffice is flown all the same
PIECE = 2.0  # of the planned way [m]
CURRENT_WALK = 1e-6  # density of the current's random walk, as in the estimators' steady modes [m^2/s^3]
STEEPEST = 0.8  # slope to the line at most [-]
PEAK = 4.0 / (3.0 * math.sqrt(3.0))  # of sin(2 t) sin(t)


class Weave(NamedTuple):
    """A swing to starboard and one to port of a line, that begins and ends along it."""

    amplitude: float  # [m]
    begin: float  # place on the line, negative before the mouth [m]
    end: float  # likewise [m]

    def at(self, along: float) -> tuple[float, float]:
        """Offset to starboard [m] and slope [-] at a place on the line [m]."""
        if self.amplitude == 0.0 or not self.begin < along < self.end:
            return 0.0, 0.0
        rate = math.pi / (self.end - self.begin)
        t, size = rate * (along - self.begin), self.amplitude / PEAK
        slope = 2.0 * math.cos(2.0 * t) * math.sin(t) + math.sin(2.0 * t) * math.cos(t)
        return size * math.sin(2.0 * t) * math.sin(t), size * rate * slope


STRAIGHT = Weave(0.0, 0.0, 0.0)


class Leg(NamedTuple):
    """An approach that begins now."""

    line: float  # its course [rad]
    axis: float  # course of the dock's axis [rad]
    mouth: tuple[float, float, float]  # north, east, depth [m]
    begin: float  # place on the line, negative before the mouth [m]
    end: float  # where the last metres begin, likewise [m]
    speed: float  # through the water [m/s]
    current: tuple[float, float]  # north, east [m/s]
    lookahead: float  # of the line of sight [m]


def least_weave(leg: Leg, largest: float, needed: float, foretold: Callable[[Weave], float]) -> Weave:
    """The least weave of which the foretold deviation of the miss is at most what is needed [m].

    Where none suffices: that of the least deviation, if it gains anything to speak of.

    Args:
        leg: The approach.
        largest: Amplitude [m].
        needed: Deviation of the miss [m].
        foretold: The deviation with a weave [m].
    """
    end = leg.end - 2.0 * leg.lookahead  # from where line of sight leads back to the line
    straight, way = Weave(0.0, leg.begin, end), end - leg.begin
    before = foretold(straight)
    if before <= needed or way < SHORTEST:
        return straight
    largest = min(largest, STEEPEST * PEAK * way / math.tau)
    best, least = straight, GAINED * before
    for step in range(1, STEPS + 1):
        weave = straight._replace(amplitude=largest * step / STEPS)
        deviation = foretold(weave)
        if deviation <= needed:
            return weave
        if deviation < least:
            best, least = weave, deviation
    return best


def miss_deviation(leg: Leg, weave: Weave, sources: Sequence[FixSource], prior: Array) -> float:
    """Least standard deviation of the miss across the axis [m] that an approach leaves.

    By the line of sight, an error of the current across the axis makes an offset of the lookahead times its ratio to
    the speed, which adds to that of the position. What is heard within the lookahead of the mouth comes too late.

    Args:
        leg: The approach.
        weave: On it.
        sources: Of ranges and fixes.
        prior: Covariance (9, 9) at its begin, states as of `estimators.core.models.odometry`.
    """
    sights, relative = planned_sights(leg, weave, sources)
    walks = SPACE.vector({"current_north": CURRENT_WALK, "current_east": CURRENT_WALK})
    found = bounds(prior, sights, relative, np.array([len(sights.times) - 1]), walks)[0, 0]
    across, drift = (-math.sin(leg.axis), math.cos(leg.axis)), leg.lookahead / leg.speed
    slope = np.array((*across, drift * across[0], drift * across[1], *(0.0 for _ in range(N - 4))))
    return math.sqrt(float(slope @ found @ slope))


def planned_sights(leg: Leg, weave: Weave, sources: Sequence[FixSource]) -> tuple[Sights, Array]:
    """What will be heard on an approach up to the lookahead before the mouth, and from where (1, 1, k, 3) [m].

    At every piece of the way there is a sight of nothing, since a current walks between two of them; so is the last.
    """
    times, places = _way(leg, weave)
    silent: list[tuple[float, FixSource | None]] = [(t, None) for t in times.tolist()]
    audible = (s for s in sources if s.interval < math.inf)
    heard = [(t, s) for s in audible for t in np.arange(times[-1] - 0.5 * s.interval, 0.0, -s.interval).tolist()]
    planned = sorted((*silent, *heard), key=lambda pair: pair[0])
    stamps = np.array([t for t, _ in planned])
    at = np.stack([np.interp(stamps, times, column) for column in places.T], axis=1)
    away = np.zeros((len(stamps), 3))
    along, across = np.full((2, len(stamps)), math.inf)
    for k, source in ((k, source) for k, (_, source) in enumerate(planned) if source is not None):
        north, east, depth = source.place
        away[k] = at[k, 0] - north, at[k, 1] - east, depth - leg.mouth[2]
        distance = float(np.linalg.norm(away[k]))
        if distance <= source.maximum:
            along[k] = source.deviation(distance) ** 2
            across[k] = along[k] / max(math.hypot(*away[k, :2]), 1.0) ** 2 if source.bearing else math.inf
    durations, moved = np.diff(stamps, prepend=0.0), np.diff(at, axis=0, prepend=places[:1])
    through = moved - durations[:, None] * np.array(leg.current)
    spread = DockingNoise().position * durations
    displacements = np.column_stack((durations, through, spread, np.zeros(len(stamps)), spread))
    by_compass = np.zeros(len(stamps), dtype=bool)
    return Sights(stamps, displacements, along, across, stamps[None], by_compass), away[None, None]


def prior_of(estimate: Estimate) -> Array:
    """What an estimate says of position, current and the compass' error, as a covariance (9, 9) of an odometer."""
    wanted = ("north", "east", "current_north", "current_east", COMPASS_BIAS)
    pairs = [(SPACE.index(name), estimate.names.index(name)) for name in wanted if name in estimate.names]
    to, of = (np.array(places) for places in zip(*pairs, strict=True))
    prior = np.zeros((N, N))
    prior[np.ix_(to, to)] = estimate.covariance[np.ix_(of, of)]
    return prior


def _way(leg: Leg, weave: Weave) -> tuple[Array, Array]:
    """Times (k,) [s] and places (k, 2) [m] of the planned way up to the lookahead before the mouth."""
    stop = -leg.lookahead
    along = np.linspace(leg.begin, stop, max(2, math.ceil((stop - leg.begin) / PIECE)))
    offset, slope = np.array([weave.at(x) for x in along.tolist()]).T
    cos, sin = math.cos(leg.line), math.sin(leg.line)
    places = np.column_stack((leg.mouth[0] + along * cos - offset * sin, leg.mouth[1] + along * sin + offset * cos))
    pieces = np.linalg.norm(np.diff(places, axis=0), axis=1)
    courses = leg.line + np.arctan(0.5 * (slope[1:] + slope[:-1]))
    speeds = [max(ground_speed_along(course, leg.speed, leg.current), SLOWEST) for course in courses.tolist()]
    return np.concatenate(([0.0], np.cumsum(pieces / np.array(speeds)))), places
