"""Settings of a formation mission: the moving point, and a vehicle's station about it."""

from typing import Literal

from pydantic import Field

from auvsim.base.settings import Settings


class ChoiceSettings(Settings):
    """How a follower chooses its station by the bound of its own position."""

    reach: float = Field(default=0.0, ge=0.0, description="distance from the planned station; 0: it keeps that [m]")
    apart: float = Field(default=20.0, gt=0.0, description="least distance from any station it knows of [m]")
    period: float = Field(default=20.0, gt=0.0, description="time between two looks at what is heard [s]")
    interval: float = Field(default=6.0, gt=0.0, description="time between two words of a leader [s]")
    range_noise: float = Field(default=1.0, gt=0.0, description="error of ranges that the bound assumes, sd [m]")
    drift: float = Field(default=0.05, gt=0.0, description="error of the speed that it assumes, sd [m/s]")


class FormationSettings(Settings):
    """A station, which keeps its place about a point that moves at a steady speed over ground.

    The point is known to all by time: it leaves `north`, `east` when the run begins.
    """

    kind: Literal["formation"] = "formation"
    north: float = Field(default=0.0, description="point of reference at the start of the run: north [m]")
    east: float = Field(default=0.0, description="likewise east [m]")
    course_deg: float = Field(default=0.0, description="course over ground, clockwise from north [deg]")
    speed: float = Field(default=1.5, gt=0.0, description="speed over ground [m/s]")
    ahead: float = Field(default=0.0, description="station: ahead of the point [m]")
    starboard: float = Field(default=0.0, description="station: to starboard of it [m]")
    depth: float = Field(default=10.0, gt=0.0, description="depth [m]")
    lasts: float = Field(default=600.0, gt=0.0, description="time after which it ends [s]")
    leaders: tuple[str, ...] = Field(default=(), description="vehicles whose ranges locate this one; none: a leader")
    silent: float = Field(default=40.0, gt=0.0, description="time without a word after which a leader is gone [s]")
    leaves: float | None = Field(
        default=None, gt=0.0, description="time at which it leaves the formation to starboard; none: it stays [s]"
    )
    gain: float = Field(default=0.1, gt=0.0, description="speed for each metre behind the station [1/s]")
    margin: float = Field(default=0.5, gt=0.0, description="most speed that is added to catch up [m/s]")
    lookahead: float = Field(default=20.0, gt=0.0, description="lookahead of the line of sight [m]")
    follow: ChoiceSettings = ChoiceSettings()
