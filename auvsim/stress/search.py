"""The searches of a stress test, side by side: each says which trials it wants, and takes what became of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from auvsim.stress.bench import Bench, BudgetSpentError, Outcome
from auvsim.stress.envelope import EnvelopeMap
from auvsim.stress.ladder import Ladder, ladders
from auvsim.stress.plan import Point, StressPlan
from auvsim.stress.rare import Subset
from auvsim.stress.worst import Worst


class Search(Protocol):
    """What looks for something by trials."""

    @property
    def done(self) -> bool:
        """Whether nothing more is wanted."""
        ...

    def wanted(self) -> list[Point]:
        """The next trials; none when it is done."""
        ...

    def take(self, outcomes: Sequence[Outcome]) -> None:
        """Takes what became of them."""
        ...


@dataclass
class Searches:
    """All that a plan asks for."""

    plan: StressPlan
    ladders: list[Ladder] = field(init=False)
    maps: list[EnvelopeMap] = field(init=False)
    rare: Subset | None = field(init=False)
    worst: Worst | None = field(init=False)
    spent: bool = False  # whether the budget was, before all was done

    def __post_init__(self) -> None:
        s, seed = self.plan.settings, self.plan.plan.settings.seed
        self.ladders = ladders(self.plan)
        self.maps = [EnvelopeMap(self.plan, names) for names in s.maps.factors]
        self.rare = Subset(self.plan, s.rare) if s.rare else None
        self.worst = Worst(self.plan, s.worst, seed) if s.worst else None

    @property
    def groups(self) -> list[list[Search]]:
        """Searches that go on side by side, one group after the other."""
        last: list[list[Search]] = [[search] for search in (self.rare, self.worst) if search is not None]
        return [list(self.ladders), list(self.maps), *last]

    def run(self, bench: Bench) -> None:
        """Runs them until all are done or the budget is spent."""
        bench.planned = expected(self.plan)
        try:
            for group in self.groups:
                advance(group, bench)
        except BudgetSpentError:
            self.spent = True


def advance(searches: Sequence[Search], evaluate: Callable[[Sequence[Any]], Sequence[Any]]) -> None:
    """Advances searches side by side until all are done."""
    while wanted := [(search, points) for search in searches if (points := search.wanted())]:
        outcomes = evaluate([point for _, points in wanted for point in points])
        for search, points in wanted:
            search.take(outcomes[: len(points)])
            outcomes = outcomes[len(points) :]


def expected(plan: StressPlan) -> int:
    """About how many trials a plan takes: a test takes about 30 where it is not near the edge."""
    s = plan.settings
    count = len(ladders(plan)) * (1 + s.edge.steps) * 30
    per_map = s.maps.cells**2 + s.maps.refinements * 8 * s.maps.cells
    count += len(s.maps.factors) * per_map * s.maps.trials
    if s.rare:
        count += s.rare.samples + round((s.rare.levels - 1) * s.rare.samples * (1.0 - s.rare.share))
    if s.worst:
        count += s.worst.population * s.worst.trials * s.worst.iterations
    return count
