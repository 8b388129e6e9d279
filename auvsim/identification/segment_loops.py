"""Segments of a record folded into normal equations, in compiled loops; see `compiled` for the model in front of them.

Each segment starts from an own, free state; Runge-Kutta's fourth-order steps carry the state and its derivatives by
the first heading, the first velocities and the free parameters (forward sensitivities; those by the first position and
by the current are known in closed form). Unknowns of a segment, in columns: first state (6), free parameters (k),
nuisances (6) in the order of `fit.NUISANCES`.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from estimators.core.compiling import compiled
from estimators.core.loops import factor, solve, wrap

ROUNDING = 1e-13  # share of a diagonal that sums of squares may have lost; keeps an unstable trial's factor real

if TYPE_CHECKING:  # CasADi writes it in front of this text

    def linearise(nu, u, p, l, A, B) -> None:
        """Accelerations l (3,) of nu (3,), and their derivatives A (3, 3) by nu and B (3, 30) by the parameters."""


@compiled
def rate(stage, j, A, B, turn, s2, s3, s4, s5):
    """Time derivatives of one column's sensitivities at a stage; without the heading's, which is s5.

    Args:
        stage, j: Of Runge and Kutta (0 to 3), and the column.
        A, B: Derivatives of accelerations by velocities (4, 3, 3), and by what the columns stand for (4, 3, columns).
        turn: Cosine and sine of the heading, velocity through the water north and east (4, 4).
        s2, s3, s4, s5: Sensitivities of heading, surge, sway and yaw rate there.
    """
    cosine, sine, north, east = turn[stage, 0], turn[stage, 1], turn[stage, 2], turn[stage, 3]
    return (
        cosine * s3 - sine * s4 - east * s2,
        sine * s3 + cosine * s4 + north * s2,
        A[stage, 0, 0] * s3 + A[stage, 0, 1] * s4 + A[stage, 0, 2] * s5 + B[stage, 0, j],
        A[stage, 1, 0] * s3 + A[stage, 1, 1] * s4 + A[stage, 1, 2] * s5 + B[stage, 1, j],
        A[stage, 2, 0] * s3 + A[stage, 2, 1] * s4 + A[stage, 2, 2] * s5 + B[stage, 2, j],
    )


@compiled
def workspace(k, size):
    """What `advance` writes in, of k free parameters among `size`."""
    stages = np.zeros((4, 3, 3)), np.zeros((4, 3, 4 + k)), np.empty((4, 4))
    return np.empty(6), np.empty(6), np.zeros(3), np.zeros((3, size)), *stages


@compiled
def advance(x, S, u, p, free, nuisance, h, work):
    """One step of Runge and Kutta of length `h` [s], in place; a column goes through all four stages at once."""
    xs, total, l, B, As, Bs, turn = work
    for i in range(6):
        xs[i], total[i] = x[i], 0.0
    for stage in range(4):
        linearise(xs[3:], u, p, l, As[stage], B)
        cosine, sine = math.cos(xs[2]), math.sin(xs[2])
        north, east = cosine * xs[3] - sine * xs[4], sine * xs[3] + cosine * xs[4]
        turn[stage, 0], turn[stage, 1], turn[stage, 2], turn[stage, 3] = cosine, sine, north, east
        for i in range(3):
            for j in range(free.size):
                Bs[stage, i, 4 + j] = B[i, free[j]]
        weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
        reach = h if stage == 2 else 0.5 * h
        total[0] += weight * (north + nuisance[0])
        total[1] += weight * (east + nuisance[1])
        total[2] += weight * xs[5]
        xs[2] = x[2] + reach * xs[5]
        for i in range(3):
            total[3 + i] += weight * l[i]
            xs[3 + i] = x[3 + i] + reach * l[i]
    for i in range(6):
        x[i] += total[i]
    half, third, sixth = 0.5 * h, h / 3.0, h / 6.0
    for j in range(S.shape[1]):
        s2, s3, s4, s5 = S[2, j], S[3, j], S[4, j], S[5, j]
        a0, a1, a3, a4, a5 = rate(0, j, As, Bs, turn, s2, s3, s4, s5)
        r1 = s5 + half * a5
        b0, b1, b3, b4, b5 = rate(1, j, As, Bs, turn, s2 + half * s5, s3 + half * a3, s4 + half * a4, r1)
        r2 = s5 + half * b5
        c0, c1, c3, c4, c5 = rate(2, j, As, Bs, turn, s2 + half * r1, s3 + half * b3, s4 + half * b4, r2)
        r3 = s5 + h * c5
        d0, d1, d3, d4, d5 = rate(3, j, As, Bs, turn, s2 + h * r2, s3 + h * c3, s4 + h * c4, r3)
        S[0, j] += sixth * (a0 + d0) + third * (b0 + c0)
        S[1, j] += sixth * (a1 + d1) + third * (b1 + c1)
        S[2, j] = s2 + sixth * (s5 + r3) + third * (r1 + r2)
        S[3, j] = s3 + sixth * (a3 + d3) + third * (b3 + c3)
        S[4, j] = s4 + sixth * (a4 + d4) + third * (b4 + c4)
        S[5, j] = s5 + sixth * (a5 + d5) + third * (b5 + c5)


@compiled
def observe(x, S, elapsed, nuisance, k, here, y, J):
    """What the channels show (8,), and of those that are `here` (8,) its derivatives J (8, 12 + k)."""
    cn, ce, gyro, compass, misalignment, scale = nuisance
    end, columns = 6 + k, S.shape[1]
    cosine, sine = math.cos(x[2]), math.sin(x[2])
    gain = 1.0 + scale
    a, b = gain * math.cos(misalignment), gain * math.sin(misalignment)
    over_u, over_v = x[3] + cosine * cn + sine * ce, x[4] - sine * cn + cosine * ce
    y[0], y[1], y[2], y[5] = x[0], x[1], x[2] + compass, x[5] + gyro
    y[3], y[4] = a * x[3] + b * x[4], a * x[4] - b * x[3]
    y[6], y[7] = a * over_u + b * over_v, a * over_v - b * over_u
    for i in (0, 1, 2, 5):
        if here[i]:
            for j in range(columns):
                J[i, 2 + j] = S[i, j]
    if here[3] or here[4]:
        for j in range(columns):
            J[3, 2 + j] = a * S[3, j] + b * S[4, j]
            J[4, 2 + j] = a * S[4, j] - b * S[3, j]
    if here[6] or here[7]:
        du, dv = -sine * cn + cosine * ce, -cosine * cn - sine * ce  # of the current in the body's axes, by heading
        for j in range(columns):
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
def normal_equations(
    starts, bounds, inputs, measured, weights, p, free, nuisance, h, substeps, loss, threshold, residuals
):
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
    here = np.zeros(8, dtype=np.bool_)
    work = workspace(k, p.size)
    cost = 0.0
    for s in range(count):
        x[:] = starts[s]
        S[:] = 0.0
        for i in range(4):
            S[2 + i, i] = 1.0
        rows = 0
        for n in range(bounds[s], bounds[s + 1]):
            for c in range(8):
                here[c] = weights[c] != 0.0 and not math.isnan(measured[n, c])
            observe(x, S, (n - bounds[s]) * h, nuisance, k, here, y, J)
            rows, part = add_sample(
                measured[n], y, J, weights, here, loss, threshold, residuals[n], R, scaled, rows, H[s], g[s]
            )
            cost += part
            if n + 1 < bounds[s + 1]:
                for _ in range(substeps):
                    advance(x, S, inputs[n], p, free, nuisance, h / substeps, work)
                if not math.isfinite(x.sum()):
                    return math.inf, H, g
        R[rows:], scaled[rows:] = 0.0, 0.0
        rank8_update(H[s], g[s], R, scaled)
    return (cost if math.isfinite(H.sum()) else math.inf), H, g


@compiled
def add_sample(measured, y, J, weights, here, loss, threshold, residuals, R, scaled, rows, H, g):
    """Adds what is `here` of a sample to the weighted rows R (8, w), and these to H and g whenever they are full.

    Returns:
        How many rows wait, and half the cost of the sample.
    """
    cost = 0.0
    for c in range(8):
        residuals[c] = math.nan
        if here[c]:
            e = measured[c] - y[c]
            residuals[c] = weights[c] * (wrap(e) if c == 2 else e)
            square, trust = rho(residuals[c] ** 2, loss, threshold)
            cost += 0.5 * square
            root = math.sqrt(trust)
            scaled[rows] = root * residuals[c]
            for j in range(g.size):
                R[rows, j] = root * weights[c] * J[c, j]
            rows += 1
            if rows == 8:
                rank8_update(H, g, R, scaled)
                rows = 0
    return rows, cost


@compiled
def rank8_update(H, g, R, e):
    """Adds R' R (upper triangle) and R' e of eight weighted rows; all eight at once: to load H is what costs time."""
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
        Sums over the segments, H (t, t) and g (t,), the back-substitution of the first states,
        (s, 6, t + 1), and whether all could be eliminated.
    """
    count, width = g.shape
    t = width - 6
    total, gradient = np.zeros((t, t)), np.zeros(t)
    back_substitution = np.empty((count, 6, t + 1))
    column = np.empty(6)
    block = np.empty((6, 6))
    for s in range(count):
        for i in range(6):
            for j in range(i, 6):
                block[i, j] = block[j, i] = H[s, i, j]
            block[i, i] *= 1.0 + damping + ROUNDING
        L, positive = factor(block)
        if not positive:
            return total, gradient, back_substitution, False
        for j in range(t + 1):
            for i in range(6):
                column[i] = H[s, i, 6 + j] if j < t else g[s, i]
            solve(L, column)
            for i in range(6):
                back_substitution[s, i, j] = column[i]
        for i in range(t):
            for j in range(i, t):
                correction = 0.0
                for a in range(6):
                    correction += H[s, a, 6 + i] * back_substitution[s, a, j]
                total[i, j] += H[s, 6 + i, 6 + j] - correction
            correction = 0.0
            for a in range(6):
                correction += H[s, a, 6 + i] * back_substitution[s, a, t]
            gradient[i] += g[s, 6 + i] - correction
    for i in range(t):
        for j in range(i):
            total[i, j] = total[j, i]
    return total, gradient, back_substitution, True


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
