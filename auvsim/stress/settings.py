"""The section `stress` of a plan: what is varied, and what is looked for."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from auvsim.base.settings import Settings


class FactorSettings(Settings):
    """What is made harder: keys of the scenario, and their values where it is mild and where it is harsh."""

    range: tuple[float, float] = Field(description="value of the keys at the mild and at the harsh end")
    keys: tuple[str, ...] = Field(default=(), description="dotted keys of the scenario; none: the factor's own name")
    pins: dict[str, Any] = Field(default={}, description="what else is not as in the plan where the factor is varied")

    @model_validator(mode="before")
    @classmethod
    def _ranged(cls, values: Any) -> Any:
        values = {"range": values} if isinstance(values, list | tuple) else values
        if not isinstance(values, Mapping):
            return values
        return {key: tuple(given) if isinstance(given, list) else given for key, given in values.items()}

    def value(self, level: float) -> float:
        """The value at a level from 0, mild, to 1, harsh."""
        mild, harsh = self.range
        return harsh if level == 1.0 else mild + level * (harsh - mild)


class EdgeSettings(Settings):
    """The edge: the level at which success stops being sure, found by halving with sequential tests.

    With the default rates a test is as likely to go either way where 95 % succeed.
    """

    above: float = Field(default=0.98, gt=0.0, lt=1.0, description="success rate that must be called good enough")
    below: float = Field(default=0.90, gt=0.0, lt=1.0, description="success rate that must be called too low")
    error: float = Field(default=0.05, gt=0.0, lt=0.5, description="share of such tests that may go wrong")
    block: int = Field(default=8, ge=1, le=1000, description="trials between two looks")
    most: int = Field(default=160, ge=1, le=100_000, description="trials after which a test is decided by their share")
    steps: int = Field(default=5, ge=0, le=20, description="times that the range is halved")
    ladders: Literal["none", "single", "pairs"] = Field(
        default="single", description="of each factor alone, or also of each pair that is made harsh together; or none"
    )

    @model_validator(mode="after")
    def _apart(self) -> "EdgeSettings":
        if self.below >= self.above:
            raise ValueError(f"below is {self.below:g}, it must be less than above, {self.above:g}")
        return self


class MapSettings(Settings):
    """Maps of two factors: success in cells, divided where good and bad cells meet."""

    factors: tuple[tuple[str, str], ...] = Field(default=(), description="pairs of factors, across and upward")
    cells: int = Field(default=4, ge=1, le=50, description="cells along each side before any is divided")
    refinements: int = Field(default=1, ge=0, le=6, description="times that cells at the edge are divided in four")
    trials: int = Field(default=12, ge=1, le=100_000, description="trials in each cell")
    good: float = Field(default=0.95, gt=0.0, le=1.0, description="success rate from which a cell is good")


class RareSettings(Settings):
    """A rare event, by subset simulation on all that is drawn in a trial (Au and Beck 2001)."""

    metric: str = Field(description="column of the table whose large values are sought; none counts as infinite")
    above: float = Field(description="the event: the metric is above this, in the column's unit")
    samples: int = Field(default=500, ge=20, le=1_000_000, description="trials of each level")
    share: float = Field(default=0.1, gt=0.0, le=0.5, description="of a level's trials, from which the next one starts")
    levels: int = Field(default=5, ge=1, le=30, description="most levels; the rarest to be found is share to the power")
    angle_deg: float = Field(default=40.0, gt=0.0, le=90.0, description="of the first steps; later ones adapt [deg]")

    @model_validator(mode="after")
    def _whole(self) -> "RareSettings":
        chains = self.samples * self.share
        if abs(chains - round(chains)) > 1e-9 or self.samples % max(round(chains), 1):
            raise ValueError(
                f"samples: {self.samples} x {self.share:g} must be a whole number that divides {self.samples}"
            )
        return self


class WorstSettings(Settings):
    """The worst history of a bounded current, by the cross-entropy method over its knots (Rubinstein 1999)."""

    bound: float = Field(gt=0.0, description="largest speed of the current [m/s]")
    start: float = Field(default=0.0, ge=0.0, description="time of the first knot [s]")
    end: float = Field(gt=0.0, description="time of the last knot [s]")
    knots: int = Field(default=6, ge=1, le=100, description="number of knots")
    metric: str = Field(
        default="miss_distance", description="column whose large values are bad, among as many failures"
    )
    trials: int = Field(default=2, ge=1, le=1000, description="trials in which each history is tried")
    population: int = Field(default=40, ge=4, le=100_000, description="histories of an iteration")
    elite: int = Field(default=8, ge=2, le=10_000, description="of these, from which the next ones are drawn")
    iterations: int = Field(default=6, ge=1, le=1000, description="iterations")

    @model_validator(mode="after")
    def _ordered(self) -> "WorstSettings":
        if self.end <= self.start:
            raise ValueError(f"end: {self.end:g} s must be after the start at {self.start:g} s")
        if self.elite >= self.population:
            raise ValueError(f"elite: {self.elite} must be fewer than the population of {self.population}")
        return self


class StressSettings(Settings):
    """What `auvsim stress` varies, and what it looks for."""

    factors: dict[str, FactorSettings] = Field(default={}, description="factors by name: [mild, harsh], or with keys")
    edge: EdgeSettings = EdgeSettings()
    maps: MapSettings = MapSettings()
    rare: RareSettings | None = Field(default=None, description="a rare event to be measured; none: it is not")
    worst: WorstSettings | None = Field(default=None, description="a worst current to be sought; none: it is not")

    @model_validator(mode="after")
    def _known(self) -> "StressSettings":
        for name in (name for pair in self.maps.factors for name in pair):
            if name not in self.factors:
                raise ValueError(f"maps.factors: no factor '{name}'; there are {', '.join(self.factors) or 'none'}")
        for name, factor in self.factors.items():
            if factor.range[0] == factor.range[1]:
                raise ValueError(f"factors.{name}: mild and harsh end are both {factor.range[0]:g}")
        return self

    def named(self, names: tuple[str, ...]) -> Mapping[str, FactorSettings]:
        """Some factors."""
        return {name: self.factors[name] for name in names}
