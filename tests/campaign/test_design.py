"""Stratified draws: every stratum once, the same whenever they are asked for, more even than independent ones."""

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from auvsim.campaign import design

KEYS = ("a", "b", "c")


def points(kind: design.Sampling, seed: int, trials: int, strata: int, keys: tuple[str, ...] = KEYS) -> np.ndarray:
    """(trials, keys) quantiles."""
    drawn = [design.quantiles(kind, seed, trial, keys, strata) for trial in range(trials)]
    return np.array([[each[key] for key in keys] for each in drawn])


def test_hypercube_has_one_trial_in_each_stratum() -> None:
    """Of each key and of each hypercube; keys and hypercubes are not in the same order."""
    drawn = points("latin_hypercube", 3, 60, 20)
    for block in np.split(drawn, 3):
        assert (np.sort(np.floor(20 * block), axis=0) == np.arange(20)[:, None]).all()
    assert not np.array_equal(np.floor(20 * drawn[:20]), np.floor(20 * drawn[20:40]))
    # Of 20 pairs in random order; 4.5 standard deviations of a rank correlation, 1 / sqrt(n - 1).
    assert np.abs(np.corrcoef(drawn[:20].T) - np.eye(3)).max() < 4.5 / np.sqrt(19)
    inside = 20 * drawn - np.floor(20 * drawn)
    assert stats.kstest(inside.ravel(), "uniform").pvalue > 1e-4  # and anywhere within it


def test_leaving_a_key_out_of_a_hypercube_changes_no_other() -> None:
    """Each key has an order of its own."""
    assert np.array_equal(
        points("latin_hypercube", 1, 10, 10)[:, [0, 2]], points("latin_hypercube", 1, 10, 10, ("a", "c"))
    )


def test_sobol_is_even_and_does_not_depend_on_the_order_of_asking() -> None:
    """Below the discrepancy of independent points, for any number of them; the points of SciPy's own sequence."""
    drawn = points("sobol", 5, 1500, 1)  # more than one chunk
    assert ((drawn >= 0.0) & (drawn < 1.0)).all()
    for number in (64, 200, 1500):
        independent = np.random.default_rng(number).random((number, 3))
        assert qmc.discrepancy(drawn[:number]) < 0.5 * qmc.discrepancy(independent)
    design._sobol.cache_clear()
    assert design.quantiles("sobol", 5, 1234, KEYS, 1) == dict(zip(KEYS, drawn[1234].tolist(), strict=True))
    assert not np.array_equal(points("sobol", 6, 10, 1), drawn[:10])


def test_independent_draws_have_no_quantiles() -> None:
    """Each distribution then draws from its own stream, as in a single trial."""
    assert design.quantiles("independent", 5, 3, KEYS, 10) == {}


@pytest.mark.parametrize(
    ("trials", "size", "ends"), [(10, None, [10]), (10, 5, [5, 10]), (11, 5, [5, 10, 11]), (3, 5, [3])]
)
def test_blocks(trials: int, size: int | None, ends: list[int]) -> None:
    """One after another, all trials once."""
    blocks = design.blocks(trials, size)
    assert [block.stop for block in blocks] == ends
    assert [trial for block in blocks for trial in block] == list(range(trials))
