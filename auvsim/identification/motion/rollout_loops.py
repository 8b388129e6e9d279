"""Many open-loop predictions of a record, and what spreads them, in compiled loops; see `engine` for what is in front.

In front of this text stand the terms' `linearise` and all of `segment_loops`.
"""

from typing import TYPE_CHECKING

import numpy as np

from estimators.core.compiling import compiled

if TYPE_CHECKING:
    from auvsim.identification.segment_loops import advance, workspace


@compiled
def predict(first, begin, marks, inputs, p, free, current, h, substeps, spread):
    """States (starts, marks, 6), distance run through the water, and what spreads the predictions.

    Args:
        first, begin: First states (starts, 6) and their samples (starts,).
        marks: Samples after its beginning at which a prediction is read (marks,), increasing.
        inputs: (n, 6) of the record.
        p, free: All coefficients, and the places of those whose sensitivity is wanted (k,).
        current: North, east of each prediction (starts, 2) [m/s].
        h, substeps: Step of the record [s], and of how many it is made.
        spread: Whether sensitivities and covariances are wanted.

    Returns:
        states; distance (starts, marks); sensitivities by `free` (starts, marks, 6, k); covariances (starts, marks, 4,
        6, 6) of unit white noise in surge, sway and yaw, and of a first state whose velocities, heading and position
        have unit variance in (1 m, 0.02 rad, 0.02 m/s, 0.02 m/s, 0.005 rad/s).
    """
    count, m, k = first.shape[0], marks.size, free.size if spread else 0
    none = np.empty(0, dtype=np.int64)
    chosen = free if spread else none
    states, distance = np.full((count, m, 6), np.nan), np.full((count, m), np.nan)
    sensitivity, covariance = np.zeros((count, m, 6, k)), np.zeros((count, m, 4, 6, 6))
    nuisance, x = np.zeros(6), np.empty(6)
    S, F = np.zeros((6, 4 + k)) if spread else np.zeros((6, 0)), np.eye(6)
    work = workspace(k, p.size)
    P = np.zeros((4, 6, 6))
    for a in range(count):
        x[:], nuisance[:2] = first[a], current[a]
        P[:], S[:] = 0.0, 0.0
        P[3] = np.diag(np.array([1.0, 1.0, 4e-4, 4e-4, 4e-4, 2.5e-5]))
        run, at = 0.0, 0
        for n in range(begin[a], begin[a] + marks[m - 1] + 1):
            if n - begin[a] == marks[at]:
                states[a, at], distance[a, at] = x, run
                if spread:
                    sensitivity[a, at] = S[:, 4:]
                    covariance[a, at] = P
                at += 1
                if at == m:
                    break
            if spread:
                S[:, :4] = 0.0
                for i in range(4):
                    S[2 + i, i] = 1.0
            run += h * np.hypot(x[3], x[4])
            for _ in range(substeps):
                advance(x, S, inputs[n], p, chosen, nuisance, h / substeps, work)
            if not np.isfinite(x.sum()) or np.abs(x[3:]).max() > 1e3:
                break
            if spread:
                F[:, 2:] = S[:, :4]
                for b in range(4):
                    P[b] = F @ P[b] @ F.T
                    if b < 3:
                        P[b, 3 + b, 3 + b] += h
    return states, distance, sensitivity, covariance
