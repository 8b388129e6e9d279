"""Statistics of a campaign: success rates, paired differences between variants, consistency of the estimators."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from auvsim.analysis.statistics import bootstrap, newcombe, wilson
from auvsim.campaign.table import UNDER_WAY
from estimators.core.consistency import interval

Row = Mapping[str, Any]  # of the table

RATES = ("docked", "docked_first")
MEANS = ("miss_distance", "position_rms", "current_rms", "nees_per_dof", "contact_impulse", "time")
CONFIDENCE = 0.95


@dataclass(frozen=True, kw_only=True, slots=True)
class Rate:
    """How often something happened, with Wilson's interval."""

    variant: str
    quantity: str  # of RATES
    successes: int
    trials: int
    low: float
    high: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Difference:
    """A quantity of a variant less that of the first variant, in the same trials."""

    variant: str
    quantity: str  # of RATES or MEANS
    value: float
    low: float
    high: float
    pairs: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Nees:
    """Mean NEES per degree of freedom of a variant, with the interval of a consistent filter; a trial is one sample."""

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


def rates(rows: Sequence[Row], variants: Sequence[str]) -> list[Rate]:
    """The success rates of each variant."""
    found = []
    for variant in variants:
        own = [row for row in rows if row["variant"] == variant]
        for quantity in RATES:
            successes = sum(bool(row[quantity]) for row in own)
            low, high = wilson(successes, len(own), CONFIDENCE)
            counts = {"successes": successes, "trials": len(own)}
            found.append(Rate(variant=variant, quantity=quantity, **counts, low=low, high=high))
    return found


def differences(rows: Sequence[Row], variants: Sequence[str]) -> list[Difference]:
    """Each variant less the first, over the trials in which both have the quantity; nothing where none has.

    Means have BCa bootstrap intervals over the pairs (Efron 1987). Rates have Newcombe's (1998), since a
    bootstrap of pairs that are all alike would claim to be certain.
    """
    by_variant = {name: {row["trial"]: row for row in rows if row["variant"] == name} for name in variants}
    reference, *others = by_variant
    found = []
    for variant in others:
        shared = sorted(by_variant[variant].keys() & by_variant[reference].keys())
        pairs = [(by_variant[variant][trial], by_variant[reference][trial]) for trial in shared]
        for quantity in (*RATES, *MEANS):
            values = np.array([(a[quantity], b[quantity]) for a, b in pairs], dtype=float).reshape(-1, 2)  # None: NaN
            values = values[np.isfinite(values).all(axis=1)]
            if len(values):
                less = values[:, 0] - values[:, 1]
                low, high = newcombe(values > 0.5, CONFIDENCE) if quantity in RATES else bootstrap(less, CONFIDENCE)
                counted = {"value": float(less.mean()), "low": low, "high": high, "pairs": len(less)}
                found.append(Difference(variant=variant, quantity=quantity, **counted))
    return found


def consistency(rows: Sequence[Row], variants: Sequence[str]) -> list[Nees]:
    """NEES of each variant, in all phases together and in each.

    The errors along one trial hang together, so a trial counts as one sample of two degrees of freedom; as it holds
    more than one, the interval is wide rather than narrow.
    """
    found = []
    for variant in variants:
        own = [row for row in rows if row["variant"] == variant]
        for phase in ("all", *UNDER_WAY):
            key = "nees_per_dof" if phase == "all" else f"nees_per_dof_{phase}"
            values = [row[key] for row in own if row[key] is not None]
            if values:
                low, high = (end / 2.0 for end in interval(2.0, len(values), CONFIDENCE))
                mean = float(np.mean(values))
                found.append(Nees(variant=variant, phase=phase, mean=mean, low=low, high=high, trials=len(values)))
    return found
