"""The worst history of a bounded current, by the cross-entropy method over its knots (Rubinstein 1999)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from auvsim.base.frames import Array
from auvsim.base.randomness import stream
from auvsim.stress.bench import Outcome
from auvsim.stress.settings import WorstSettings

KEPT = 0.3  # share of the last mean and spread that stays
LEAST = 0.05  # spread of a component, in units of the bound
FIRST = 0.7  # the same at the beginning


class Histories(Protocol):
    """What gives the trial in a current; `StressPlan` is one."""

    def in_current(self, trial: int, knots: Sequence[dict[str, float]]) -> Any:
        """The trial."""
        ...


class Badness(NamedTuple):
    """How bad a history is: failures first, then the mean of the metric where it is known."""

    failures: int
    mean: float


@dataclass(frozen=True, kw_only=True, slots=True)
class History:
    """A current that was tried."""

    knots: tuple[dict[str, float], ...]  # time [s], north and east [m/s]
    outcomes: tuple[Outcome, ...]
    badness: Badness


class Worst:
    """The worst current that keeps within a bound.

    Args:
        histories: Makes the trials.
        settings: Of the bound, the knots and the search.
        seed: Of the search.
    """

    def __init__(self, histories: Histories, settings: WorstSettings, seed: int) -> None:
        self.settings = settings
        self.iterations: list[list[History]] = []
        self._histories, self._generator = histories, stream(seed, 0, "stress/worst")
        self._mean, self._spread = np.zeros((settings.knots, 2)), np.full((settings.knots, 2), FIRST)
        self._draw()

    @property
    def done(self) -> bool:
        """Whether nothing more is wanted."""
        return len(self.iterations) >= self.settings.iterations

    @property
    def best(self) -> History:
        """The worst history."""
        return max((h for tried in self.iterations for h in tried), key=lambda h: h.badness)

    def wanted(self) -> list[Any]:
        """The trials of all histories of an iteration."""
        if self.done:
            return []
        return [self._histories.in_current(t, self._knots(v)) for v in self._drawn for t in range(self.settings.trials)]

    def take(self, outcomes: Sequence[Outcome]) -> None:
        """Takes what became of them."""
        s, tried = self.settings, []
        for index, velocities in enumerate(self._drawn):
            own = tuple(outcomes[index * s.trials : (index + 1) * s.trials])
            tried.append(History(knots=self._knots(velocities), outcomes=own, badness=badness(own, s.metric)))
        self.iterations.append(tried)
        ranked = sorted(range(len(tried)), key=lambda k: tried[k].badness, reverse=True)
        elite = self._drawn[ranked[: s.elite]]
        self._mean = KEPT * self._mean + (1.0 - KEPT) * elite.mean(axis=0)
        self._spread = np.maximum(KEPT * self._spread + (1.0 - KEPT) * elite.std(axis=0), LEAST)
        self._draw()

    def _draw(self) -> None:
        """(population, knots, 2) velocities in units of the bound, none longer than 1."""
        drawn = self._mean + self._spread * self._generator.standard_normal(
            (self.settings.population, *self._mean.shape)
        )
        self._drawn: Array = drawn / np.maximum(np.linalg.norm(drawn, axis=-1, keepdims=True), 1.0)

    def _knots(self, velocities: Array) -> tuple[dict[str, float], ...]:
        s = self.settings
        times = np.linspace(s.start, s.end, s.knots).tolist() if s.knots > 1 else [s.start]
        rows = (s.bound * velocities).tolist()
        return tuple({"time": t, "north": n, "east": e} for t, (n, e) in zip(times, rows, strict=True))


def badness(outcomes: Sequence[Outcome], metric: str) -> Badness:
    """How bad outcomes are."""
    known = [score for outcome in outcomes if math.isfinite(score := outcome.score(metric))]
    return Badness(sum(not outcome.success for outcome in outcomes), sum(known) / len(known) if known else 0.0)
