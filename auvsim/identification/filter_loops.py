"""An extended Kalman filter along a whole record, and its smoother, in compiled loops; see `compiled` for the model.

Twelve states: the planar model's eight, [north, east, psi, u, v, r, c_n, c_e], then the constant errors of a record in
the order of `fit.NUISANCES` from the third on: gyro, compass, misalignment, scale. Measurements are taken one scalar at
a time, as uncorrelated noises allow, so that innovations are scalars and nothing is inverted.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from estimators.core.compiling import compiled
from estimators.core.loops import factor, propagate, solve, wrap

STATES = 12

if TYPE_CHECKING:  # CasADi writes it in front of this text

    def step(x, u, p, h, following, F) -> None:
        """One step of the planar model's eight states."""


@compiled
def carry(x, P, u, p, q, h, substeps, following, F, work):
    """Mean and covariance over one sample, in place; F (12, 12) is a unit matrix but for the first eight."""
    for _ in range(substeps):
        step(x, u, p, h / substeps, following, F)
        propagate(F, P, q, h / substeps, work)
        x[:8] = following[:8]


@compiled
def row_of(x, channel, H):
    """What a channel shows of a state (12,), and its derivatives H (12,)."""
    H[:] = 0.0
    if channel < 2:
        H[channel] = 1.0
        return x[channel]
    if channel == 2:
        H[2], H[9] = 1.0, 1.0
        return x[2] + x[9]
    if channel == 5:
        H[5], H[8] = 1.0, 1.0
        return x[5] + x[8]
    gain = 1.0 + x[11]
    a, b = gain * math.cos(x[10]), gain * math.sin(x[10])
    u, v = x[3], x[4]
    if channel >= 6:
        cosine, sine = math.cos(x[2]), math.sin(x[2])
        u += cosine * x[6] + sine * x[7]
        v += cosine * x[7] - sine * x[6]
    along, across = a * u + b * v, a * v - b * u
    turned = channel == 4 or channel == 7
    first, second = (-b, a) if turned else (a, b)
    H[3], H[4] = first, second
    if channel >= 6:
        H[6], H[7] = first * cosine - second * sine, first * sine + second * cosine
        H[2] = first * (cosine * x[7] - sine * x[6]) - second * (cosine * x[6] + sine * x[7])
    H[10] = -along if turned else across
    H[11] = (across if turned else along) / gain
    return across if turned else along


@compiled
def correct(x, P, value, variance, channel, H, gain):
    """Corrects by one scalar, in place; the innovation and its variance."""
    n = x.size
    e = value - row_of(x, channel, H)
    if channel == 2:
        e = wrap(e)
    s = variance
    for i in range(n):
        total = 0.0
        for j in range(n):
            if H[j] != 0.0:
                total += P[i, j] * H[j]
        gain[i] = total
    for i in range(n):
        s += H[i] * gain[i]
    for i in range(n):
        share = gain[i] / s
        x[i] += share * e
        for j in range(n):
            P[i, j] -= share * gain[j]
    return e, s


@compiled
def track(x, P, inputs, measured, variances, p, q, h, substeps, e, s):
    """Filters a record; x (12,) and P (12, 12) are the belief before its first sample and are overwritten.

    Args:
        variances: Of the channels (8,); infinite leaves one out.
        q: Power spectral densities (12,).
        e, s: (n, 8), filled with innovations and their variances, NaN where nothing was measured.

    Returns:
        Negative log likelihood (without the constant), infinite where the filter left the finite numbers.
    """
    F, work, following = np.eye(STATES), np.empty((STATES, STATES)), np.empty(8)
    H, gain = np.empty(STATES), np.empty(STATES)
    cost = 0.0
    for n in range(measured.shape[0]):
        for c in range(8):
            e[n, c] = s[n, c] = math.nan
            if not math.isnan(measured[n, c]) and variances[c] < math.inf:
                e[n, c], s[n, c] = correct(x, P, measured[n, c], variances[c], c, H, gain)
                cost += 0.5 * (e[n, c] * e[n, c] / s[n, c] + math.log(s[n, c]))
        if not math.isfinite(cost):
            return math.inf
        if n + 1 < measured.shape[0]:
            carry(x, P, inputs[n], p, q, h, substeps, following, F, work)
    return cost


@compiled
def trace(x, P, inputs, measured, variances, p, q, h, substeps):
    """Filters a record and gives the means (n, 12) and covariances (n, 12, 12) after each sample."""
    count = measured.shape[0]
    means, covariances = np.empty((count, STATES)), np.empty((count, STATES, STATES))
    F, work, following = np.eye(STATES), np.empty((STATES, STATES)), np.empty(8)
    H, gain = np.empty(STATES), np.empty(STATES)
    for n in range(count):
        for c in range(8):
            if not math.isnan(measured[n, c]) and variances[c] < math.inf:
                correct(x, P, measured[n, c], variances[c], c, H, gain)
        means[n], covariances[n] = x, P
        if n + 1 < count:
            carry(x, P, inputs[n], p, q, h, substeps, following, F, work)
    return means, covariances


@compiled
def smooth(means, covariances, inputs, p, q, h, substeps):
    """Means (n, 12) of Rauch, Tung and Striebel's smoother from what `trace` gives; as given if one breaks."""
    count = means.shape[0]
    smoothed = means.copy()
    F, work, following = np.eye(STATES), np.empty((STATES, STATES)), np.empty(8)
    for n in range(count - 2, -1, -1):
        x, P = means[n].copy(), covariances[n].copy()
        total = F
        for part in range(substeps):
            step(x, inputs[n], p, h / substeps, following, F)
            propagate(F, P, q, h / substeps, work)
            total = F @ total if part else F.copy()
            x[:8] = following
        for i in range(STATES):
            P[i, i] += 1e-12  # states that are known have no variance
        L, positive = factor(P)
        if not positive:
            return means
        difference = smoothed[n + 1] - x
        solve(L, difference)
        for i in range(STATES):
            x[i] = 0.0
            for j in range(STATES):
                x[i] += total[j, i] * difference[j]
        for i in range(STATES):
            for j in range(STATES):
                smoothed[n, i] += covariances[n, i, j] * x[j]
    return smoothed
