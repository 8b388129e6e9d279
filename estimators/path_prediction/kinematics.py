"""Kinematics and covariance of poses inside a joint belief, in place (Yao et al. 2011, eqs 1 and 2), in compiled loops.

A joint belief is a mean (n,) and a covariance (n, n) that hold several poses [north, east, heading], each at its place
`at`. Noise is a power spectral density: of samples, their variance times the period.
"""

import math

import numpy as np

from estimators.core.compiling import compiled


@compiled
def couple(P, i, j, factor):
    """Covariance after state i has taken up `factor` times state j."""
    for k in range(P.shape[0]):
        P[i, k] += factor * P[j, k]
    for k in range(P.shape[0]):
        P[k, i] += factor * P[k, j]


@compiled
def transport(P, at, north, east):
    """Covariance of a pose after a displacement [m] whose direction its heading error turns: Phi P Phi'."""
    couple(P, at, at + 2, -east)
    couple(P, at + 1, at + 2, north)


@compiled
def advance(x, P, at, speed, yaw_rate, duration, speed_density, yaw_density):
    """Moves a pose on by one Euler step, with its noise: eqs 1 and 2; Gamma Q Gamma' grows with the duration."""
    c, s = math.cos(x[at + 2]), math.sin(x[at + 2])
    north, east = duration * speed * c, duration * speed * s
    x[at] += north
    x[at + 1] += east
    x[at + 2] += duration * yaw_rate
    transport(P, at, north, east)
    q = duration * speed_density
    P[at, at] += q * c * c
    P[at + 1, at + 1] += q * s * s
    P[at, at + 1] += q * c * s
    P[at + 1, at] += q * c * s
    P[at + 2, at + 2] += duration * yaw_density


@compiled
def advance_with_speed(x, P, at, acceleration, yaw_rate, duration, acceleration_density, yaw_density):
    """Advances a pose whose speed is the state after its heading, a random walk with a drift (sec. 4.3)."""
    c, s = math.cos(x[at + 2]), math.sin(x[at + 2])
    speed = x[at + 3]
    couple(P, at, at + 3, duration * c)
    couple(P, at + 1, at + 3, duration * s)
    advance(x, P, at, speed, yaw_rate, duration, 0.0, yaw_density)
    x[at + 3] += duration * acceleration
    P[at + 3, at + 3] += duration * acceleration_density


@compiled
def clone(x, P, to, source):
    """Copies a pose, with all its correlations, over another: stochastic cloning (Roumeliotis and Burdick 2002)."""
    for k in range(3):
        x[to + k] = x[source + k]
        for j in range(P.shape[0]):
            P[to + k, j] = P[source + k, j]
    for k in range(3):
        for j in range(P.shape[0]):
            P[j, to + k] = P[j, source + k]


@compiled
def replace(x, P, at, mean, covariance):
    """Puts a belief of its own, uncorrelated with the rest, in the place of some states."""
    m = mean.size
    for k in range(m):
        x[at + k] = mean[k]
        for j in range(P.shape[0]):
            P[at + k, j] = 0.0
            P[j, at + k] = 0.0
    for k in range(m):
        for j in range(m):
            P[at + k, at + j] = covariance[k, j]


@compiled
def sight(north, east, heading):
    """What shows a target `north` and `east` [m] of the observer: range [m] and bearing from the bow [rad], (2,).

    And their derivatives (2, 3) by north, east and heading; all zero at no distance, where there are none.
    """
    values, D = np.zeros(2), np.zeros((2, 3))
    r = math.hypot(north, east)
    if r > 0.0:
        values[0], values[1] = r, math.atan2(east, north) - heading
        D[0, 0], D[0, 1] = north / r, east / r
        D[1, 0], D[1, 1], D[1, 2] = -east / r**2, north / r**2, -1.0
    return values, D


@compiled
def odometry_covariance(heading, speed, duration, speed_density, yaw_density):
    """Covariance (3, 3) that white noise of speed and yaw rate adds to a pose on a straight course."""
    c, s = math.cos(heading), math.sin(heading)
    along, across = speed_density * duration, yaw_density * speed**2 * duration**3 / 3.0
    skew = 0.5 * yaw_density * speed * duration**2
    Q = np.zeros((3, 3))
    Q[0, 0] = along * c * c + across * s * s
    Q[1, 1] = along * s * s + across * c * c
    Q[0, 1] = Q[1, 0] = (along - across) * c * s
    Q[0, 2] = Q[2, 0] = -skew * s
    Q[1, 2] = Q[2, 1] = skew * c
    Q[2, 2] = yaw_density * duration
    return Q


@compiled
def bend(P, at, gone, heading, speed, duration):
    """Variance of a position that a heading error costs in second order, along the course; `gone` (2,) adds it up.

    A heading off by d loses speed (1 - cos d), all the way in the same direction: of a Gaussian d of variance p in the
    root mean square sqrt(3) / 2 p to second order, and never more than twice the speed.
    """
    lost = duration * speed * min(0.5 * math.sqrt(3.0) * P[at + 2, at + 2], 1.25)
    more = np.array([lost * math.cos(heading), lost * math.sin(heading)])
    for i in range(2):
        for j in range(2):
            P[at + i, at + j] += (gone[i] + more[i]) * (gone[j] + more[j]) - gone[i] * gone[j]
    gone += more
