"""What a campaign comes to: published intervals, coverage over many made-up campaigns, pairs by hand."""

import numpy as np
import pytest
from scipy import stats

from auvsim.analysis.statistics import wilson
from auvsim.campaign import statistics
from auvsim.campaign.columns import layout

LAYOUT = layout(("docking",))


def row(variant: str, trial: int, **values: object) -> dict:
    """A row of the table, of a trial that raised an error but for what is given."""
    return {
        **dict.fromkeys(LAYOUT.columns),
        "variant": variant,
        "trial": trial,
        "docked": False,
        "docked_first": False,
    } | values


@pytest.mark.parametrize(
    ("counts", "low", "high"),
    [
        # Newcombe 1998 (Stat. Med. 17:2635), table II, method 10: pairs 1 1, 1 0, 0 1, 0 0.
        ((36, 12, 2, 0), 0.0569, 0.3404),
        ((53, 2, 1, 0), -0.0636, 0.1050),
    ],
)
def test_interval_of_paired_rates_is_the_published_one(counts: tuple[int, ...], low: float, high: float) -> None:
    """To the digits that are printed."""
    pairs = np.repeat([[1, 1], [1, 0], [0, 1], [0, 0]], counts, axis=0)
    rows = [row(name, k, docked=bool(pair[i])) for k, pair in enumerate(pairs) for i, name in enumerate(("b", "a"))]
    found = next(d for d in statistics.differences(rows, ("a", "b"), LAYOUT) if d.quantity == "docked")
    assert (found.variant, found.pairs) == ("b", sum(counts))
    assert found.value == pytest.approx((counts[1] - counts[2]) / sum(counts))
    assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)


def test_equal_pairs_are_not_certain() -> None:
    """200 of 200 against 200 of 200: about Wilson's own reach to either side, where a bootstrap would say none."""
    rows = [row(name, k, docked=True) for k in range(200) for name in ("a", "b")]
    found = next(d for d in statistics.differences(rows, ("a", "b"), LAYOUT) if d.quantity == "docked")
    assert found.value == 0.0
    reach = 1.0 - wilson(200, 200)[0]
    assert (found.low, found.high) == pytest.approx((-reach, reach))


def test_differences_are_of_pairs() -> None:
    """By hand; trials that only one of the two has, or finished, do not count."""
    misses = {"a": {0: 1.0, 1: 2.0, 2: 4.0, 5: 9.0}, "b": {0: 1.5, 1: 2.5, 2: 4.5, 3: None, 7: 70.0}}
    rows = [row(name, k, miss_distance=miss) for name, of in misses.items() for k, miss in of.items()]
    rows.append(row("a", 3, miss_distance=5.0))
    found = {d.quantity: d for d in statistics.differences(rows, ("a", "b"), LAYOUT)}
    assert set(found) == {"docked", "docked_first", "miss_distance"}
    less = found["miss_distance"]
    assert (less.value, less.low, less.high, less.pairs) == (0.5, 0.5, 0.5, 3)
    assert found["docked"].pairs == 4
    assert statistics.differences(rows[:4], ("a",), LAYOUT) == []


def test_rates_are_wilsons() -> None:
    """Each variant and each success, against SciPy's own."""
    rows = [row("a", k, docked=k < 7, docked_first=k < 2) for k in range(10)] + [row("b", 0)]
    found = {(r.variant, r.quantity): r for r in statistics.rates(rows, ("a", "b"), LAYOUT)}
    assert set(found) == {(name, quantity) for name in ("a", "b") for quantity in LAYOUT.rates}
    for (variant, quantity), successes, trials in (
        (("a", "docked"), 7, 10),
        (("a", "docked_first"), 2, 10),
        (("b", "docked"), 0, 1),
    ):
        rate = found[variant, quantity]
        assert (rate.successes, rate.trials) == (successes, trials)
        expected = stats.binomtest(successes, trials).proportion_ci(method="wilson")
        assert (rate.low, rate.high) == pytest.approx((expected.low, expected.high))


def test_consistency() -> None:
    """A consistent filter lies inside, one that claims half the error outside; trials without it do not count."""
    generator = np.random.default_rng(5)
    nees = generator.chisquare(2, size=200) / 2.0  # one sample a trial, the worst case
    rows = [row("a", k, nees_per_dof=x, nees_per_dof_approach=x) for k, x in enumerate(nees)]
    rows += [row("b", k, nees_per_dof=4.0 * x) for k, x in enumerate(nees)] + [row("b", 200)]
    found = {(n.variant, n.phase): n for n in statistics.consistency(rows, ("a", "b"), LAYOUT)}
    assert set(found) == {("a", "all"), ("a", "approach"), ("b", "all")}
    assert found["a", "all"].holds
    assert not found["b", "all"].holds
    assert found["b", "all"].trials == 200
    expected = stats.chi2(400).ppf([0.025, 0.975]) / 400.0
    assert (found["a", "all"].low, found["a", "all"].high) == pytest.approx(tuple(expected))


def test_what_is_compared_are_columns() -> None:
    """No quantity without a column."""
    compared = {*LAYOUT.rates, *LAYOUT.means, *(f"nees_per_dof_{phase}" for phase in LAYOUT.phases)}
    assert compared <= set(LAYOUT.columns)
