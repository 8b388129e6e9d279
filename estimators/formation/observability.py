"""Observability of a follower by ranges to n leaders: matrices, condition numbers, performance functions.

Source: Li et al. (2023), eq. 4 to 25; what is wrong there is said where it is put right. Places are north and east [m].
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimators.core.errors import ParameterError
from estimators.core.information import directions
from estimators.core.types import Array


class Geometry(NamedTuple):
    """What the paper's functions take: sums over the leaders."""

    count: int  # n
    s1: float  # sum over pairs of sin^2(theta_i - theta_j), theta the bearing from leader to follower
    s2: float  # sum of sin^2(theta_i - psi), psi the follower's course
    tau: float  # V^2 sum 1 / r_i^2 [1/s^2]


def geometry(place: ArrayLike, leaders: ArrayLike, velocity: ArrayLike) -> Geometry:
    """The sums of a follower's place (2,), its leaders (n, 2) and its velocity (2,) [m/s].

    Bearings enter by differences and squares alone, so that no convention of signs matters. (The paper writes beta_3 =
    beta_1 - alpha_1 for beta_1 - alpha_2, and alphas that add up to 360 deg, which those of its definition do not.)
    Without motion the course is that to the north.
    """
    u, r = directions(place, leaders)
    v = np.asarray(velocity, dtype=float)
    speed = float(np.hypot(*v))
    course = v / speed if speed > 0.0 else np.array([1.0, 0.0])
    first, second = np.triu_indices(len(r), 1)
    s1 = float((_cross(u[first], u[second]) ** 2).sum())
    s2 = float((_cross(u, course) ** 2).sum())
    return Geometry(len(r), s1, s2, speed**2 * float((r**-2).sum()))


def true(place: ArrayLike, leaders: ArrayLike, relative_velocity: ArrayLike) -> Array:
    """The observability matrix (2n, 2): gradients of the ranges, then of their rates (eq. 14).

    The second half is (b . v) b' / r, b across the line of sight. The paper swaps f_x and f_y in the second column, and
    lets only the follower move: the rate of a range depends on the velocity relative to the leader, which in a rigid
    formation is zero, and the second half with it.

    Args:
        place: Of the follower (2,).
        leaders: (n, 2).
        relative_velocity: Velocity of the follower minus that of each leader, (n, 2), or (2,) of all [m/s].
    """
    u, r = directions(place, leaders)
    v = np.broadcast_to(np.asarray(relative_velocity, dtype=float), u.shape)
    across = np.column_stack((-u[:, 1], u[:, 0]))
    return np.vstack((u, ((across * v).sum(axis=1) / r)[:, None] * across))


def paper(place: ArrayLike, leaders: ArrayLike, velocity: ArrayLike) -> Array:
    """The matrix (2n, 2) by which the paper replaces it (eq. 15): the second half is v' / r.

    Adding multiples of rows keeps the rank, but not the singular values of which eq. 17 is made.
    """
    u, r = directions(place, leaders)
    return np.vstack((u, np.asarray(velocity, dtype=float) / r[:, None]))


def simplified(place: ArrayLike, leaders: ArrayLike) -> Array:
    """The matrix (n, 2) it argues against: of (dx^2 + dy^2) / 2 and a follower at rest; r u', which knows distance."""
    u, r = directions(place, leaders)
    return u * r[:, None]


def condition(matrix: Array) -> float:
    """The reciprocal of the condition number, least over largest singular value, in 0..1."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return float(values[-1] / values[0]) if len(matrix) > 1 else 0.0


def condition_paper(g: Geometry) -> float:
    """Condition number of `paper` in closed form (eq. 17, whose printed quotient is the condition number itself)."""
    trace, det = g.count + g.tau, g.s1 + g.tau * g.s2
    root = np.sqrt(max(trace**2 - 4.0 * det, 0.0))
    # (trace - root) / (trace + root), without the difference that cancels where det is small.
    return float(np.sqrt(4.0 * det) / (trace + root))


def ja(g: Geometry) -> float:
    """The paper's performance function (eq. 18), of three leaders.

    At a fixed tau it grows with `condition_paper`; across speeds and distances it does not, see `monotone`.

    Raises:
        ParameterError: There are not three leaders.
    """
    if g.count != 3:
        raise ParameterError(f"eq. 18 holds for three leaders, not {g.count}")
    return g.s1 + g.tau * (4.0 * g.s2 - g.tau - 6.0) / 4.0


def jb(g: Geometry) -> float:
    """Its simple form, S1 (eq. 19, 21, 24 and 25)."""
    return g.s1


def monotone(g: Geometry) -> float:
    """What grows with `condition_paper` at any tau: det / trace^2, in 0..1/4."""
    return (g.s1 + g.tau * g.s2) / (g.count + g.tau) ** 2


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
