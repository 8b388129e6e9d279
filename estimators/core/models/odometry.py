"""Position by odometry in a current, beside what odometry, clock and sound speed may have wrong, in compiled loops.

The displacement between two measurements is measured as a whole, so that a filter that is asked only there needs no
step for each sample. A state whose variance is zero is known, and costs a filter nothing of what it knows.

    true displacement = R(-compass_bias) measured / (1 + speed_scale) + duration current
    range = (1 + range_scale) distance + range_offset,    bearing = true bearing + compass_bias
"""

import math
from typing import NamedTuple

from estimators.core import loops
from estimators.core.compiling import compiled
from estimators.core.states import StateSpace

SPACE = StateSpace(
    {
        "north": "m",
        "east": "m",
        "current_north": "m/s",
        "current_east": "m/s",
        "range_offset": "m",  # clock offset times sound speed
        "range_drift": "m/s",  # clock drift times sound speed
        "range_scale": "1",  # sound speed assumed over that of the water, minus 1
        "speed_scale": "1",  # speed measured over that through the water, minus 1
        "compass_bias": "rad",
    }
)
N = 9  # states


class OdometryNoise(NamedTuple):
    """Power spectral densities of white noise; of samples, each its variance times the period."""

    forward: float = 0.0  # of the speed ahead [m^2/s]
    starboard: float = 0.0  # of the speed to starboard [m^2/s]
    heading: float = 0.0  # [rad^2 s]
    position: float = 0.0  # of the position itself, along each axis [m^2/s]


class Displacement(NamedTuple):
    """What odometry has measured since some time: the vector, and the covariance of its noise."""

    duration: float = 0.0  # [s]
    north: float = 0.0  # [m]
    east: float = 0.0
    north_north: float = 0.0  # covariance [m^2]
    north_east: float = 0.0
    east_east: float = 0.0

    def extended(
        self, forward: float, starboard: float, heading: float, dt: float, noise: OdometryNoise
    ) -> "Displacement":
        """The odometry and `dt` [s] more of it, at speeds through the water [m/s] and a heading [rad] that are held."""
        c, s = math.cos(heading), math.sin(heading)
        dn, de = (forward * c - starboard * s) * dt, (forward * s + starboard * c) * dt
        ahead, aside = (noise.forward + noise.position) * dt, (noise.starboard + noise.position) * dt
        turned = noise.heading / dt if dt > 0.0 else 0.0
        return Displacement(
            self.duration + dt,
            self.north + dn,
            self.east + de,
            self.north_north + ahead * c * c + aside * s * s + turned * de * de,
            self.north_east + (ahead - aside) * c * s - turned * dn * de,
            self.east_east + ahead * s * s + aside * c * c + turned * dn * dn,
        )


@compiled
def move(x, d, following, F):
    """Fills the state after a displacement `d`, a tuple as of `Displacement`, and its derivative F (9, 9).

    F must hold the identity, but for what this function fills.
    """
    c, s, g = math.cos(x[8]), math.sin(x[8]), 1.0 / (1.0 + x[7])
    north, east = g * (c * d[1] + s * d[2]), g * (c * d[2] - s * d[1])
    following[:] = x
    following[0] += north + d[0] * x[2]
    following[1] += east + d[0] * x[3]
    following[4] += d[0] * x[5]
    F[0, 2] = F[1, 3] = F[4, 5] = d[0]
    F[0, 7], F[1, 7] = -g * north, -g * east
    F[0, 8], F[1, 8] = east, -north


@compiled
def spread(P, F, d, q, work):
    """P <- F P F' + Q in place, Q that of a displacement `d` and of random walks of densities q (9,) [unit^2/s]."""
    loops.propagate(F, P, q, d[0], work)
    P[0, 0] += d[3]
    P[0, 1] += d[4]
    P[1, 0] += d[4]
    P[1, 1] += d[5]


@compiled
def show_range(x, north, east, down, H):
    """Range [m] to a place at `north`, `east`, `down` metres below the vehicle, and its derivative H (1, 9)."""
    dn, de = x[0] - north, x[1] - east
    distance = math.sqrt(dn * dn + de * de + down * down)
    H[0, :] = 0.0
    H[0, 0], H[0, 1] = (1.0 + x[6]) * dn / distance, (1.0 + x[6]) * de / distance
    H[0, 4], H[0, 6] = 1.0, distance
    return (1.0 + x[6]) * distance + x[4]


@compiled
def show_bearing(x, north, east, H):
    """Bearing [rad] of a place by the compass, from north, and its derivative H (1, 9)."""
    dn, de = north - x[0], east - x[1]
    square = dn * dn + de * de
    H[0, :] = 0.0
    H[0, 0], H[0, 1] = de / square, -dn / square
    H[0, 8] = 1.0
    return math.atan2(de, dn) + x[8]
