"""Loop closures that are checked before they are believed: the largest set that agrees with itself (Mangelson 2018).

Two closures and the paths between their ends make a cycle; where both are right, it closes within its covariance.
"""

from collections.abc import Sequence

import numpy as np

from estimators.core.consistency import chi_square
from estimators.core.types import Array
from estimators.map_path.graph import Edge
from estimators.map_path.poses import between, compose, wrapped

PROBABILITY = 0.99  # with which two right closures are found to agree
LEAST = 3  # closures that must agree; a pair may do so by chance


def consistent(closures: Sequence[Edge], poses: Array, drift: Array) -> list[int]:
    """Indices of the largest set found of closures that agree with each other; none if it has fewer than three.

    Args:
        closures: Candidates.
        poses: Poses (n, 3) without any of them.
        drift: Covariance (3, 3) that the path gathers from one pose to the next, in the body's axes.
    """
    agree = agreement(closures, poses, drift)
    chosen = largest_clique(agree)
    return chosen if len(chosen) >= LEAST else []


def agreement(closures: Sequence[Edge], poses: Array, drift: Array) -> np.ndarray:
    """Which pairs (k, k) of closures agree."""
    count, limit = len(closures), chi_square(PROBABILITY, 3)
    agree = np.zeros((count, count), dtype=bool)
    for a in range(count):
        for b in range(a):
            agree[a, b] = agree[b, a] = cycle(closures[a], closures[b], poses, drift) <= limit
    return agree


def cycle(a: Edge, b: Edge, poses: Array, drift: Array) -> float:
    """Normalised square of the error of closing a's ends by way of b."""
    there, back = between(poses[a.first], poses[b.first]), between(poses[b.second], poses[a.second])
    to_b, past_b = there, compose(there, b.relative)
    error = compose(past_b, back) - a.relative
    error[2] = wrapped(error[2])
    end = compose(past_b, back)
    covariance = a.covariance + _carried(to_b, end, b.covariance)
    covariance = covariance + path_covariance(poses, a.first, b.first, np.zeros(3), end, drift)
    covariance = covariance + path_covariance(poses, b.second, a.second, past_b, end, drift)
    return float(error @ np.linalg.solve(covariance, error))


def largest_clique(agree: np.ndarray) -> list[int]:
    """Members of a large set of which all pairs agree: grown greedily from each, by how many it agrees with."""
    best: list[int] = []
    for start in range(len(agree)):
        members, open_ = [start], agree[start].copy()
        open_[start] = False
        while open_.any():
            degrees = np.where(open_, (agree & open_).sum(axis=1), -1)
            chosen = int(np.argmax(degrees))
            members.append(chosen)
            open_ &= agree[chosen]
            open_[chosen] = False
        if len(members) > len(best):
            best = members
    return sorted(best)


def path_covariance(poses: Array, first: int, last: int, origin: Array, end: Array, drift: Array) -> Array:
    """Covariance of a stretch of the path, which begins at `origin` of the cycle, seen at the cycle's `end`."""
    if first == last:
        return np.zeros((3, 3))
    step = 1 if last > first else -1
    stretch = poses[np.arange(first + step, last + step, step)]
    return _carried(compose(origin, between(poses[first], stretch)), end, drift).sum(axis=0)


def _carried(places: Array, end: Array, covariance: Array) -> Array:
    """Covariances (..., 3, 3), of poses (..., 3) in their own axes, as those of the end of the cycle.

    A turn at a pose swings the end about it.
    """
    c, s = np.cos(places[..., 2]), np.sin(places[..., 2])
    F = np.zeros((*places.shape, 3))
    F[..., 0, 0], F[..., 0, 1], F[..., 1, 0], F[..., 1, 1], F[..., 2, 2] = c, -s, s, c, 1.0
    F[..., 0, 2], F[..., 1, 2] = places[..., 1] - end[1], end[0] - places[..., 0]
    return F @ covariance @ np.swapaxes(F, -1, -2)
