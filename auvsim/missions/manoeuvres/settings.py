"""Settings of every kind of manoeuvre; each begins with an approach on a straight course."""

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from auvsim.base.settings import Settings


class _Timed(Settings):
    """Speed and approach, which all manoeuvres share."""

    speed: float = Field(default=1.5, gt=0, description="speed straight ahead, whose shaft speed is kept [m/s]")
    speed_steps: tuple[float, ...] = Field(
        default=(), description="speeds in turn, each for step_time, instead of `speed` after the approach [m/s]"
    )
    step_time: float = Field(default=20.0, gt=0, description="time of each of them [s]")
    approach: float = Field(default=20.0, ge=0, description="time on a straight course before [s]")

    @model_validator(mode="after")
    def _forward(self) -> "_Timed":
        if min(self.speed_steps, default=1.0) <= 0.0:
            raise ValueError(f"speed_steps are {list(self.speed_steps)}, they must be positive [m/s]")
        return self


class _Lasting(_Timed):
    """A manoeuvre of a given duration."""

    duration: float = Field(default=300.0, gt=0, description="time with the approach [s]")

    @model_validator(mode="after")
    def _longer(self) -> "_Lasting":
        if self.duration <= self.approach:
            raise ValueError(f"duration is {self.duration:g} s, it must be more than the approach, {self.approach:g} s")
        return self


class StraightSettings(_Lasting):
    """A straight course, held by the autopilot; for thrust and drag with `speed_steps`."""

    kind: Literal["straight"] = "straight"


class CircleSettings(_Lasting):
    """A turning circle: the rudder hard over and held."""

    kind: Literal["circle"] = "circle"
    rudder_deg: float | None = Field(
        default=None, description="rudder, positive to starboard; null: the fins' limit [deg]"
    )


class ZigzagSettings(_Lasting):
    """A zig-zag (Kempf): the rudder is put over whenever the heading has changed by an angle to either side."""

    kind: Literal["zigzag"] = "zigzag"
    heading_deg: float = Field(default=10.0, gt=0, lt=90, description="change of heading that switches [deg]")
    rudder_deg: float | None = Field(
        default=None, gt=0, description="rudder; null: as heading_deg, or the fins' limit if that is less [deg]"
    )


class MultisineSettings(_Lasting):
    """A sum of sines of the same amplitude, with Schroeder's phases, which keep its peak low."""

    kind: Literal["multisine"] = "multisine"
    rudder_deg: float = Field(default=10.0, gt=0, description="largest rudder [deg]")
    lowest: float = Field(default=0.01, ge=0.0001, description="lowest frequency; the others are its multiples [Hz]")
    highest: float = Field(
        default=0.2, gt=0, le=10.0, description="highest frequency, below half the control rate [Hz]"
    )

    @model_validator(mode="after")
    def _ordered(self) -> "MultisineSettings":
        if self.highest < self.lowest:
            raise ValueError(f"highest is {self.highest:g} Hz, it must be at least `lowest`, {self.lowest:g} Hz")
        return self


class PrbsSettings(_Lasting):
    """A pseudo-random binary sequence: the rudder to one side or the other, as a shift register says."""

    kind: Literal["prbs"] = "prbs"
    rudder_deg: float = Field(default=10.0, gt=0, description="rudder [deg]")
    clock: float = Field(default=2.0, ge=0.01, description="shortest time on one side [s]")
    order: int = Field(default=7, ge=3, le=11, description="bits of the register; it repeats after 2^order - 1 clocks")


class SpiralSettings(_Timed):
    """A direct spiral (Dieudonne): the rudder from one side to the other and back in steps, each held."""

    kind: Literal["spiral"] = "spiral"
    rudder_deg: float = Field(default=12.0, gt=0, description="largest rudder [deg]")
    step_deg: float = Field(default=3.0, ge=0.1, description="step of the rudder [deg]")
    hold: float = Field(default=20.0, gt=0, description="time in which the yaw rate becomes steady at each step [s]")

    @model_validator(mode="after")
    def _divides(self) -> "SpiralSettings":
        steps = 2.0 * self.rudder_deg / self.step_deg
        if steps < 1.5 or abs(steps - round(steps)) > 1e-9:
            raise ValueError(f"step_deg is {self.step_deg:g}, it must divide twice rudder_deg, {self.rudder_deg:g} deg")
        return self

    @property
    def rudders_deg(self) -> tuple[float, ...]:
        """The rudders in turn [deg]."""
        down = [self.rudder_deg - k * self.step_deg for k in range(round(2.0 * self.rudder_deg / self.step_deg) + 1)]
        return (*down, *down[-2::-1])

    @property
    def duration(self) -> float:
        """Time with the approach [s]."""
        return self.approach + self.hold * len(self.rudders_deg)


