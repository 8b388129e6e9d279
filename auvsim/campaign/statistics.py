"""What a campaign comes to: success rates, paired differences between variants, consistency of the estimators.

A trial is one sample, since its vehicles share current and noise: it had success if all of its vehicles had, and its
numbers are the means over them.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean as mean
from typing import Any

import numpy as np

from auvsim.analysis.statistics import bootstrap, newcombe, wilson
from auvsim.campaign.columns import Layout
from estimators.core.consistency import interval

Row = Mapping[str, Any]  # of the table

CONFIDENCE = 0.95


@dataclass(frozen=True, kw_only=True, slots=True)
class Rate:
    """How often something happened, with Wilson's interval."""

    variant: str
    quantity: str  # of the layout's rates
    successes: int
    trials: int
    low: float
    high: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Difference:
    """A quantity of a variant less that of the first variant, in the same trials."""

    variant: str
    quantity: str  # of the layout's rates or means
    value: float
    low: float
    high: float
    pairs: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Nees:
    """Mean NEES a degree of freedom of a variant, each trial one sample, and where that of a consistent filter lies."""

    variant: str
    phase: str  # "all" or one of the phases
    mean: float
    low: float
    high: float
    trials: int

    @property
    def holds(self) -> bool:
        """Whether the mean lies in its interval."""
        return self.low <= self.mean <= self.high


def rates(rows: Sequence[Row], variants: Sequence[str], layout: Layout) -> list[Rate]:
    """The success rates of each variant, over the trials in which the question arises for a vehicle."""
    found = []
    for variant in variants:
        own = by_trial(rows, variant).values()
        for quantity in layout.rates:
            answers = [answer for group in own if (answer := over(all, group, quantity)) is not None]
            low, high = wilson(sum(answers), len(answers), CONFIDENCE)
            counts = {"successes": sum(answers), "trials": len(answers)}
            found.append(Rate(variant=variant, quantity=quantity, **counts, low=low, high=high))
    return found


def differences(rows: Sequence[Row], variants: Sequence[str], layout: Layout) -> list[Difference]:
    """Each variant less the first, over the trials in which both have the quantity; nothing where none has.

    Means have BCa bootstrap intervals over the pairs (Efron 1987). Rates have Newcombe's (1998), since a
    bootstrap of pairs that are all alike would claim to be certain.
    """
    reference, *others = (by_trial(rows, name) for name in variants)
    found = []
    for variant, trials in zip(variants[1:], others, strict=True):
        pairs = [(trials[trial], reference[trial]) for trial in sorted(trials.keys() & reference.keys())]
        for quantity in (*layout.rates, *layout.means):
            combined = all if quantity in layout.rates else mean
            values = np.array([[over(combined, group, quantity) for group in pair] for pair in pairs], dtype=float)
            values = values.reshape(-1, 2)  # None: NaN
            values = values[np.isfinite(values).all(axis=1)]
            if len(values):
                less = values[:, 0] - values[:, 1]
                low, high = (
                    newcombe(values > 0.5, CONFIDENCE) if quantity in layout.rates else bootstrap(less, CONFIDENCE)
                )
                counted = {"value": float(less.mean()), "low": low, "high": high, "pairs": len(less)}
                found.append(Difference(variant=variant, quantity=quantity, **counted))
    return found


def consistency(rows: Sequence[Row], variants: Sequence[str], layout: Layout) -> list[Nees]:
    """NEES of each variant, in all phases together and in each.

    The errors along one trial hang together, so a trial counts as one sample of two degrees of freedom; as it holds
    more than one, the interval is wide rather than narrow.
    """
    found = []
    for variant in variants:
        own = by_trial(rows, variant).values()
        for phase in ("all", *layout.phases):
            key = "nees_per_dof" if phase == "all" else f"nees_per_dof_{phase}"
            values = [value for group in own if (value := over(mean, group, key)) is not None]
            if values:
                low, high = (end / 2.0 for end in interval(2.0, len(values), CONFIDENCE))
                average = float(np.mean(values))
                found.append(Nees(variant=variant, phase=phase, mean=average, low=low, high=high, trials=len(values)))
    return found


def by_trial(rows: Iterable[Row], variant: str) -> dict[int, list[Row]]:
    """The vehicles of each trial of a variant."""
    found: dict[int, list[Row]] = {}
    for row in rows:
        if row["variant"] == variant:
            found.setdefault(row["trial"], []).append(row)
    return found


def over(combined: Callable[[list[Any]], Any], vehicles: Iterable[Row], quantity: str) -> Any:
    """A quantity of a trial, combined over its vehicles that have it; None if none has."""
    values = [row[quantity] for row in vehicles if row.get(quantity) is not None]
    return combined(values) if values else None
