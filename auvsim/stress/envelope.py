"""Envelope maps: success over two factors, in cells that are divided where good and bad ones meet."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from auvsim.analysis.statistics import wilson
from auvsim.stress.bench import Outcome
from auvsim.stress.plan import Point, StressPlan


@dataclass
class Cell:
    """A rectangle of levels, tried at its middle."""

    low: tuple[float, float]  # across and upward
    size: float
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def successes(self) -> int:
        """How many trials succeeded."""
        return sum(outcome.success for outcome in self.outcomes)

    @property
    def rate(self) -> float:
        """Share of trials that succeeded."""
        return self.successes / len(self.outcomes)

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the success rate."""
        return wilson(self.successes, len(self.outcomes))

    def touches(self, other: "Cell") -> bool:
        """Whether they share a piece of a side."""
        gaps = [
            max(a, b) - min(a + self.size, b + other.size) for a, b in zip(self.low, other.low, strict=True)
        ]  # negative: they overlap along this axis
        return min(gaps) < -1e-9 and abs(max(gaps)) < 1e-9

    def quarters(self) -> "list[Cell]":
        """The four cells of half its size."""
        half = 0.5 * self.size
        return [Cell((self.low[0] + i * half, self.low[1] + j * half), half) for i in (0, 1) for j in (0, 1)]


class EnvelopeMap:
    """Success over two factors.

    Args:
        plan: Of the trials.
        names: Of the factors, across and upward.
    """

    def __init__(self, plan: StressPlan, names: tuple[str, str]) -> None:
        self.names = names
        self._plan, self._settings = plan, plan.settings.maps
        side = 1.0 / self._settings.cells
        steps = range(self._settings.cells)
        self.cells = [Cell((i * side, j * side), side) for i in steps for j in steps]
        self._divided = 0

    @property
    def done(self) -> bool:
        """Whether nothing more is wanted."""
        return all(cell.outcomes for cell in self.cells)

    def wanted(self) -> list[Point]:
        """The trials of all new cells."""
        return [
            self._plan.point(
                {name: low + 0.5 * cell.size for name, low in zip(self.names, cell.low, strict=True)}, trial
            )
            for cell in self._new()
            for trial in range(self._settings.trials)
        ]

    def take(self, outcomes: Sequence[Outcome]) -> None:
        """Takes what became of them, and divides the cells at the edge, if more divisions are allowed."""
        size = self._settings.trials
        for index, cell in enumerate(self._new()):
            cell.outcomes = list(outcomes[index * size : (index + 1) * size])
        if self._divided < self._settings.refinements:
            self._divided += 1
            edge = [cell for cell in self.cells if self._at_edge(cell)]
            kept = [cell for cell in self.cells if not self._at_edge(cell)]
            self.cells = kept + [quarter for cell in edge for quarter in cell.quarters()]

    def _new(self) -> list[Cell]:
        return [cell for cell in self.cells if not cell.outcomes]

    def _at_edge(self, cell: Cell) -> bool:
        good = self._settings.good
        return any(cell.touches(other) and (other.rate >= good) != (cell.rate >= good) for other in self.cells)
