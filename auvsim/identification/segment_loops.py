"""Segments of a record folded into normal equations, in compiled loops; see `compiled` for the model in front of them.

Each segment starts from an own, free state; Runge-Kutta's fourth-order steps carry the state and its derivatives by
the first heading, the first velocities and the free parameters (forward sensitivities; those by the first position and
by the current are known in closed form). Unknowns of a segment, in columns: first state (6), free parameters (k),
nuisances (6) in the order of `fit.NUISANCES`.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from estimators.compiling import compiled
from estimators.loops import factor, solve, wrap

ROUNDING = 1e-13  # share of a diagonal that sums of squares may have lost; keeps an unstable trial's factor real

if TYPE_CHECKING:  # CasADi writes it in front of this text

    def linearise(nu, u, p, l, A, B) -> None:
        """Accelerations l (3,) of nu (3,), and their derivatives A (3, 3) by nu and B (3, 30) by the parameters."""


@compiled
def slopes(x, S, u, p, free, nuisance, scratch, K, dK):
    """Time derivatives K (6,) of the state and dK (6, columns) of its sensitivities S by heading, nu and parameters."""
    l, A, B = scratch
    linearise(x[3:], u, p, l, A, B)
    cosine, sine = math.cos(x[2]), math.sin(x[2])
    through_north, through_east = cosine * x[3] - sine * x[4], sine * x[3] + cosine * x[4]
    K[0], K[1], K[2] = through_north + nuisance[0], through_east + nuisance[1], x[5]
    K[3], K[4], K[5] = l[0], l[1], l[2]
    for j in range(S.shape[1]):
        dK[0, j] = cosine * S[3, j] - sine * S[4, j] - through_east * S[2, j]
        dK[1, j] = sine * S[3, j] + cosine * S[4, j] + through_north * S[2, j]
        dK[2, j] = S[5, j]
    for i in range(3):
        a, b, c = A[i, 0], A[i, 1], A[i, 2]
        for j in range(S.shape[1]):
            dK[3 + i, j] = a * S[3, j] + b * S[4, j] + c * S[5, j]
        for j in range(free.size):
            dK[3 + i, 4 + j] += B[i, free[j]]


@compiled
def advance(x, S, u, p, free, nuisance, h, scratch, work):
    """One step of Runge and Kutta of length `h` [s], in place."""
    xs, K, total, Ss, dK, dtotal = work
    columns = S.shape[1]
    for i in range(6):
        xs[i], total[i] = x[i], 0.0
        for j in range(columns):
            Ss[i, j], dtotal[i, j] = S[i, j], 0.0
    for stage in range(4):
        slopes(xs, Ss, u, p, free, nuisance, scratch, K, dK)
        weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
        reach = h if stage == 2 else 0.5 * h
        for i in range(6):
            total[i] += weight * K[i]
            xs[i] = x[i] + reach * K[i]
            for j in range(columns):
                dtotal[i, j] += weight * dK[i, j]
                Ss[i, j] = S[i, j] + reach * dK[i, j]
    for i in range(6):
        x[i] += total[i]
        for j in range(columns):
            S[i, j] += dtotal[i, j]


@compiled
def observe(x, S, elapsed, nuisance, k, y, J):
    """What the channels show (8,) and its derivatives J (8, 12 + k); `elapsed` is the time since the segment began."""
    cn, ce, gyro, compass, misalignment, scale = nuisance
    end, columns = 6 + k, S.shape[1]
    cosine, sine = math.cos(x[2]), math.sin(x[2])
    gain = 1.0 + scale
    a, b = gain * math.cos(misalignment), gain * math.sin(misalignment)
    over_u, over_v = x[3] + cosine * cn + sine * ce, x[4] - sine * cn + cosine * ce
    y[0], y[1], y[2], y[5] = x[0], x[1], x[2] + compass, x[5] + gyro
    y[3], y[4] = a * x[3] + b * x[4], a * x[4] - b * x[3]
    y[6], y[7] = a * over_u + b * over_v, a * over_v - b * over_u
    du, dv = -sine * cn + cosine * ce, -cosine * cn - sine * ce  # of the current in the body's axes, by heading
    for j in range(columns):
        for i in range(3):
            J[i, 2 + j] = S[i, j]
        J[5, 2 + j] = S[5, j]
        J[3, 2 + j] = a * S[3, j] + b * S[4, j]
        J[4, 2 + j] = a * S[4, j] - b * S[3, j]
        turned_u, turned_v = S[3, j] + du * S[2, j], S[4, j] + dv * S[2, j]
        J[6, 2 + j] = a * turned_u + b * turned_v
        J[7, 2 + j] = a * turned_v - b * turned_u
    J[0, 0], J[1, 1] = 1.0, 1.0
    J[0, end], J[1, end + 1] = elapsed, elapsed
    J[6, end], J[6, end + 1] = a * cosine - b * sine, a * sine + b * cosine
    J[7, end], J[7, end + 1] = -a * sine - b * cosine, a * cosine - b * sine
    J[5, end + 2], J[2, end + 3] = 1.0, 1.0
    J[3, end + 4], J[4, end + 4], J[6, end + 4], J[7, end + 4] = y[4], -y[3], y[7], -y[6]
    for i in (3, 4, 6, 7):
        J[i, end + 5] = y[i] / gain


@compiled
def rho(square, loss, threshold):
    """Twice the loss of a squared weighted residual and its weight; loss 0: squares, 1: Huber, 2: Cauchy."""
    limit = threshold * threshold
    if loss == 1 and square > limit:
        root = math.sqrt(square)
        return 2.0 * threshold * root - limit, threshold / root
    if loss == 2:
        return limit * math.log1p(square / limit), 1.0 / (1.0 + square / limit)
    return square, 1.0


@compiled
def fold(starts, bounds, inputs, measured, weights, p, free, nuisance, h, substeps, loss, threshold, residuals):
    """Half the cost of a record's segments, their Gauss-Newton matrices and gradients, and the weighted residuals.

    Args:
        starts: First states (s, 6) of the segments.
        bounds: Samples at which they begin, and the end (s + 1,).
        inputs, measured, weights: (n, 2), (n, 8), and the inverse deviations (8,); a weight of zero leaves out.
        p, free, nuisance: All parameters (30,), which are free (k,), nuisances (6,).
        h, substeps: Step of the record [s], and of how many it is made.
        loss, threshold: As `rho`.
        residuals: (n, 8), filled with weighted residuals, measured less expected, NaN where nothing was measured.

    Returns:
        Cost; H (s, 6 + t, 6 + t), upper triangles, with t = k + 6; g (s, 6 + t), the descent direction J' r; all are
        sums of a segment. The cost is infinite where the motion is not finite.
    """
    k, count = free.size, starts.shape[0]
    width = 12 + k
    H, g = np.zeros((count, width, width)), np.zeros((count, width))
    S, J, y, x = np.zeros((6, 4 + k)), np.zeros((8, width)), np.empty(8), np.empty(6)
    R, scaled = np.zeros((8, width)), np.zeros(8)  # rows and residuals with all their weights
    scratch = np.zeros(3), np.zeros((3, 3)), np.zeros((3, p.size))
    work = np.empty(6), np.empty(6), np.empty(6), np.empty_like(S), np.empty_like(S), np.empty_like(S)
    cost = 0.0
    for s in range(count):
        x[:] = starts[s]
        S[:] = 0.0
        for i in range(4):
            S[2 + i, i] = 1.0
        for n in range(bounds[s], bounds[s + 1]):
            observe(x, S, (n - bounds[s]) * h, nuisance, k, y, J)
            for c in range(8):
                residuals[n, c] = math.nan
                e = measured[n, c] - y[c]
                if weights[c] == 0.0 or math.isnan(e):
                    scaled[c] = 0.0
                    for j in range(width):
                        R[c, j] = 0.0
                    continue
                residuals[n, c] = weights[c] * (wrap(e) if c == 2 else e)
                loss_here, trust = rho(residuals[n, c] ** 2, loss, threshold)
                cost += 0.5 * loss_here
                root = math.sqrt(trust)
                scaled[c] = root * residuals[n, c]
                for j in range(width):
                    R[c, j] = root * weights[c] * J[c, j]
            gather(H[s], g[s], R, scaled)
            if n + 1 < bounds[s + 1]:
                for _ in range(substeps):
                    advance(x, S, inputs[n], p, free, nuisance, h / substeps, scratch, work)
                if not math.isfinite(x.sum()):
                    return math.inf, H, g
    return (cost if math.isfinite(H.sum()) else math.inf), H, g


@compiled
def gather(H, g, R, e):
    """Adds R' R (upper triangle) and R' e of eight weighted rows; all eight at once, since H is what costs time."""
    r0, r1, r2, r3, r4, r5, r6, r7 = R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7]
    for i in range(g.size):
        a, b, c, d = r0[i], r1[i], r2[i], r3[i]
        w, x, y, z = r4[i], r5[i], r6[i], r7[i]
        g[i] += a * e[0] + b * e[1] + c * e[2] + d * e[3] + w * e[4] + x * e[5] + y * e[6] + z * e[7]
        row = H[i]
        for j in range(i, g.size):
            row[j] += a * r0[j] + b * r1[j] + c * r2[j] + d * r3[j] + w * r4[j] + x * r5[j] + y * r6[j] + z * r7[j]


@compiled
def eliminate(H, g, damping):
    """Takes the first states out of segments' equations (Schur complement).

    Args:
        H, g: (s, 6 + t, 6 + t), upper triangles, and (s, 6 + t).
        damping: Share of the diagonal added to that of the first states.

    Returns:
        Sums over the segments, H (t, t) and g (t,), what brings the first states back, (s, 6, t + 1), and whether all
        could be eliminated.
    """
    count, width = g.shape
    t = width - 6
    total, gradient = np.zeros((t, t)), np.zeros(t)
    back = np.empty((count, 6, t + 1))
    column = np.empty(6)
    block = np.empty((6, 6))
    for s in range(count):
        for i in range(6):
            for j in range(i, 6):
                block[i, j] = block[j, i] = H[s, i, j]
            block[i, i] *= 1.0 + damping + ROUNDING
        L, positive = factor(block)
        if not positive:
            return total, gradient, back, False
        for j in range(t + 1):
            for i in range(6):
                column[i] = H[s, i, 6 + j] if j < t else g[s, i]
            solve(L, column)
            for i in range(6):
                back[s, i, j] = column[i]
        for i in range(t):
            for j in range(i, t):
                correction = 0.0
                for a in range(6):
                    correction += H[s, a, 6 + i] * back[s, a, j]
                total[i, j] += H[s, 6 + i, 6 + j] - correction
            correction = 0.0
            for a in range(6):
                correction += H[s, a, 6 + i] * back[s, a, t]
            gradient[i] += g[s, 6 + i] - correction
    for i in range(t):
        for j in range(i):
            total[i, j] = total[j, i]
    return total, gradient, back, True


@compiled
def regressors(states, inputs, p, free):
    """Accelerations (n, 3) along states (n, >= 6) and their derivatives (n, 3, k) by the free parameters."""
    count, k = states.shape[0], free.size
    base, terms = np.empty((count, 3)), np.empty((count, 3, k))
    l, A, B = np.zeros(3), np.zeros((3, 3)), np.zeros((3, p.size))
    for n in range(count):
        linearise(states[n, 3:6], inputs[n], p, l, A, B)
        for i in range(3):
            base[n, i] = l[i]
            for j in range(k):
                terms[n, i, j] = B[i, free[j]]
    return base, terms
