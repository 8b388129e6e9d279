"""Where a vehicle is that hears ranges alone: the first belief, from those of the last seconds and dead reckoning."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators.core.history import Node
from estimators.core.types import Array

DIRECTIONS = 12  # round a beacon from which the search for the place starts
STEPS = 12  # of Gauss and Newton
AMBIGUOUS = 16.0  # by which another place must be less likely, in squared deviations
CERTAIN = 15.0  # standard deviation of a place that suffices [m]
CLOSE = 5.0  # distance within which two places are one [m]


class Heard(NamedTuple):
    """A range, as if heard at the start."""

    source: str
    beacon: Array  # (2,) less how far the vehicle has moved since [m]
    down: float  # of the beacon from the transponder [m]
    value: float  # [m]
    variance: float  # [m2]
    age: float  # in which the current has moved the vehicle, too [s]


def heard(nodes: Sequence[Node], velocity: Array, kind: str) -> list[Heard]:
    """The ranges of all nodes, as if heard at the last of them.

    Args:
        nodes: Up to the start.
        velocity: Through the water (2,) north, east [m/s].
        kind: Of the measurements that are ranges.
    """
    now = nodes[-1].time
    found = []
    for node in nodes:
        age = now - node.time
        for m in node.measurements:
            if m.kind == kind:
                north, east, down = m.parameters
                beacon = np.array((north, east)) + velocity * age
                found.append(Heard(m.source, beacon, down, m.value.item(), m.covariance.item(), age))
    return found


class Place(NamedTuple):
    """Where ranges put the vehicle."""

    cost: float  # squared deviations that are left
    position: Array  # (2,) north, east [m]
    covariance: Array  # (2, 2) by the ranges' own noise
    gain: Array  # (2, k) by which each range moves it


def place(ranges: Sequence[Heard], drift: float) -> Place | None:
    """The one place that explains the ranges; None where there is another, or it is not certain enough.

    Args:
        ranges: As if heard now.
        drift: Standard deviation of the current, each component [m/s].
    """
    if len({tuple(np.round(r.beacon)) for r in ranges}) < 2:
        return None
    first = ranges[-1]
    reach = math.sqrt(max(first.value**2 - first.down**2, 1.0))
    angles = np.arange(DIRECTIONS) * math.tau / DIRECTIONS
    solved = [_solve(ranges, drift, first.beacon + reach * np.array((math.cos(a), math.sin(a)))) for a in angles]
    best = min(solved, key=lambda one: one.cost)
    rivals = [one.cost for one in solved if math.dist(one.position, best.position) > CLOSE]
    if min(rivals, default=math.inf) - best.cost < AMBIGUOUS or math.sqrt(np.trace(best.covariance)) > CERTAIN:
        return None
    return best


def _solve(ranges: Sequence[Heard], drift: float, start: Array) -> Place:
    """What Gauss and Newton find of place and current from a start."""
    beacons, ages = np.array([r.beacon for r in ranges]), np.array([r.age for r in ranges])[:, None]
    down, values = np.array([r.down for r in ranges]), np.array([r.value for r in ranges])
    weights = 1.0 / np.array([r.variance for r in ranges])
    prior = np.diag((1e-6, 1e-6, drift**-2, drift**-2))
    x = np.array((*start, 0.0, 0.0))
    information, H, residual = prior, np.zeros((len(ranges), 4)), values
    for _ in range(STEPS):
        away = x[:2] - x[2:] * ages - beacons
        distance = np.maximum(np.sqrt(np.sum(away**2, axis=1) + down**2), 1e-3)
        H = np.hstack((away, -ages * away)) / distance[:, None]
        residual = values - distance
        information = H.T @ (weights[:, None] * H) + prior
        x = x + np.linalg.solve(information, H.T @ (weights * residual) - prior @ (0.0, 0.0, *x[2:]))
    covariance = np.linalg.inv(information)
    cost = float(residual @ (weights * residual) + x[2:] @ x[2:] / drift**2)
    return Place(cost, x[:2], covariance[:2, :2], (covariance @ H.T * weights)[:2])
