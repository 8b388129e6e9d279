"""Where leaders, and a follower, should stand: extremal formations of n leaders, and the best that can be reached.

Source of the closed forms: sum of w_i exp(2 j theta_i) = 0 with w = 1 / sigma^2 (Bishop et al. 2010; Moreno-Salinas
2013).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimators.core.errors import ParameterError
from estimators.core.information import range_information, with_known_depth
from estimators.core.types import Array
from estimators.formation.bounds import steady
from estimators.formation.models import DeadReckoning

Objective = Callable[[Array, Array], float]  # (follower (2,), leaders (n, 2)) -> what is to be small
SHELLS = (0.15, 0.4, 0.7, 1.0)  # of the reach, that moves are tried at
COURSES = 48  # of moves that are tried
NOTHING = 1e9  # error where a direction is open [m]; finite, so that moves can be compared
ROUNDS = 20  # of moves of all leaders in turn, at most


@dataclass(frozen=True, kw_only=True, slots=True)
class Reach:
    """Where vehicles can go."""

    distance: float  # that each can go from where it is [m]: speed times time
    modem: float = math.inf  # greatest range of the modem [m]
    apart: float = 0.0  # least distance between any two vehicles [m]

    def __post_init__(self) -> None:
        if not (self.distance > 0.0 and self.modem > self.apart >= 0.0 and math.isfinite(self.distance)):
            raise ParameterError(
                f"distance {self.distance} m must be above 0, and the modem's range {self.modem} m above the least "
                f"distance apart {self.apart} m, which must not be negative"
            )


def best_determinant(deviations: ArrayLike) -> float:
    """The largest det F of ranges of given deviations [1/m^4].

    (W / 2)^2 with W = sum of w, n^2 / (4 sigma^4) if equal; w_max (W - w_max) if one is better than all others
    together.
    """
    w = _weights(deviations)
    return float(w.max() * (w.sum() - w.max())) if 2.0 * w.max() > w.sum() else float(w.sum() ** 2) / 4.0


def optimal_bearings(deviations: ArrayLike) -> Array:
    """Bearings (n,) in [0, pi) from leaders to the follower that reach `best_determinant`, the first 0 [rad].

    Each may be turned by half a turn: the leader then stands on the other side. Weights along the doubled bearings must
    close to a polygon; a triangle is made of them. Equal leaders are spread evenly over half a turn. A leader better
    than all others together has these at right angles to it.
    """
    w = _weights(deviations)
    n = len(w)
    if np.ptp(w) <= 1e-12 * w.max():
        return math.pi * np.arange(n) / n
    order = np.argsort(-w)
    groups: list[list[int]] = [[int(order[0])], [], []]
    for index in order[1:]:  # to the lighter one
        groups[1 if w[groups[1]].sum() <= w[groups[2]].sum() else 2].append(int(index))
    a, b, c = (float(w[group].sum()) for group in groups)
    doubled = np.zeros(n)
    if a >= b + c:
        doubled[[*groups[1], *groups[2]]] = math.pi
    else:  # sides a, b, c head to tail, each turned by the outer angle of the triangle
        doubled[groups[1]] = math.pi - math.acos(np.clip((a * a + b * b - c * c) / (2.0 * a * b), -1.0, 1.0))
        doubled[groups[2]] = math.pi + math.acos(np.clip((a * a + c * c - b * b) / (2.0 * a * c), -1.0, 1.0))
    return np.remainder((doubled - doubled[0]) / 2.0, math.pi)


def information_of(bearings: ArrayLike, deviations: ArrayLike) -> Array:
    """F (2, 2) of bearings from leaders to the follower; distances do not matter."""
    theta = np.asarray(bearings, dtype=float)
    return range_information(np.zeros(2), -np.column_stack((np.cos(theta), np.sin(theta))), deviations)


def optimise_bearings(deviations: ArrayLike, Q: Array | None = None, *, seed: int = 0, starts: int = 12) -> Array:
    """Bearings (n,) in [0, pi), the first 0 unless there is noise, found by search [rad].

    Args:
        deviations: Of the ranges (n,) [m].
        Q: Noise of a step (2, 2) [m^2]: then the trace of the steady bound is made small; None: det F large.
        seed: Of the starts.
        starts: How many.
    """
    n = len(_weights(deviations))

    def cost(theta: Array) -> float:
        F = information_of(theta, deviations)
        det = float(np.linalg.det(F))
        if Q is None or det < 1e-9 * np.trace(F) ** 2:
            return -math.log(max(det, 1e-300))
        return float(np.log(np.trace(steady(F, Q)))) - 100.0  # below any of the other

    rng = np.random.default_rng(seed)
    from scipy.optimize import minimize

    found = [
        minimize(cost, rng.uniform(0.0, math.pi, n), method="BFGS", options={"gtol": 1e-10}) for _ in range(starts)
    ]
    best = np.asarray(min(found, key=lambda result: result.fun).x)
    return np.remainder(best - (best[0] if Q is None else 0.0), math.pi)


def horizontal_information(follower: Array, leaders: Array, deviations: ArrayLike, depths: ArrayLike = 0.0) -> Array:
    """F (2, 2) of slant ranges to leaders at `depths` (n,) [m] below the follower, whose own depth a gauge gives."""
    below = np.broadcast_to(np.asarray(depths, dtype=float), (len(leaders),))
    if not below.any():
        return range_information(follower, leaders, deviations)
    return with_known_depth(range_information((*follower, 0.0), np.column_stack((leaders, below)), deviations))


def snapshot_rms(deviations: ArrayLike, depths: ArrayLike = 0.0) -> Objective:
    """Objective: the least rms error of one set of ranges [m]; `depths` as of `horizontal_information`."""

    def objective(follower: Array, leaders: Array) -> float:
        F = horizontal_information(follower, leaders, deviations, depths)
        det = float(np.linalg.det(F))
        return math.sqrt(float(np.trace(F)) / det) if det > 1e-12 * float(np.trace(F)) ** 2 else NOTHING

    return objective


def steady_rms_in_motion(
    deviations: ArrayLike, process: DeadReckoning, u: ArrayLike, step: float, depths: ArrayLike = 0.0
) -> Objective:
    """Objective: the least rms error in steady motion with an input, in a rigid formation [m]."""
    Q = process.covariance(np.zeros(2), u, step)

    def objective(follower: Array, leaders: Array) -> float:
        F = horizontal_information(follower, leaders, deviations, depths)
        if not float(np.linalg.det(F)) > 1e-9 * float(np.trace(F)) ** 2:
            return NOTHING
        return math.sqrt(float(np.trace(steady(F, Q))))

    return objective


def best_move(follower: Array, leaders: Array, index: int, objective: Objective, reach: Reach) -> Array:
    """The best place (2,) that one leader can reach while all others stay; where it is if none is better."""
    leaders = np.array(leaders, dtype=float)

    def value(place: Array) -> float:
        moved = leaders.copy()
        moved[index] = place
        return objective(follower, moved)

    others = np.vstack((np.delete(leaders, index, axis=0), follower))
    return _best(leaders[index], value, lambda place: _allowed(place, others, follower[None], reach), reach)


def best_station(follower: Array, leaders: Array, objective: Objective, reach: Reach) -> Array:
    """The best place (2,) that the follower can reach."""
    follower, leaders = np.asarray(follower, dtype=float), np.asarray(leaders, dtype=float)
    return _best(
        follower,
        lambda place: objective(place, leaders),
        lambda place: _allowed(place, leaders, leaders, reach),
        reach,
    )


def best_formation(follower: Array, leaders: Array, objective: Objective, reach: Reach) -> Array:
    """Places (n, 2) of all leaders, each within reach of where it is, that none can improve alone."""
    start, places = np.array(leaders, dtype=float), np.array(leaders, dtype=float)
    value = objective(follower, places)
    for _ in range(ROUNDS):
        for index in range(len(places)):
            places[index] = _improved(follower, places, start[index], index, objective, reach)
        before, value = value, objective(follower, places)
        if before - value < 1e-6 * value:
            break
    return places


def _improved(follower: Array, places: Array, home: Array, index: int, objective: Objective, reach: Reach) -> Array:
    others = np.vstack((np.delete(places, index, axis=0), follower))

    def value(place: Array) -> float:
        moved = places.copy()
        moved[index] = place
        return objective(follower, moved)

    return _best(home, value, lambda place: _allowed(place, others, follower[None], reach), reach, places[index])


def _best(
    home: Array,
    value: Callable[[Array], float],
    allowed: Callable[[Array], bool],
    reach: Reach,
    now: Array | None = None,
) -> Array:
    """The place with the least value on circles round `home`, or where it is; the shortest way among equals."""
    now = home if now is None else now
    best, least = now, value(now)
    for share in SHELLS:
        for course in 2.0 * math.pi * np.arange(COURSES) / COURSES:
            place = home + share * reach.distance * np.array([math.cos(course), math.sin(course)])
            if allowed(place) and (found := value(place)) < least * (1.0 - 1e-9):
                best, least = place, found
    return best


def _allowed(place: Array, others: Array, heard: Array, reach: Reach) -> bool:
    away = np.linalg.norm(others - place, axis=1)
    return bool((away >= max(reach.apart, 1e-6)).all() and (np.linalg.norm(heard - place, axis=1) <= reach.modem).all())


def _weights(deviations: ArrayLike) -> Array:
    sigma = np.atleast_1d(np.asarray(deviations, dtype=float))
    if sigma.ndim != 1 or not sigma.size or not (np.isfinite(sigma) & (sigma > 0.0)).all():
        raise ParameterError(f"deviations {sigma.tolist()} must be at least one, finite and above 0")
    return sigma**-2
