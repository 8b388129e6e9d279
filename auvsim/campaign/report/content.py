"""Content of a report: the campaign, its trials and their statistics."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auvsim.campaign import folder, statistics, table
from auvsim.campaign.statistics import Difference, Nees, Rate

Row = Mapping[str, Any]  # one trial of one variant, as `table.rows` gives it; None where there is no value

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
    rows: Sequence[Row]
    rates: Sequence[Rate]
    differences: Sequence[Difference]
    nees: Sequence[Nees]

    def rows_of(self, variant: str) -> list[Row]:
        """The trials of a variant."""
        return [row for row in self.rows if row["variant"] == variant]

    def rate(self, variant: str, quantity: str) -> Rate:
        """How often a variant did something, `docked` or `docked_first`."""
        return next(rate for rate in self.rates if rate.variant == variant and rate.quantity == quantity)


def read(path: Path) -> Content:
    """The content of a campaign's folder.

    Raises:
        InputError: If there is no campaign, or no trial of it is done.
    """
    opened = folder.open_begun(path)
    plan, settings, rows = opened.plan, opened.plan.settings, list(table.rows(opened))
    return Content(
        name=settings.name,
        variants=plan.variants,
        trials=settings.trials,
        seed=settings.seed,
        state=opened.state,
        files=tuple(name for name in FILES if (path / name).is_file()),
        drawn=plan.drawn,
        rows=rows,
        rates=statistics.rates(rows, plan.variants),
        differences=statistics.differences(rows, plan.variants),
        nees=statistics.consistency(rows, plan.variants),
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
