"""Current fields as data: the settings of every kind of current."""

import math
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
    direction_deg: float = Field(
        default=0.0, description="direction it flows to before the turn, clockwise from north [deg]"
    )
    angle_deg: float = Field(default=90.0, description="angle of the turn, positive clockwise [deg]")
    start: float = Field(default=120.0, ge=0.0, description="time at which the turn starts [s]")
    end: float = Field(default=130.0, gt=0.0, description="time at which the turn ends [s]")

    @model_validator(mode="after")
    def _ordered(self) -> "TurningSettings":
        if self.end <= self.start:
            raise ValueError(f"the turn ends at {self.end} s, which must be after its start at {self.start} s")
        return self


class ApproachTurnSettings(Settings):
    """A uniform current that turns once in every docking attempt, somewhere on its approach."""

    kind: Literal["approach_turn"] = "approach_turn"
    speed: float = Field(default=0.5, ge=0.0, description="horizontal speed [m/s]")
    direction_deg: float = Field(
        default=0.0, description="direction it flows to before the first turn, clockwise from north [deg]"
    )
    angle_deg: float = Field(default=90.0, gt=0.0, description="angle of each turn, to a side drawn at random [deg]")
    duration: float = Field(default=10.0, gt=0.0, description="time that a turn takes [s]")


class Knot(Settings):
    """A uniform current at one time."""

    time: float = Field(ge=0.0, description="time [s]")
    north: float = Field(default=0.0, description="velocity north then [m/s]")
    east: float = Field(default=0.0, description="velocity east then [m/s]")


class KnotsSettings(Settings):
    """A uniform current given at some times: linear between them, constant before the first and after the last."""

    kind: Literal["knots"] = "knots"
    knots: tuple[Knot, ...] = Field(
        default=(Knot(time=0.0), Knot(time=300.0, north=0.3)), min_length=1, description="currents at increasing times"
    )

    @model_validator(mode="after")
    def _ordered(self) -> "KnotsSettings":
        times = [knot.time for knot in self.knots]
        if any(after <= before for before, after in pairwise(times)):
            raise ValueError(f"the times of the knots are {times}, they must increase")
        return self


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
    correlation_time: float = Field(default=30.0, ge=0.1, description="time in which correlation falls to 1/e [s]")


class BoundaryLayerSettings(Settings):
    """A steady current that friction slows towards the sea floor, by the logarithmic law of the wall.

    It is constant from 1.5 thicknesses above the floor on, and joins the law (up to half a thickness) smoothly.
    """

    kind: Literal["boundary_layer"] = "boundary_layer"
    speed: float = Field(default=0.5, ge=0.0, description="horizontal speed above the layer [m/s]")
    direction_deg: float = Field(default=0.0, description="direction it flows to, clockwise from north [deg]")
    floor: float = Field(default=40.0, gt=0.0, description="depth of the sea floor [m]")
    thickness: float = Field(default=10.0, gt=0.0, description="thickness of the layer above the sea floor [m]")
    roughness: float = Field(default=0.005, gt=0.0, description="roughness length z_0: sand ripples 0.002 to 0.006 [m]")

    @model_validator(mode="after")
    def _thick(self) -> "BoundaryLayerSettings":
        if self.thickness < 10.0 * self.roughness:
            raise ValueError(f"a layer of {self.thickness} m is too thin for a roughness of {self.roughness} m")
        return self


class WakeSettings(Settings):
    """Velocity deficit behind a structure (lee and wake), to be added to a current."""

    kind: Literal["wake"] = "wake"
    north: float = Field(default=0.0, description="place of the structure [m]")
    east: float = Field(default=0.0, description="place of the structure [m]")
    depth: float = Field(default=15.0, description="depth of its middle [m]")
    speed: float = Field(default=0.5, ge=0.0, description="speed of the undisturbed current [m/s]")
    direction_deg: float = Field(default=0.0, description="direction it flows to, clockwise from north [deg]")
    drag_area: float = Field(default=1.0, gt=0.0, description="drag coefficient times frontal area [m2]")
    lee: float = Field(
        default=0.6, gt=0.0, lt=1.0, description="share of the current lost on the axis, before the wake widens [-]"
    )
    growth: float = Field(default=0.05, gt=0.0, lt=1.0, description="growth of the wake's width per metre [-]")


class WavesSettings(Settings):
    """Orbital velocity of a long-crested irregular sea: linear (Airy) waves of a JONSWAP spectrum."""

    kind: Literal["waves"] = "waves"
    height: float = Field(default=1.0, gt=0.0, description="significant wave height [m]")
    period: float = Field(default=8.0, gt=0.0, description="peak period [s]")
    direction_deg: float = Field(default=0.0, description="direction the waves travel to, clockwise from north [deg]")
    peakedness: float = Field(
        default=3.3, ge=1.0, le=10.0, description="gamma; 1 is Pierson and Moskowitz's spectrum [-]"
    )
    floor: float = Field(default=40.0, gt=0.0, description="depth of the water [m]")
    components: int = Field(default=40, ge=1, le=1000, description="number of regular waves of equal energy in the sea")

    @model_validator(mode="after")
    def _unbroken(self) -> "WavesSettings":
        steepest = 0.1 * 9.81 * self.period**2 / (2.0 * math.pi)  # breaking seas reach a steepness of 0.07 to 0.1
        if self.height > steepest:
            raise ValueError(f"waves of {self.height} m would break at {self.period} s; at most {steepest:.3g} m")
        return self


class GridSettings(Settings):
    """Currents from a NetCDF file of a model or of measurements, on a grid of time, depth and horizontal place.

    Velocities are found by the CF standard names eastward_ and northward_sea_water_velocity (upward_ if there is one),
    coordinates by standard_name, axis or units; depth and time may be missing. Latitudes and longitudes become metres
    on the plane that touches the WGS84 ellipsoid in the datum.
    """

    kind: Literal["grid"] = "grid"
    file: str = Field(description="path of the NetCDF file (classic or NetCDF-4)")
    outside: Literal["refuse", "hold"] = Field(
        default="refuse", description="outside the grid: refuse, or hold the value at its edge"
    )
    start: float = Field(default=0.0, description="start of the trial, after the first time in the file [s]")
    northward: str | None = Field(default=None, description="name of the variable, if it has no standard name")
    eastward: str | None = Field(default=None, description="name of the variable, if it has no standard name")
    upward: str | None = Field(default=None, description="name of the variable, if it has no standard name")
    latitude: float | None = Field(
        default=None, ge=-85.0, le=85.0, description="of the datum, for geographic grids [deg]"
    )
    longitude: float | None = Field(default=None, ge=-180.0, le=360.0, description="of the datum [deg]")


class SumSettings(Settings):
    """The sum of other currents; each random term has a stream of its own."""

    kind: Literal["sum"] = "sum"
    terms: tuple["CurrentSettings", ...] = Field(min_length=1, description="currents to add")


CurrentSettings = Annotated[
    NoneSettings
    | UniformSettings
    | TurningSettings
    | ApproachTurnSettings
    | KnotsSettings
    | ShearSettings
    | GustSettings
    | BoundaryLayerSettings
    | WakeSettings
    | WavesSettings
    | GridSettings
    | SumSettings,
    Field(discriminator="kind"),
]
SumSettings.model_rebuild()
