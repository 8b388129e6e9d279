"""Content of a report: the campaign, its trials and their statistics."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auvsim.campaign import folder, statistics, table
from auvsim.campaign.columns import SUCCESS, Layout
from auvsim.campaign.statistics import Difference, Nees, Rate

Row = Mapping[str, Any]  # one vehicle of a trial, as `table.rows` gives it; None where there is no value

# For columns that say whether.
WORDS = {
    "docked": "docked",
    "docked_first": "docked on the first attempt",
    "docked_aligned": "docked and aligned",
}
FILES = ("plan.yaml", "table.csv", "table.parquet", "timings.csv")


@dataclass(frozen=True, kw_only=True, slots=True)
class Content:
    """A campaign and its table."""

    name: str
    variants: tuple[str, ...]
    trials: int  # planned, for each variant
    seed: int
    state: Mapping[str, Any]  # of the campaign: engine, jobs, versions, wall_time [s], complete, stopped
    files: tuple[str, ...]  # beside the report
    drawn: tuple[str, ...]  # columns that differ from trial to trial
    layout: Layout  # of the table
    rows: Sequence[Row]
    rates: Sequence[Rate]
    differences: Sequence[Difference]
    nees: Sequence[Nees]

    def rows_of(self, variant: str) -> list[Row]:
        """The trials of a variant, one row for each of its vehicles."""
        return [row for row in self.rows if row["variant"] == variant]

    def trials_of(self, variant: str) -> list[Row]:
        """The trials of a variant, one row for each: of several vehicles the first's, with the rates of all of them."""
        if not self.layout.fleet:
            return self.rows_of(variant)
        return [
            {**vehicles[0], **{quantity: statistics.over(all, vehicles, quantity) for quantity in self.layout.rates}}
            for vehicles in statistics.by_trial(self.rows, variant).values()
        ]

    def rate(self, variant: str, quantity: str) -> Rate:
        """How often a variant did something: one of the layout's rates."""
        return next(rate for rate in self.rates if rate.variant == variant and rate.quantity == quantity)


def words(quantity: str) -> str:
    """A column in words."""
    return WORDS.get(quantity, quantity.replace("_", " "))


def negated(quantity: str) -> str:
    """That a column says no, in words."""
    return "no success" if quantity == SUCCESS else f"not {words(quantity)}"


def read(path: Path) -> Content:
    """The content of a campaign's folder.

    Raises:
        InputError: If there is no campaign, or no trial of it is done.
    """
    opened = folder.open_begun(path)
    plan, settings, rows = opened.plan, opened.plan.settings, list(table.rows(opened))
    layout = plan.layout
    return Content(
        name=settings.name,
        variants=plan.variants,
        trials=settings.trials,
        seed=settings.seed,
        state=opened.state,
        files=tuple(name for name in FILES if (path / name).is_file()),
        drawn=plan.drawn,
        layout=layout,
        rows=rows,
        rates=statistics.rates(rows, plan.variants, layout),
        differences=statistics.differences(rows, plan.variants, layout),
        nees=statistics.consistency(rows, plan.variants, layout),
    )


def values(rows: Iterable[Row], column: str) -> list[float]:
    """The finite values of a column, in ascending order."""
    found = [row.get(column) for row in rows]
    return sorted(float(value) for value in found if value is not None and math.isfinite(value))


def quantile(ordered: Sequence[float], share: float) -> float | None:
    """A quantile of ordered values by linear interpolation; None of none."""
    if not ordered:
        return None
    place = share * (len(ordered) - 1)
    below = math.floor(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])
