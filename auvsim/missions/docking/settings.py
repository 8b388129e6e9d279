"""Settings and phases of docking."""

from enum import IntEnum
from typing import Literal

from pydantic import Field

from auvsim.base.settings import Settings


class Phase(IntEnum):
    """Phases of a docking trial, as logged."""

    SEARCH = 0  # no fix yet: hold course and depth
    HOMING = 1  # to the gate on the dock's axis
    APPROACH = 2  # along the line to the entrance
    FINAL = 3  # the last metres
    DOCKED = 4  # the latch holds
    GO_AROUND = 5  # back out and round for another attempt
    ABORTED = 6  # given up


class DockingSettings(Settings):
    """Settings of docking: homing, approach, attempts and time limits."""

    kind: Literal["docking"] = Field(
        default="docking", description="docking, manoeuvre, track, or package.module:Class"
    )
    dock: str | None = Field(default=None, description="name of the structure to dock at; none: the only one")
    homing_speed: float = Field(
        default=1.5, gt=0, description="least speed through the water while homing to the gate [m/s]"
    )
    approach_speed: float = Field(default=1.0, gt=0, description="least speed through the water on the approach [m/s]")
    ground_speed: float = Field(
        default=0.5, ge=0, description="speed over ground that a current must leave; speeds are raised for it [m/s]"
    )
    speed_per_current: float = Field(
        default=3.0, ge=0, description="least speed on the approach by that of the current, which may turn [-]"
    )
    crab_limit_deg: float = Field(
        default=22.0, gt=0, lt=80, description="angle between heading and dock axis for which speeds are raised [deg]"
    )
    gate_distance: float = Field(default=200.0, gt=0, description="distance of the gate before the entrance [m]")
    gate_radius: float = Field(default=20.0, gt=0, description="distance at which the gate counts as reached [m]")
    retry_distance: float = Field(default=100.0, gt=0, description="distance of the gate of later attempts [m]")
    turning_radius: float = Field(
        default=16.0, gt=0, description="of the tightest turn, for the room to turn round before the dock [m]"
    )
    lookahead: float = Field(default=7.0, gt=0, description="lookahead of the line of sight [m]")
    weave: float = Field(
        default=0.0,
        ge=0,
        description="widest weave on an approach, flown as wide as the bound of the miss needs; 0: straight [m]",
    )
    heading_limit_deg: float = Field(
        default=20.0,
        gt=0,
        lt=60,
        description="largest angle between heading and dock axis before the line is turned instead [deg]",
    )
    descent_deg: float = Field(
        default=6.0,
        gt=0,
        lt=45,
        description="slope through the water that the vehicle can be trusted to hold at the approach's speed [deg]",
    )
    final_distance: float = Field(default=20.0, gt=0, description="distance at which the last metres begin [m]")
    attempts: int = Field(default=3, ge=1, le=1000, description="attempts before the vehicle gives up")
    returns: int = Field(
        default=6,
        ge=0,
        le=1000,
        description="approaches that may be broken off before the point of no return without an attempt being counted",
    )
    least_chance: float = Field(
        default=0.5,
        ge=0,
        lt=1,
        description="least foretold chance to pass the mouth's plane within its radius for which it goes in [-]",
    )
    fix_timeout: float | None = Field(
        default=None,
        gt=0,
        description="time without a fix that breaks an approach off; none: the estimate's certainty decides [s]",
    )
    uncertain_timeout: float | None = Field(
        default=None,
        gt=0,
        description="time too uncertain in the last metres that breaks it off; none: decided before [s]",
    )
    lost_timeout: float = Field(default=180.0, gt=0, description="time without a fix that ends the trial [s]")
    progress_timeout: float = Field(
        default=150.0, gt=0, description="time without getting nearer to the gate that ends the trial [s]"
    )
