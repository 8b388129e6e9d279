"""Rare events by subset simulation (Au and Beck 2001), walked by mixing normals (Papaioannou et al. 2015)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from auvsim.analysis.statistics import wilson
from auvsim.base.frames import Array
from auvsim.stress.bench import Outcome
from auvsim.stress.plan import Steps
from auvsim.stress.settings import RareSettings

ACCEPTED = 0.44  # share of steps at which the angle stays as it is (Papaioannou et al. 2015)
NORMAL_95 = 1.959963984540054


class Places(Protocol):
    """What gives the trial at a place that was walked to; `StressPlan` is one."""

    def point(self, levels: dict[str, float], trial: int, walk: Steps | None = None) -> Any:
        """The trial."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Sample:
    """A trial, and how it was come to."""

    trial: int
    walk: Steps
    score: float
    outcome: Outcome


class Level(NamedTuple):
    """Trials given that the score is above a threshold."""

    above: float  # the threshold; the first level has none
    samples: tuple[Sample, ...]  # chain after chain in turn: sample k belongs to chain k modulo `chains`
    chains: int
    accepted: float  # share of the steps that were accepted

    def rate(self, threshold: float) -> float:
        """Share of the samples whose score is above a threshold."""
        return sum(sample.score > threshold for sample in self.samples) / len(self.samples)

    def variation(self, threshold: float) -> float:
        """Squared coefficient of variation of `rate`, from the correlation along the chains (Au and Beck 2001, 28)."""
        above = np.array([sample.score > threshold for sample in self.samples], dtype=float)
        p = float(above.mean())
        if p in (0.0, 1.0):
            return math.inf if p == 0.0 else 0.0
        return (1.0 - p) / (p * len(above)) * (1.0 + self._inflation(above.reshape(-1, self.chains), p))

    def _inflation(self, above: Array, p: float) -> float:
        length = len(above)
        found = 0.0
        for lag in range(1, length):
            correlation = float((above[:-lag] * above[lag:]).mean()) - p * p
            found += 2.0 * (1.0 - lag / length) * correlation / (p * (1.0 - p))
        return max(found, 0.0)


class Probability(NamedTuple):
    """Of the event, with its 95 % interval."""

    value: float
    low: float
    high: float


class Subset:
    """The probability that a score is above a limit, through levels that are each reached by a share of the last.

    Each level's best trials start chains. A step mixes the normals of all draws of a trial, noises included, with those
    of a new one at an angle; it is taken if the score is above the level's threshold. The angle adapts.

    Args:
        places: Makes the trials.
        settings: Of the event and the levels.
    """

    def __init__(self, places: Places, settings: RareSettings) -> None:
        self.settings = settings
        self.levels: list[Level] = []
        self._places, self._sine = places, math.sin(math.radians(settings.angle_deg))
        self._chains = round(settings.samples * settings.share)
        self._used = settings.samples  # trials whose draws are taken
        self._proposed: list[tuple[int, Steps]] = [(trial, ()) for trial in range(settings.samples)]
        self._threshold = -math.inf
        self._samples: list[Sample] = []  # of the level that is under way
        self._steps = self._accepted = 0

    @property
    def done(self) -> bool:
        """Whether nothing more is wanted."""
        return not self._proposed

    @property
    def samples(self) -> list[Sample]:
        """All trials of finished levels, each once."""
        return list({(s.trial, s.walk): s for level in self.levels for s in level.samples}.values())

    def wanted(self) -> list[Any]:
        """The next trials: all of the first level, then a step of every chain."""
        return [self._places.point({}, trial, walk) for trial, walk in self._proposed]

    def take(self, outcomes: Sequence[Outcome]) -> None:
        """Takes what became of them."""
        new = [
            Sample(trial=trial, walk=walk, score=outcome.score(self.settings.metric), outcome=outcome)
            for (trial, walk), outcome in zip(self._proposed, outcomes, strict=True)
        ]
        if self._samples:
            before = self._samples[-self._chains :]
            new = [b if b.score > self._threshold else a for a, b in zip(before, new, strict=True)]
            share = sum(b is not a for a, b in zip(before, new, strict=True)) / self._chains
            self._steps += 1
            self._accepted += share
            self._sine = min(1.0, self._sine * math.exp((share - ACCEPTED) / math.sqrt(self._steps)))
        self._samples += new
        if len(self._samples) >= self.settings.samples:
            self._finish_level()
        else:
            self._propose(self._samples[-self._chains :])

    def probability(self, limit: float | None = None) -> Probability:
        """The probability of a score above a limit, that of the settings by default, from the finished levels.

        The interval is log-normal, with the levels' squared coefficients of variation summed up. Where no trial of the
        last level is above, the upper end is that of Wilson's interval for so many independent trials as those of its
        chains are worth at least: one for each.
        """
        limit = self.settings.above if limit is None else limit
        value, variation = 1.0, 0.0
        for level, after in zip(self.levels, [*self.levels[1:], None], strict=True):
            threshold = after.above if after is not None and after.above < limit else limit
            rate = level.rate(threshold)
            if rate == 0.0:
                return Probability(0.0, 0.0, value * wilson(0, level.chains)[1])
            value, variation = value * rate, variation + level.variation(threshold)
            if threshold == limit:
                break
        if len(self.levels) == 1 or self.levels[1].above >= limit:  # plain trials
            count = len(self.levels[0].samples)
            return Probability(value, *wilson(round(value * count), count))
        spread = NORMAL_95 * math.sqrt(math.log1p(variation))
        return Probability(value, value * math.exp(-spread), min(1.0, value * math.exp(spread)))

    def _finish_level(self) -> None:
        accepted = self._accepted / self._steps if self._steps else 1.0
        chains = self._chains if self.levels else self.settings.samples
        self.levels.append(Level(self._threshold, tuple(self._samples), chains, accepted))
        best = sorted(self._samples, key=lambda sample: -sample.score)[: self._chains]
        # Below all of these, also where steps that were refused have left equal ones beyond them.
        self._threshold = max((s.score for s in self._samples if s.score < best[-1].score), default=math.inf)
        self._samples, self._steps, self._accepted, self._proposed = [], 0, 0, []
        if self._threshold >= self.settings.above or len(self.levels) >= self.settings.levels:
            return
        self._samples = best
        self._propose(best)

    def _propose(self, at: Sequence[Sample]) -> None:
        angle = round(math.degrees(math.asin(self._sine)), 6)
        self._proposed = [(s.trial, (*s.walk, (self._used + i, angle))) for i, s in enumerate(at)]
        self._used += len(at)
