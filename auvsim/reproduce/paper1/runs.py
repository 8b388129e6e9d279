"""Runs of paper 1's planar study: true ways, what the sensors showed of them, and how a filter follows.

The truth is the planar model integrated in steps of 0.1 s with the process noise that fits the paper's Table 1. A run
is reproduced by its conditions and its seed; conditions that differ in one thing share all the draws of the rest.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from auvsim.simulation import planar_world
from estimators.core.loops import wrap
from estimators.core.types import Array
from estimators.docking.estimator import DockingEstimate, DockingEstimator, UsblFix, UsblModel
from estimators.planar.model import PRESTERO, PlanarProcess

TRUTH_STEP, TICK = 0.1, 0.5  # [s]
STEPS = round(TICK / TRUTH_STEP)
# Of the truth: north, east, heading, u, v, r, current.
DENSITIES = np.array([4e-4, 4e-4, 1e-7, 1e-5, 1e-5, 1e-6, 0.0, 0.0])
COMPASS = math.radians(1.0)  # standard deviation [rad]
# Rudder [rad] of the steady circle to starboard of a radius [m].
STEADY_RUDDER = {radius: math.radians(d) for radius, d in ((200, 0.265), (100, 0.564), (40, 1.668), (12, 9.02))}
RUDDER_LIMIT = math.radians(13.6)


@dataclass(frozen=True, kw_only=True, slots=True)
class Conditions:
    """What a run is like. Angles are in radians."""

    radius: int = 40  # of the circle about the dock [m], one of STEADY_RUDDER
    duration: float = 300.0  # [s]
    current: float = 0.5  # its speed [m/s]; its direction is drawn
    turn: tuple[float, float] | None = None  # when the current turns by 90 degrees, to a side that is drawn [s]
    interval: tuple[float, float] = (4.5, 5.5)  # between fixes, drawn evenly [s]
    dropped: float = 0.0  # share of fixes that never arrive
    late: float = 0.0  # share of fixes that arrive 5 to 15 s later, and so out of order
    outliers: float = 0.0  # share of fixes, not the first, that are wrong
    outlier_distance: tuple[float, float] = (10.0, 30.0)  # by how much, drawn evenly [m]
    thrust: float = 1.0  # true thrust relative to that which filters assume
    compass_bias: float = 0.0  # of the vehicle's compass [rad]
    dock_heading_bias: float = 0.0  # of the dock's compass [rad]
    clock_offset: float = 0.0  # how much later than its stamp a fix is taken [s]
    # False: fixed rudder, the noise and delay of the fixes as at `radius` while the current carries the circle away
    # (the reference). True: held on the circle by a course controller that knows the truth, noise and delay by range.
    orbit: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class Run:
    """What happened, and what a filter is told of it."""

    conditions: Conditions
    times: Array  # (k,) ticks [s]
    states: Array  # (k, 8) true north, east, psi, u, v, r, c_n, c_e at the ticks; the heading is not wrapped
    compass: Array  # (k,) [rad]
    rudder: Array  # (k,) mean since the last tick [rad]
    fixes: tuple[UsblFix, ...]  # in order of arrival
    usbl: UsblModel  # noise of the fixes that a filter may assume


class Trajectory(Protocol):
    """The truth of a run."""

    @property
    def times(self) -> Array:
        """(k,) [s]."""
        ...

    @property
    def states(self) -> Array:
        """(k, 8) north, east, psi, u, v, r, c_n, c_e then."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Track:
    """Estimates of a filter at the ticks of a run."""

    means: Array  # (k, 8); NaN before the first fix
    covariances: Array  # (k, 8, 8)
    refused: dict[str, int]

    def errors(self, run: Trajectory) -> Array:
        """Horizontal distance (k,) from the truth [m]."""
        return np.linalg.norm((self.means - run.states)[:, :2], axis=1)


