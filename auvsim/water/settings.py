"""Current fields as data: the settings of every kind of current."""

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from auvsim.base.settings import Settings


class NoneSettings(Settings):
    """Still water."""

    kind: Literal["none"] = "none"


class UniformSettings(Settings):
    """The same current at all times and places."""

    kind: Literal["uniform"] = "uniform"
    speed: float = Field(default=0.5, ge=0.0, description="horizontal speed [m/s]")
    direction_deg: float = Field(default=0.0, description="direction the water flows to, clockwise from north [deg]")
    down: float = Field(default=0.0, description="downward velocity [m/s]")


class TurningSettings(Settings):
    """A uniform current whose direction turns linearly from `start` to `end` (Qiu & Li 2019, figures 6 and 7)."""

    kind: Literal["turning"] = "turning"
    speed: float = Field(default=0.5, ge=0.0, description="horizontal speed [m/s]")
    direction_deg: float = Field(default=0.0, description="direction it flows to before the turn, from north [deg]")
    angle_deg: float = Field(default=90.0, description="angle of the turn, positive clockwise [deg]")
    start: float = Field(default=120.0, ge=0.0, description="time at which the turn starts [s]")
    end: float = Field(default=130.0, gt=0.0, description="time at which the turn ends [s]")

    @model_validator(mode="after")
    def _ordered(self) -> "TurningSettings":
        if self.end <= self.start:
            raise ValueError(f"the turn ends at {self.end} s, which must be after its start at {self.start} s")
        return self


class ApproachTurnSettings(Settings):
    """A uniform current that turns once in every docking attempt, somewhere on its approach: the hard case."""

    kind: Literal["approach_turn"] = "approach_turn"
    speed: float = Field(default=0.5, ge=0.0, description="horizontal speed [m/s]")
    direction_deg: float = Field(
        default=0.0, description="direction it flows to before the first turn, from north [deg]"
    )
    angle_deg: float = Field(default=90.0, gt=0.0, description="angle of each turn, to a side drawn at random [deg]")
    duration: float = Field(default=10.0, gt=0.0, description="time that a turn takes [s]")


class ShearPoint(Settings):
    """The current at one depth."""

    depth: float = Field(ge=0.0, description="depth [m]")
    speed: float = Field(ge=0.0, description="horizontal speed at that depth [m/s]")
    direction_deg: float = Field(default=0.0, description="direction it flows to, clockwise from north [deg]")


class ShearSettings(Settings):
    """A steady current that depends on depth, given at some depths.

    `smooth`: monotone cubic between the points and constant beyond them, continuously differentiable everywhere.
    `linear`: the straight line through two points, for all depths.
    """

    kind: Literal["shear"] = "shear"
    profile: Literal["smooth", "linear"] = Field(default="smooth", description="smooth (cubic) or linear in depth")
    points: tuple[ShearPoint, ...] = Field(
        default=(ShearPoint(depth=0.0, speed=0.5), ShearPoint(depth=20.0, speed=0.2)),
        min_length=2,
        description="currents at increasing depths",
    )

    @model_validator(mode="after")
    def _ordered(self) -> "ShearSettings":
        depths = [point.depth for point in self.points]
        if any(below <= above for above, below in pairwise(depths)):
            raise ValueError(f"the depths of the points are {depths}, they must increase")
        if self.profile == "linear" and len(depths) != 2:
            raise ValueError(f"a linear profile has {len(depths)} points, it needs exactly 2")
        return self


class GustSettings(Settings):
    """A random horizontal current: a second-order Gauss-Markov process for north and another for east."""

    kind: Literal["gust"] = "gust"
    intensity: float = Field(default=0.05, ge=0.0, description="standard deviation of each component [m/s]")
    correlation_time: float = Field(default=30.0, gt=0.0, description="time in which correlation falls to 1/e [s]")


class SumSettings(Settings):
    """The sum of other currents; each random term has a stream of its own."""

    kind: Literal["sum"] = "sum"
    terms: tuple["CurrentSettings", ...] = Field(min_length=1, description="currents to add")


CurrentSettings = Annotated[
    NoneSettings
    | UniformSettings
    | TurningSettings
    | ApproachTurnSettings
    | ShearSettings
    | GustSettings
    | SumSettings,
    Field(discriminator="kind"),
]
SumSettings.model_rebuild()
