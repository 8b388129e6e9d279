"""Planar truth and measurements for the docking filters: the calibrated study of paper 1, mode A (range pinned)."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import fsolve

from estimators.core.types import Array
from estimators.docking.estimator import DockingEstimator, UsblFix, UsblModel
from estimators.planar.model import PRESTERO, planar_kernels

DENSITIES = np.array([4e-4, 4e-4, 1e-7, 1e-5, 1e-5, 1e-6, 0.0, 0.0])  # of the truth, sec. 2 of the paper
TRUTH_STEP, TICK = 0.1, 0.5  # [s]
COMPASS_SIGMA = math.radians(1.0)
STEADY_RUDDER = {200: 0.265, 100: 0.564, 40: 1.668, 12: 9.02}  # [m]: [deg]


@dataclass
class Run:
    states: Array  # (n, 8) every TRUTH_STEP
    compass: Array  # (k,) every TICK
    rudder: float  # [rad]
    fixes: list[UsblFix]  # in order of stamp
    usbl: UsblModel

    @property
    def ticks(self) -> Array:
        """True states (k, 8) at the ticks."""
        return self.states[:: round(TICK / TRUTH_STEP)][: len(self.compass)]


def accelerations(nu: Array, d: float, p=PRESTERO, n: float = 0.0) -> Array:
    """Sec. 3 of the paper written anew, as a linear system in the accelerations."""
    u, v, r = nu
    M = np.array(
        [
            [p.m - p.X_ud, 0.0, 0.0],
            [0.0, p.m - p.Y_vd, p.m * p.x_g - p.Y_rd],
            [0.0, p.m * p.x_g - p.N_vd, p.I_z - p.N_rd],
        ]
    )
    X = p.X_uu * u * abs(u) + (p.X_vr + p.m) * v * r + (p.X_rr + p.m * p.x_g) * r * r + p.X_dd * u * u * d * d
    X += p.X_prop + p.X_u * u + p.X_nn * n * abs(n) + p.X_nu * abs(n) * u
    Y = p.Y_vv * v * abs(v) + p.Y_rr * r * abs(r) + p.Y_uv * u * v + (p.Y_ur - p.m) * u * r + p.Y_dd * u * u * d
    Y += p.Y_v * v + p.Y_r * r
    N = p.N_vv * v * abs(v) + p.N_rr * r * abs(r) + p.N_uv * u * v + (p.N_ur - p.m * p.x_g) * u * r
    N += p.N_dd * u * u * d + p.N_v * v + p.N_r * r
    return np.linalg.solve(M, np.array([X, Y, N]))


def steady_circle(radius: float) -> tuple[Array, float]:
    """Velocities (3,) and rudder [rad] of the steady turn to starboard of a radius [m]."""

    def unbalanced(z: Array) -> list[float]:
        u, v, r, d = z
        return [*accelerations(z[:3], d), math.hypot(u, v) - radius * r]

    z = np.asarray(fsolve(unbalanced, [0.8, 0.0, 0.8 / radius, math.radians(STEADY_RUDDER[round(radius)])], xtol=1e-12))
    return z[:3], float(z[3])


def simulate(seed: int, radius: float = 40.0, duration: float = 200.0, jitter: float = 0.5) -> Run:
    """A circle in a constant current of 0.5 m/s, USBL noise and delay as at `radius`; a fix about every 5 s."""
    rng = np.random.default_rng(seed)
    nu, rudder = steady_circle(radius)
    direction, heading = rng.uniform(-math.pi, math.pi, 2)
    x = np.array([0.0, -radius, heading, *nu, 0.5 * math.cos(direction), 0.5 * math.sin(direction)])
    step, p = planar_kernels().step, PRESTERO.vector()
    count = round(duration / TRUTH_STEP)
    increments = rng.standard_normal((count, 8)) * np.sqrt(DENSITIES * TRUTH_STEP)
    states, following, F = np.empty((count + 1, 8)), np.empty(8), np.zeros((8, 8))
    states[0] = x
    for k in range(count):
        step(states[k], (rudder, 0.0), p, TRUTH_STEP, following, F)
        states[k + 1] = following + increments[k]
    compass = states[:: round(TICK / TRUTH_STEP), 2]
    compass = compass + COMPASS_SIGMA * rng.standard_normal(compass.size)
    usbl = UsblModel()
    sigma, delay = usbl.deviation(radius), 1.5 + 0.002 * radius
    fixes, stamp = [], rng.uniform(0.5, 5.0)
    times = TRUTH_STEP * np.arange(count + 1)
    while stamp < duration:
        north, east = (np.interp(stamp, times, states[:, k]) + sigma * rng.standard_normal() for k in (0, 1))
        fixes.append(
            UsblFix(stamp=stamp, received=stamp + delay, position=(north, east, 0.0), heading=0.0, sequence=len(fixes))
        )
        stamp += 5.0 + rng.uniform(-jitter, jitter)
    # The run drifts away with the current, its noise does not: the deviation is pinned.
    return Run(states, compass, rudder, fixes, UsblModel(ranges=(1.0, 2.0), deviations=(sigma, sigma)))


def track(run: Run, docking_filter, fixes: list[UsblFix] | None = None):
    """Means (k, 8), covariances (k, 8, 8) at the ticks, and the last estimate, from fixes delivered as received."""
    estimator = DockingEstimator(docking_filter, run.usbl, step=TICK)
    waiting = sorted(run.fixes if fixes is None else fixes, key=lambda fix: fix.received)
    means, covariances = np.empty((len(run.compass), 8)), np.empty((len(run.compass), 8, 8))
    arrived = 0
    estimate = None
    for k, heading in enumerate(run.compass):
        first = arrived
        while arrived < len(waiting) and waiting[arrived].received <= TICK * k:
            arrived += 1
        estimate = estimator.tick(TICK * k, heading, run.rudder, 0.0, waiting[first:arrived])
        means[k], covariances[k] = estimate.mean, estimate.covariance
    assert estimate is not None
    return means, covariances, estimate


def position_errors(run: Run, means: Array, start: float = 100.0) -> Array:
    """Horizontal errors [m] at the ticks from `start` [s] on."""
    return np.linalg.norm((means - run.ticks)[round(start / TICK) :, :2], axis=1)
