"""Intervals of success rates."""

import math
from statistics import NormalDist

from auvsim.base.errors import InputError


def wilson(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a success rate (Wilson 1927; Newcombe 1998, method 3); (0, 1) without trials.

    Raises:
        InputError: if the counts or the confidence are out of range.
    """
    if not (0 <= successes <= trials and 0.0 < confidence < 1.0):
        raise InputError(
            f"{successes} successes of {trials} at {confidence}: needs 0 <= successes <= trials, 0 < p < 1"
        )
    if trials == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + confidence / 2.0)
    rate, weight = successes / trials, z * z / trials
    centre = (rate + weight / 2.0) / (1.0 + weight)
    half = math.sqrt(rate * (1.0 - rate) * weight + weight * weight / 4.0) / (1.0 + weight)
    return max(centre - half, 0.0), min(centre + half, 1.0)
