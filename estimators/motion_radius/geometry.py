"""Whether ranges to a leader can tell position and current at all, and why not.

In the water's frame the follower's way relative to the leader is known but for the current, which only shears it. As
long as that way is straight, as on constant courses, ranges leave the relative motion free to turn about the leader
and to be reflected: of the four numbers of position and current three are told, and two where there is no relative
motion. A way that bends tells all four, yet its mirror image may fit nearly as well.
"""

import math
from typing import NamedTuple

import numpy as np

from estimators.core.models.odometry import Displacement
from estimators.core.types import Array

STRAIGHT = 4.0  # deviations of the noise by which a relative way must bend before it tells the current
MIN_RANGES = 5
APART = 25.0  # squared normalised distance from which two solutions count as different
PROBABLE = 0.02  # smallest probability of a second solution that is worth a word


class Geometry(NamedTuple):
    """Sums over ranges of the follower's way relative to the leader, by odometry alone."""

    ranges: int = 0
    time: float = 0.0  # since the first displacement [s]
    north: float = 0.0  # way by odometry since then [m]
    east: float = 0.0
    noise: float = 0.0  # variance of the way by odometry, the larger axis [m^2]
    variance: float = 0.0  # summed of the ranges [m^2]
    sums: tuple[float, ...] = (0.0,) * 9  # of t, t^2, n, e, t n, t e, n^2 + e^2, range, its square

    def extended(self, since: Displacement, north: float, east: float, distance: float, variance: float) -> "Geometry":
        """With one range more, to a leader at `north`, `east`, after a displacement."""
        t, n, e = self.time + since.duration, self.north + since.north, self.east + since.east
        noise = self.noise + max(since.north_north, since.east_east)
        x, y = n - north, e - east
        added = (t, t * t, x, y, t * x, t * y, x * x + y * y, distance, distance**2)
        sums = tuple(a + b for a, b in zip(self.sums, added, strict=True))
        return Geometry(self.ranges + 1, t, n, e, noise, self.variance + variance, sums)

    @property
    def bend(self) -> float:
        """Rms distance [m] of the relative way from the straight line that fits it best."""
        count, (t, tt, n, e, tn, te, square, *_) = self.ranges, self.sums
        if count < 3:
            return 0.0
        spread = tt - t * t / count
        rest = square - (n * n + e * e) / count
        if spread > 0.0:
            rest -= ((tn - t * n / count) ** 2 + (te - t * e / count) ** 2) / spread
        return math.sqrt(max(0.0, rest) / count)

    @property
    def approach(self) -> float:
        """Standard deviation [m] of the ranges over time."""
        total, square = self.sums[7:]
        return math.sqrt(max(0.0, square - total * total / self.ranges) / self.ranges) if self.ranges else 0.0

    @property
    def is_straight(self) -> bool:
        """Whether the relative way bends no more than noise does."""
        noise = self.variance / max(1, self.ranges) + self.noise / 6.0  # of a random walk about its chord
        return self.bend < STRAIGHT * math.sqrt(noise)

    @property
    def rank(self) -> int:
        """How many of position and current (4) ranges tell to first order."""
        if not self.is_straight:
            return 4
        # Seen from the leader, a straight way at a constant distance is a point.
        return 3 if self.approach > STRAIGHT * math.sqrt(self.variance / max(1, self.ranges)) else 2

    def warnings(self, means: Array, covariances: Array, weights: Array) -> tuple[str, ...]:
        """Reasons to doubt the position and current of beliefs (m, n), (m, n, n) of probabilities (m,)."""
        if self.ranges < MIN_RANGES:
            return (f"few ranges: {self.ranges} of the {MIN_RANGES} that position and current need",)
        found = []
        if (rank := self.rank) < 4:
            why = "no motion relative to the leader" if rank == 2 else "a constant course relative to the leader"
            found.append(
                f"information rank {rank} of 4: {why} over {self.time:.0f} s; ranges leave position and current free "
                "to turn about the leader"
            )
        distance, probability = second_solution(means, covariances, weights)
        if probability > PROBABLE:
            found.append(f"mirror: a second solution {distance:.0f} m away has probability {probability:.2f}")
        return tuple(found)


def second_solution(means: Array, covariances: Array, weights: Array) -> tuple[float, float]:
    """Distance [m] from the most probable solution of all that differ from it, and their probability together.

    Solutions differ where position and current are apart by more than their covariances; NaN and 0 if there are none.
    """
    best = int(weights.argmax())
    error = (means - means[best])[:, :4]
    both = covariances[:, :4, :4] + covariances[best, :4, :4]
    squares = np.einsum("mi,mi->m", error, np.linalg.solve(both, error[..., None])[..., 0])
    others = np.where(squares > APART, weights, 0.0)
    total = float(others.sum())
    if total <= 0.0:
        return math.nan, 0.0
    return float(others @ np.hypot(error[:, 0], error[:, 1]) / total), total
