"""Small dense loops of the extended Kalman filter: at eight states cheaper than a call of a linear algebra library."""

import math

import numpy as np

from estimators.core.compiling import compiled

OK, GATED, NOT_POSITIVE_DEFINITE, NOT_FINITE = 0, 1, 2, 3  # what `correct` reports


@compiled
def wrap(angle):
    """The same angle in (-pi, pi] [rad]."""
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


@compiled
def propagate(F, P, q, h, work):
    """P <- F P F' + h/2 (F diag(q) F' + diag(q)), in place; q are power spectral densities, h is the step [s]."""
    n = q.size
    for i in range(n):
        P[i, i] += 0.5 * h * q[i]
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
        for k in range(n):
            f = F[i, k]
            if f != 0.0:
                for j in range(n):
                    work[i, j] += f * P[k, j]
    for i in range(n):
        for j in range(i, n):
            total = 0.0
            for k in range(n):
                total += work[i, k] * F[j, k]
            P[i, j] = total
            P[j, i] = total
        P[i, i] += 0.5 * h * q[i]


@compiled
def is_finite(mean, covariance):
    """Whether all elements are finite: a sum is so only if its terms are."""
    return math.isfinite(mean.sum()) and math.isfinite(covariance.sum())


@compiled
def factor(S):
    """Cholesky's lower factor of S (m, m), and whether S is positive definite."""
    m = S.shape[0]
    L = np.zeros((m, m))
    for i in range(m):
        for j in range(i + 1):
            total = S[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = total / L[j, j]
            elif total > 0.0:
                L[i, i] = math.sqrt(total)
            else:
                return L, False
    return L, True


@compiled
def solve(L, b):
    """Solves L L' x = b for a vector, in place."""
    m = L.shape[0]
    for i in range(m):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


@compiled
def correct(mean, covariance, H, residual, R, gate):
    """Kalman correction in Joseph's form.

    Returns (mean, covariance, gain (n, m), innovation covariance (m, m), normalised innovation squared, status). If the
    normalised innovation squared exceeds `gate` the belief is returned as it came, with status GATED.
    """
    n, m = mean.size, residual.size
    HP = np.zeros((m, n))
    for a in range(m):
        for k in range(n):
            if H[a, k] != 0.0:
                for j in range(n):
                    HP[a, j] += H[a, k] * covariance[k, j]
    S = R.copy()
    for a in range(m):
        for b in range(m):
            for k in range(n):
                S[a, b] += HP[a, k] * H[b, k]
    K = np.zeros((n, m))
    L, positive = factor(S)
    if not positive:
        return mean, covariance, K, S, math.nan, NOT_POSITIVE_DEFINITE
    weighted = residual.copy()
    solve(L, weighted)
    nis = 0.0
    for a in range(m):
        nis += weighted[a] * residual[a]
    for i in range(n):
        for a in range(m):
            K[i, a] = HP[a, i]
        solve(L, K[i])
    if not nis <= gate:
        return mean, covariance, K, S, nis, GATED
    x = mean.copy()
    for i in range(n):
        for a in range(m):
            x[i] += K[i, a] * residual[a]
    P = joseph(covariance, HP, H, K, R)
    return x, P, K, S, nis, OK if is_finite(x, P) else NOT_FINITE


@compiled
def correct_angle(mean, covariance, H, value, R):
    """`correct` by an angle (1,) that is H x but for whole turns; returns only (mean, covariance, NIS, status)."""
    expected = 0.0
    for j in range(mean.size):
        if H[0, j] != 0.0:
            expected += H[0, j] * mean[j]
    x, P, _, _, nis, status = correct(mean, covariance, H, np.array([wrap(value[0] - expected)]), R, math.inf)
    return x, P, nis, status


@compiled
def correct_angle_each(means, covariances, H, value, R):
    """`correct_angle` of each of several beliefs (m, n), (m, n, n): their means, covariances, NIS (m,) and status.

    The status is OK, or that of the first belief which cannot be corrected; the others are then not looked at.
    """
    X, P, nis = np.empty_like(means), np.empty_like(covariances), np.empty(means.shape[0])
    for k in range(means.shape[0]):
        X[k], P[k], nis[k], status = correct_angle(means[k], covariances[k], H, value, R)
        if status != OK:
            return X, P, nis, status
    return X, P, nis, OK


@compiled
def joseph(covariance, HP, H, K, R):
    """(I - K H) P (I - K H)' + K R K', made of products of size n m only."""
    n, m = K.shape
    A = covariance.copy()
    for i in range(n):
        for a in range(m):
            for j in range(n):
                A[i, j] -= K[i, a] * HP[a, j]
    B = np.zeros((n, m))  # (I - K H) P H' - K R
    for i in range(n):
        for a in range(m):
            for k in range(n):
                B[i, a] += A[i, k] * H[a, k]
            for b in range(m):
                B[i, a] -= K[i, b] * R[b, a]
    P = np.empty((n, n))
    for i in range(n):
        for j in range(i, n):
            total = A[i, j]
            for a in range(m):
                total -= B[i, a] * K[j, a]
            P[i, j] = total
            P[j, i] = total
    return P


@compiled
def merge(means, covariances, weights, angles):
    """Mean (n,) and covariance (n, n) of a mixture of Gaussians (m, n), (m, n, n); `angles` are wrapped states."""
    m, n = means.shape
    offsets = means - means[0]
    for k in range(m):
        for index in angles:
            offsets[k, index] = wrap(offsets[k, index])
    centre = np.zeros(n)
    for k in range(m):
        for i in range(n):
            centre[i] += weights[k] * offsets[k, i]
    P = np.zeros((n, n))
    for k in range(m):
        for i in range(n):
            a = offsets[k, i] - centre[i]
            for j in range(i, n):
                P[i, j] += weights[k] * (covariances[k, i, j] + a * (offsets[k, j] - centre[j]))
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i]
    mean = means[0] + centre
    for index in angles:
        mean[index] = wrap(mean[index])
    return mean, P


