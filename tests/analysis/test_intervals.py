"""Intervals: published ones, their defining equations, their coverage."""

import math

import numpy as np
import pytest

from auvsim.analysis.statistics import bootstrap, bootstrap_rms_ratio, newcombe, wilson
from auvsim.base.errors import InputError


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # Newcombe 1998, table I, method 3 (score without continuity correction), 95 %.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0000, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_against_published_intervals(successes: int, trials: int, low: float, high: float):
    assert wilson(successes, trials) == pytest.approx((low, high), abs=5e-5)  # printed to four digits


def test_wilson_bounds_are_where_the_score_test_turns():
    # By definition each bound p solves |successes/n - p| = z sqrt(p (1 - p) / n).
    for bound in wilson(37, 50, 0.9):
        assert abs(37 / 50 - bound) == pytest.approx(1.6448536 * math.sqrt(bound * (1 - bound) / 50), abs=1e-8)
    assert wilson(0, 0) == (0.0, 1.0)
    assert wilson(50, 50)[1] == 1.0


@pytest.mark.parametrize(("successes", "trials", "confidence"), [(-1, 3, 0.95), (4, 3, 0.95), (1, 3, 1.0)])
def test_wilson_refuses_impossible_counts(successes: int, trials: int, confidence: float):
    with pytest.raises(InputError, match="successes"):
        wilson(successes, trials, confidence)


@pytest.mark.parametrize(
    ("counts", "low", "high"),
    [
        # Newcombe 1998 (Stat. Med. 17:2635), table II, method 10: pairs 1 1, 1 0, 0 1, 0 0.
        ((36, 12, 2, 0), 0.0569, 0.3404),
        ((53, 2, 1, 0), -0.0636, 0.1050),
    ],
)
def test_newcombe_against_published_intervals(counts: tuple[int, ...], low: float, high: float) -> None:
    pairs = np.repeat([[1, 1], [1, 0], [0, 1], [0, 0]], counts, axis=0).astype(bool)
    assert newcombe(pairs) == pytest.approx((low, high), abs=5e-5)  # printed to four digits


@pytest.mark.parametrize("counts", [(36, 5, 2, 7), (20, 6, 3, 21), (10, 10, 12, 13), (5, 20, 15, 10)])
def test_newcombe_by_its_equations(counts: tuple[int, ...]) -> None:
    """Method 10 written out with the correlation as a number: ad - bc less n/2 but not below 0 if positive, else as is.

    The first two pairs of rates correlate by more, the third by less than the correction, the last against each other.
    """
    a, b, c, d = counts
    n = sum(counts)
    pairs = np.repeat([[1, 1], [1, 0], [0, 1], [0, 0]], counts, axis=0).astype(bool)
    difference = a * d - b * c
    numerator = difference if difference <= 0 else max(difference - n / 2, 0)
    phi = numerator / math.sqrt((a + b) * (c + d) * (a + c) * (b + d))
    (l1, u1), (l2, u2), p1, p2 = wilson(a + b, n), wilson(a + c, n), (a + b) / n, (a + c) / n
    lower = math.sqrt((p1 - l1) ** 2 - 2 * phi * (p1 - l1) * (u2 - p2) + (u2 - p2) ** 2)
    upper = math.sqrt((p2 - l2) ** 2 - 2 * phi * (p2 - l2) * (u1 - p1) + (u1 - p1) ** 2)
    assert newcombe(pairs) == pytest.approx((p1 - p2 - lower, p1 - p2 + upper), rel=1e-12)


def test_bootstrap_covers_the_mean() -> None:
    """95 % intervals of 300 skewed samples of 60, where BCa covers 0.929 (3000 samples: 0.920 to 0.939)."""
    samples = np.random.default_rng(3).exponential(size=(300, 60))
    inside = [low <= 1.0 <= high for low, high in map(bootstrap, samples)]
    assert np.mean(inside) == pytest.approx(0.93, abs=4 * math.sqrt(0.93 * 0.07 / 300))  # four deviations of 300 trials
    assert bootstrap(samples[0]) == bootstrap(samples[0])


def test_bootstrap_follows_the_skew() -> None:
    """Of a right-skewed sample the interval reaches further up than down, as Edgeworth's expansion has it.

    The standardised endpoints are shifted by skewness * (2 z^2 + 1) / (6 sqrt(n)) (Hall 1992, ch. 3); the percentile
    method has (z^2 - 1) instead, hence less than half of it.
    """
    values = np.random.default_rng(5).exponential(size=200)
    deviation = values.std()
    skewness = float(np.mean((values - values.mean()) ** 3)) / deviation**3
    ends = [(end - values.mean()) / (deviation / math.sqrt(200)) for end in bootstrap(values)]
    assert sum(ends) / 2.0 == pytest.approx(skewness * (2.0 * 1.96**2 + 1.0) / (6.0 * math.sqrt(200)), rel=0.25)


def test_bootstrap_of_a_normal_mean() -> None:
    """As wide as theory has it, within the noise of 10 000 resamples (1 % of the width) and of the sample's own."""
    values = np.random.default_rng(4).normal(2.0, 3.0, size=400)
    low, high = bootstrap(values)
    reach = 1.96 * values.std() / math.sqrt(400)
    assert (low, high) == pytest.approx((values.mean() - reach, values.mean() + reach), abs=0.05 * reach)


def test_bootstrap_of_equal_values() -> None:
    assert bootstrap(np.full(3, 0.5)) == (0.5, 0.5)


def test_bootstrap_of_a_ratio_of_rms_errors() -> None:
    """Against the delta method: the log of a ratio of two mean squares has a known deviation, which pairing narrows.

    The ratio r = sqrt(A / B) has d log r = (a / A - b / B) / 2 in each trial.
    """
    generator = np.random.default_rng(6)
    counts = generator.integers(50, 150, 300).astype(float)
    shared = generator.chisquare(20, 300) / 20.0
    totals = [counts * shared * scale * generator.chisquare(80, 300) / 80.0 for scale in (0.81, 1.0)]
    first, second = (np.stack([counts, total], axis=1) for total in totals)
    a, b = (total / total.mean() for total in totals)
    value = math.sqrt(totals[0].sum() / totals[1].sum())
    reach = 1.96 * value * float(np.std(0.5 * (a - b))) / math.sqrt(300)
    low, high = bootstrap_rms_ratio(first, second)
    assert (low, high) == pytest.approx((value - reach, value + reach), abs=0.1 * reach)
    assert bootstrap_rms_ratio(first, first) == (1.0, 1.0)
    assert all(math.isnan(end) for end in bootstrap_rms_ratio(first[:0], second[:0]))
