"""The information of a history of inputs, in a compiled loop; see `compiled` for what stands in front of it."""

import math
from typing import TYPE_CHECKING

import numpy as np

from estimators.core.compiling import compiled

if TYPE_CHECKING:
    from auvsim.identification.segment_loops import advance, observe, workspace


@compiled
def accumulate(x, S, M, inputs, weights, p, free, h):
    """Carries state and sensitivities on through inputs (n, 2), each held for `h` [s], and adds what is measured.

    Args:
        x, S: State (6,) and its sensitivities (6, k + 4) as in `segment_loops`, in place.
        M: Information (k + 12, k + 12) on first state, free parameters and constant errors; its upper triangle grows.
        inputs: Rudder [rad] and shaft speed [rad/s] of each step (n, 2).
        weights: Inverse deviations (8,) of the channels in a step.
        p, free: All parameters (30,), which are free (k,).
        h: Step [s].

    Returns:
        The largest distance from the origin [m].
    """
    k = free.size
    width = k + 12
    y, J, nuisance = np.empty(8), np.zeros((8, width)), np.zeros(6)
    work, everything = workspace(k, p.size), np.ones(8, dtype=np.bool_)
    reach = 0.0
    for t in range(inputs.shape[0]):
        advance(x, S, inputs[t], p, free, nuisance, h, work)
        observe(x, S, 0.0, nuisance, k, everything, y, J)
        for c in range(2, 8):  # no positions
            square = weights[c] * weights[c]
            for i in range(width):
                if J[c, i] != 0.0:
                    factor = square * J[c, i]
                    for j in range(i, width):
                        M[i, j] += factor * J[c, j]
        reach = max(reach, math.hypot(x[0], x[1]))
    return reach