@compiled
def mix(means, covariances, weights, transition, following, angles):
    """Moments of each mode (m, n), (m, n, n) after changes of mode by `transition` (m, m), to probabilities (m,)."""
    X, P = np.empty_like(means), np.empty_like(covariances)
    for j in range(weights.size):
        X[j], P[j] = merge(means, covariances, weights * transition[:, j] / following[j], angles)
    return X, P


@compiled
def transition(generator, duration):
    """exp(generator duration), probabilities (m, m) of a Markov chain's changes in `duration` from its rates (m, m).

    Taylor's series of so short a part that 16 terms are exact, squared up again. SciPy's exponential asks LAPACK, whose
    threads take milliseconds over two modes where cores are busy.
    """
    halvings, fastest = 0, duration * np.abs(np.diag(generator)).max()
    while fastest > 0.25:
        fastest *= 0.5
        halvings += 1
    part = generator * (duration * 0.5**halvings)
    total, term = np.eye(generator.shape[0]), np.eye(generator.shape[0])
    for n in range(1, 17):
        term = term @ part / n
        total += term
    for _ in range(halvings):
        total = total @ total
    return total


@compiled
def sigma_points(mean, covariance, centre):
    """Points (2n + 1, n), the mean first, their weights, that of the mean `centre`; whether the covariance allows."""
    n = mean.size
    L, positive = factor(covariance)
    share = (1.0 - centre) / (2 * n)
    points, weights = np.empty((2 * n + 1, n)), np.full(2 * n + 1, share)
    points[0], weights[0] = mean, centre
    for k in range(n):
        for i in range(n):
            offset = L[i, k] / math.sqrt(2.0 * share)
            points[1 + k, i] = mean[i] + offset
            points[1 + n + k, i] = mean[i] - offset
    return points, weights, positive


@compiled
def moments(points, weights, noise):
    """Mean (n,) and covariance (n, n) of weighted points (k, n), with that of `noise` added."""
    k, n = points.shape
    mean, P = np.zeros(n), noise.copy()
    for a in range(k):
        for i in range(n):
            mean[i] += weights[a] * points[a, i]
    for a in range(k):
        for i in range(n):
            for j in range(i, n):
                P[i, j] += weights[a] * (points[a, i] - mean[i]) * (points[a, j] - mean[j])
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i]
    return mean, P