class TablePoint(Settings):
    """Rudder and speed from some time on."""

    time: float = Field(ge=0, description="time after the approach [s]")
    rudder_deg: float = Field(description="rudder, positive to starboard [deg]")
    speed: float | None = Field(default=None, gt=0, description="speed from then on; null: as before [m/s]")


class TableSettings(_Lasting):
    """Rudder and speed held from point to point of a table; what an excitation design writes."""

    kind: Literal["table"] = "table"
    name: str = Field(default="table", pattern=r"^[a-z][a-z0-9_]*$", description="what it is called in files")
    rudder_rate_deg: float | None = Field(
        default=None, gt=0, description="largest rate of the rudder asked for; null: at once [deg/s]"
    )
    points: tuple[TablePoint, ...] = Field(min_length=1, description="points at increasing times, the first at 0")

    @model_validator(mode="after")
    def _ordered(self) -> "TableSettings":
        times = [point.time for point in self.points]
        if times[0] != 0.0 or any(after <= before for before, after in pairwise(times)):
            raise ValueError("the times of the points must increase, the first being 0")
        if times[-1] >= self.duration - self.approach:
            raise ValueError(f"the last point is at {times[-1]:g} s, after the end of the manoeuvre")
        if self.speed_steps:
            raise ValueError("speed_steps and a table exclude each other; give the points their speeds")
        return self


class OptimalSettings(_Lasting):
    """The most informative table of rudder and speed within limits; `auvsim manoeuvre optimal` designs it."""

    kind: Literal["optimal"] = "optimal"
    rudder_deg: float | None = Field(default=None, gt=0, description="largest rudder; null: the fins' limit [deg]")
    rudder_rate_deg: float = Field(default=20.0, gt=0, description="largest rate of the rudder [deg/s]")
    dwell: float = Field(default=2.0, ge=0.1, description="time for which a rudder is asked for [s]")
    slowest: float = Field(default=1.0, gt=0, description="lowest speed [m/s]")
    fastest: float = Field(default=1.8, gt=0, description="highest speed [m/s]")
    room: float = Field(
        default=150.0, gt=0, description="largest distance from the end of the approach, through the water [m]"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "OptimalSettings":
        if self.speed_steps:
            raise ValueError("speed_steps: an optimal manoeuvre chooses its speeds; give `slowest` and `fastest`")
        if not self.slowest <= self.speed <= self.fastest:
            raise ValueError(f"speed is {self.speed:g} m/s, it must be from {self.slowest:g} to {self.fastest:g} m/s")
        return self


class SequenceSettings(Settings):
    """Several manoeuvres one after another, each from the heading at which the one before ended."""

    kind: Literal["sequence"] = "sequence"
    parts: tuple["ManoeuvreSettings", ...] = Field(min_length=1, description="manoeuvres in turn")

    @property
    def duration(self) -> float:
        """Time of all [s]."""
        return sum(part.duration for part in self.parts)


Simple = (
    StraightSettings
    | CircleSettings
    | ZigzagSettings
    | MultisineSettings
    | PrbsSettings
    | SpiralSettings
    | TableSettings
    | OptimalSettings
)
ManoeuvreSettings = Annotated[
    Simple | SequenceSettings,
    Field(discriminator="kind"),
]
SequenceSettings.model_rebuild()


class ManoeuvreMissionSettings(Settings):
    """A manoeuvre as a mission, for identification."""

    kind: Literal["manoeuvre"] = "manoeuvre"
    manoeuvre: ManoeuvreSettings = Field(description="what the vehicle does, by its `kind`")