def simulate(conditions: Conditions, seed: int) -> Run:
    """The run of a seed."""
    streams = [np.random.default_rng((seed, k)) for k in range(4)]
    fine, rudder = _way(conditions, *streams[:1])
    states = fine[::STEPS]
    compass = states[:, 2] + conditions.compass_bias + COMPASS * streams[1].standard_normal(len(states))
    usbl = UsblModel()
    if not conditions.orbit:
        sigma = usbl.deviation(conditions.radius)
        usbl = UsblModel(ranges=(1.0, 2.0), deviations=(sigma, sigma))
    fixes = sorted(_fixes(conditions, fine, usbl, streams[2], streams[3]), key=lambda fix: fix.received)
    return Run(
        conditions=conditions,
        times=np.array([TICK * k for k in range(len(states))]),
        states=states,
        compass=compass,
        rudder=rudder,
        fixes=tuple(fixes),
        usbl=usbl,
    )


def in_order(run: Run) -> Run:
    """The run with every fix delivered at once."""
    fixes = [replace(fix, received=fix.stamp) for fix in run.fixes]
    return replace(run, fixes=tuple(sorted(fixes, key=lambda fix: fix.stamp)))


def follow(run: Run, estimator: DockingEstimator) -> Iterator[DockingEstimate]:
    """What an estimator says at each tick of a run, given each fix at the first tick after it has arrived."""
    headings, rudders = run.compass.tolist(), run.rudder.tolist()
    arrived = 0
    for k, time in enumerate(run.times.tolist()):
        first = arrived
        while arrived < len(run.fixes) and run.fixes[arrived].received <= time:
            arrived += 1
        yield estimator.tick(time, headings[k], rudders[k], 0.0, run.fixes[first:arrived])


def track(run: Run, docking_filter: Any, **options: Any) -> Track:
    """How a filter follows a run; `options` of the `DockingEstimator`."""
    count = len(run.times)
    means, covariances = np.full((count, 8), math.nan), np.zeros((count, 8, 8))
    estimate = None
    for k, estimate in enumerate(follow(run, DockingEstimator(docking_filter, run.usbl, step=TICK, **options))):
        if estimate.initialised:
            means[k], covariances[k] = estimate.mean[:8], estimate.covariance[:8, :8]
    return Track(means=means, covariances=covariances, refused=dict(estimate.refused) if estimate else {})


