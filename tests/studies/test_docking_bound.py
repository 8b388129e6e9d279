"""The default estimator beside its bound: the interval of a ratio, and one trial."""

from itertools import pairwise

import numpy as np
import pytest

from auvsim.studies.docking_bound import BANDS, ratio_of_roots, table, trial


def test_interval_of_a_ratio_covers_it() -> None:
    """Sums of 40 squares about bounds that differ by trial, true ratio 1.2: 95 % of 1000 intervals, within 3 sigma."""
    generator, covered = np.random.default_rng(2), 0
    for _ in range(1000):
        bounds = generator.uniform(0.5, 2.0, 40)
        ratio, half = ratio_of_roots(1.2**2 * bounds * generator.chisquare(20, 40) / 20.0, bounds)
        covered += abs(ratio - 1.2) < half
    assert covered / 1000 == pytest.approx(0.95, abs=0.025)


def test_a_trial_beside_its_bounds() -> None:
    """Less process noise makes the bound less; near the dock, where fixes are exact, both fall."""
    found = trial(7, 0)
    assert len(found) == len(BANDS)
    for near, far in pairwise(found):
        assert 0.0 < near.quiet / near.count < near.bound / near.count < far.bound / far.count
        assert near.quiet / near.count < far.quiet / far.count
    assert table([found], 7).row_count == len(BANDS)
