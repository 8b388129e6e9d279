"""Ladders: a factor, or several together, made harsher until success is no longer sure, and the edge halved."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from auvsim.stress.bench import Outcome
from auvsim.stress.plan import Point, StressPlan
from auvsim.stress.sequential import decided

HARSH, MILD = 1.0, 0.0


@dataclass
class Rung:
    """The trials at one level."""

    level: float  # from 0, mild, to 1, harsh
    outcomes: list[Outcome] = field(default_factory=list)
    good: bool | None = None  # whether success is sure enough; None: not decided

    @property
    def successes(self) -> int:
        """How many succeeded."""
        return sum(outcome.success for outcome in self.outcomes)


class Ladder:
    """The edge of success along factors that are made harsher together.

    The harsh end is tried, then the mild one, then the middle between the last good and the last bad level, with the
    same trials at each. It supposes that success only falls on the way.

    Args:
        plan: Of the trials.
        names: Of the factors.
    """

    def __init__(self, plan: StressPlan, names: tuple[str, ...]) -> None:
        self.names = names
        self.rungs = [Rung(HARSH)]
        self._plan, self._settings = plan, plan.settings.edge

    @property
    def good(self) -> float | None:
        """The harshest level that is good enough; None if none is known."""
        return max((rung.level for rung in self.rungs if rung.good), default=None)

    @property
    def bad(self) -> float | None:
        """The mildest level that is not; None if none is known."""
        return min((rung.level for rung in self.rungs if rung.good is False), default=None)

    @property
    def done(self) -> bool:
        """Whether nothing more is wanted."""
        return self.rungs[-1].good is not None

    def values(self, level: float) -> dict[str, float]:
        """The value of each factor at a level."""
        return {name: factor.value(level) for name, factor in self._plan.settings.named(self.names).items()}

    def wanted(self) -> list[Point]:
        """The next trials."""
        if self.done:
            return []
        rung = self.rungs[-1]
        first, levels = len(rung.outcomes), dict.fromkeys(self.names, rung.level)
        last = min(first + self._settings.block, self._settings.most)
        return [self._plan.point(levels, trial) for trial in range(first, last)]

    def take(self, outcomes: Sequence[Outcome]) -> None:
        """Takes what became of them."""
        rung = self.rungs[-1]
        rung.outcomes += outcomes
        rung.good = decided(self._settings, (outcome.success for outcome in rung.outcomes))
        if rung.good is None:
            return
        if rung.level == HARSH and not rung.good:
            self.rungs.append(Rung(MILD))
        elif self.good is not None and self.bad is not None and len(self.rungs) < 2 + self._settings.steps:
            self.rungs.append(Rung(0.5 * (self.good + self.bad)))


def ladders(plan: StressPlan) -> list[Ladder]:
    """The ladders that a plan asks for."""
    names, kind = tuple(plan.settings.factors), plan.settings.edge.ladders
    if kind == "none":
        return []
    found = [(name,) for name in names]
    if kind == "pairs":
        found += [(a, b) for i, a in enumerate(names) for b in names[i + 1 :]]
    return [Ladder(plan, chosen) for chosen in found]
