"""Confidence intervals of success rates, of paired rates and of means."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.randomness import stream

RESAMPLES = 10_000
MEMORY = 2_000_000  # resampled values in memory at a time


def wilson(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a success rate (Wilson 1927; Newcombe 1998, method 3); (0, 1) without trials.

    Raises:
        InputError: If the counts or the confidence are out of range.
    """
    if not (0 <= successes <= trials and 0.0 < confidence < 1.0):
        raise InputError(
            f"{successes} successes of {trials} at {confidence}: needs 0 <= successes <= trials, 0 < p < 1"
        )
    if trials == 0:
        return 0.0, 1.0
    interval = stats.binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)


def newcombe(pairs: NDArray[np.bool_], confidence: float = 0.95) -> tuple[float, float]:
    """Interval of the difference of two paired success rates (Newcombe 1998, Stat. Med. 17:2635, method 10).

    Args:
        pairs: Whether each of the two succeeded (n, 2).
        confidence: Probability that the interval holds the difference.
    """
    first, second = pairs[:, 0], pairs[:, 1]
    n = len(pairs)
    both, only, other = (int(np.sum(x)) for x in (first & second, first & ~second, ~first & second))
    neither = n - both - only - other
    p, q = (both + only) / n, (both + other) / n
    (p_low, p_high), (q_low, q_high) = wilson(both + only, n, confidence), wilson(both + other, n, confidence)
    product = (both + only) * (other + neither) * (both + other) * (only + neither)
    excess = both * neither - only * other
    if excess > 0:  # his continuity correction
        excess = max(excess - n / 2.0, 0.0)
    phi = excess / math.sqrt(product) if product else 0.0

    def reach(a: float, b: float) -> float:
        return math.sqrt(max(a * a - 2.0 * phi * a * b + b * b, 0.0))

    return p - q - reach(p - p_low, q_high - q), p - q + reach(p_high - p, q - q_low)


def bootstrap(values: Array, confidence: float = 0.95) -> tuple[float, float]:
    """Bias-corrected and accelerated bootstrap interval of the mean of independent values (n,) (Efron 1987).

    The same values give the same interval. Values that are all equal give an interval of no width.
    """
    if np.ptp(values) == 0.0:
        return float(values[0]), float(values[0])
    found = stats.bootstrap(
        (values,), np.mean, n_resamples=RESAMPLES, batch=max(1, MEMORY // len(values)), vectorized=True,
        confidence_level=confidence, method="BCa", rng=stream(0, 0, "bootstrap"),
    )  # fmt: skip
    return float(found.confidence_interval.low), float(found.confidence_interval.high)


def bootstrap_rms_ratio(first: Array, second: Array, confidence: float = 0.95) -> tuple[float, float]:
    """Bias-corrected and accelerated bootstrap interval of a ratio of two rms errors over the same trials.

    Args:
        first, second: Number of errors, 1 or more, and sum of their squares in each trial (n, 2).
        confidence: Probability that the interval holds the ratio.

    Returns:
        The interval, of no width where the ratio is the same in every trial; NaN without trials.
    """
    if not len(first):
        return math.nan, math.nan

    def ratio(count: Array, total: Array, other_count: Array, other_total: Array, axis: int = -1) -> Array:
        return np.sqrt(total.sum(axis) / count.sum(axis) / (other_total.sum(axis) / other_count.sum(axis)))

    samples = (*first.T, *second.T)
    each = ratio(*(column[:, np.newaxis] for column in samples))
    if np.ptp(each) == 0.0:
        return float(each[0]), float(each[0])
    found = stats.bootstrap(
        samples, ratio, n_resamples=RESAMPLES, batch=max(1, MEMORY // len(first)), vectorized=True, paired=True,
        confidence_level=confidence, method="BCa", rng=stream(0, 0, "bootstrap"),
    )  # fmt: skip
    return float(found.confidence_interval.low), float(found.confidence_interval.high)