def _way(conditions: Conditions, rng: np.random.Generator) -> tuple[Array, Array]:
    """True states (n, 8) every TRUTH_STEP, and the mean rudder since the last tick (k,)."""
    assumed = PRESTERO
    parameters = replace(assumed, X_prop=conditions.thrust * assumed.X_prop)
    process = PlanarProcess(parameters, np.zeros(8))
    rudder = STEADY_RUDDER[conditions.radius]
    heading, direction = rng.uniform(-math.pi, math.pi, 2)
    sense = 1.0 if rng.random() < 0.5 else -1.0
    count = STEPS * round(conditions.duration / TICK)
    times = TRUTH_STEP * np.arange(count + 1)
    turned = np.zeros(count + 1)
    if conditions.turn is not None:
        turned = sense * 0.5 * math.pi * np.clip(np.interp(times, conditions.turn, (0.0, 1.0)), 0.0, 1.0)
    current = conditions.current * np.stack((np.cos(direction + turned), np.sin(direction + turned)), axis=1)
    increments = planar_world.process_noise_increments(rng, DENSITIES, TRUTH_STEP, current)
    still = np.array([0.0, 0.0, 0.0, 0.8, 0.0, 0.0, 0.0, 0.0])
    steady = process.walk(still, np.full((3000, 2), (rudder, 0.0)), TRUTH_STEP, np.zeros((3000, 8)))[-1]
    # On a circle about the dock, to starboard: the dock is abeam.
    abeam = heading + 0.5 * math.pi
    place = -conditions.radius * np.array([math.cos(abeam), math.sin(abeam)])
    start = np.array([*place, heading, *steady[3:6], *current[0]])
    if conditions.orbit:
        return _orbit(conditions, process, start, increments)
    states = process.walk(start, np.full((count, 2), (rudder, 0.0)), TRUTH_STEP, increments)
    return states, np.full(count // STEPS + 1, rudder)


def _orbit(conditions: Conditions, process: PlanarProcess, start: Array, increments: Array) -> tuple[Array, Array]:
    """As `_way`, steered at each tick along the circle about the dock, with a crab angle against the current."""
    states, rudders = np.empty((len(increments) + 1, 8)), [STEADY_RUDDER[conditions.radius]]
    states[0] = start
    for k in range(0, len(increments), STEPS):
        _, _, psi, u, v, r, _, _ = states[k].tolist()
        command = heading_for(course_round(states[k], conditions.radius), states[k])
        rate = math.hypot(u, v) / conditions.radius
        rudder = STEADY_RUDDER[conditions.radius] + 0.5 * wrap(command - psi) - 1.0 * (r - rate)
        rudder = max(-RUDDER_LIMIT, min(RUDDER_LIMIT, rudder))
        inputs = np.full((STEPS, 2), (rudder, 0.0))
        states[k : k + STEPS + 1] = process.walk(states[k], inputs, TRUTH_STEP, increments[k : k + STEPS])
        rudders.append(rudder)
    return states, np.array(rudders)


def course_round(state: Array, radius: float) -> float:
    """Course [rad] over ground clockwise round the dock, and back onto the circle of a radius [m] at up to 60 degrees.

    Of the true planar state (8,).
    """
    north, east = state[:2].tolist()
    bearing = math.atan2(east, north)  # of the vehicle from the dock
    outside = (math.hypot(north, east) - radius) / max(5.0, 0.3 * radius)
    return bearing + 0.5 * math.pi + math.radians(60.0) * math.tanh(outside)


def heading_for(course: float, state: Array) -> float:
    """Heading [rad] that makes good a course [rad] in the current of a true planar state (8,), if any does."""
    u, v, _, c_n, c_e = state[3:].tolist()
    across = -math.sin(course) * c_n + math.cos(course) * c_e
    return course - math.asin(max(-0.9, min(0.9, across / math.hypot(u, v))))


def _fixes(
    conditions: Conditions,
    states: Array,
    usbl: UsblModel,
    rng: np.random.Generator,
    packet_draws: np.random.Generator,
) -> list[UsblFix]:
    """The dock's packets; each takes the same number of draws whatever befalls it."""
    times = TRUTH_STEP * np.arange(len(states))
    low, high = conditions.interval
    fixes, number = [], 0
    stamp = 0.0
    c, s = math.cos(conditions.dock_heading_bias), math.sin(conditions.dock_heading_bias)
    while stamp < conditions.duration:
        taken = stamp + conditions.clock_offset
        north, east = (float(np.interp(taken, times, states[:, k])) for k in (0, 1))
        distance = math.hypot(north, east) if conditions.orbit else conditions.radius
        noise = usbl.deviation(distance) * rng.standard_normal(2)
        interval = rng.uniform(low, high)
        dropped, late, wrong, delay, share, bearing = packet_draws.random(6).tolist()
        north, east = c * north - s * east + noise[0], s * north + c * east + noise[1]
        if wrong < conditions.outliers and number:
            near, far = conditions.outlier_distance
            off = near + share * (far - near)
            north += off * math.cos(2.0 * math.pi * bearing)
            east += off * math.sin(2.0 * math.pi * bearing)
        received = stamp + 1.5 + 0.002 * distance + (5.0 + 10.0 * delay if late < conditions.late else 0.0)
        if dropped >= conditions.dropped:
            fixes.append(
                UsblFix(stamp=stamp, received=received, position=(north, east, 0.0), heading=0.0, sequence=number)
            )
        number += 1
        # The first fix starts the run; the phase of those that follow is random.
        stamp += interval if number > 1 else interval * rng.random()
    return fixes
