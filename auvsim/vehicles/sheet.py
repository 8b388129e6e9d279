"""Data sheets of torpedo-shaped vehicles with four tail fins: what makers publish, checked."""

import math
from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from auvsim.base import model_file
from auvsim.base.settings import Settings

DENSITY = 1026.0  # of the water in which the vehicle is trimmed [kg/m3]
GRAVITY = 9.81  # [m/s2]
FULL = (0.55, 1.0)  # shares of the enclosing cylinder that hulls fill
WIDEST_SCREW = 2.0  # diameter of a propeller by the hull's
WIDEST_FIN = 2.0  # span of a fin by the hull's diameter
ASPECT = (0.1, 10.0)  # span of a fin by its chord


class FinsSheet(Settings):
    """Four all-moving tail fins."""

    tail: Literal["cross", "x"] = Field(default="cross", description="upright fins, or turned by 45 deg")
    span: float = Field(gt=0.0, le=2.0, description="of one fin, from the hull to its tip [m]")
    chord: float = Field(gt=0.0, le=2.0, description="mean chord [m]")
    place: float = Field(gt=0.0, description="of their hinges, behind amidships [m]")
    limit_deg: float = Field(default=15.0, gt=0.0, le=45.0, description="largest angle [deg]")


class Sheet(Settings):
    """What a data sheet says."""

    name: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,31}$", description="of the vehicle: letters, digits and '_'")
    length: float = Field(gt=0.0, le=20.0, description="of the hull [m]")
    diameter: float = Field(gt=0.0, le=5.0, description="of the hull [m]")
    mass: float = Field(gt=0.0, description="in air [kg]")
    top_speed: float = Field(ge=0.1, le=20.0, description="through the water [m/s]")
    shaft_rpm: float = Field(gt=0.0, le=20_000.0, description="at that speed [rpm]")
    fins: FinsSheet
    buoyancy: float = Field(default=0.0, description="net, positive floats, in sea water [N]")
    centre_of_gravity: float = Field(default=0.01, gt=0.0, description="below the axis [m]")
    propeller_diameter: float | None = Field(default=None, gt=0.0, description="none: estimated [m]")
    drag: float | None = Field(default=None, gt=0.0, description="at the top speed; none: estimated [N]")

    @model_validator(mode="after")
    def _fits(self) -> "Sheet":
        if not 3.0 <= self.length / self.diameter <= 20.0:
            raise ValueError(
                f"diameter: the hull is {self.length / self.diameter:.3g} times as long as wide; estimates hold "
                "for 3 to 20"
            )
        cylinder = math.pi / 4.0 * self.diameter**2 * self.length * DENSITY
        if not FULL[0] * cylinder <= self.mass <= FULL[1] * cylinder:
            raise ValueError(
                f"mass: {self.mass:g} kg does not float in a hull of {self.length:g} x {self.diameter:g} m; "
                f"give {FULL[0] * cylinder:.3g} to {FULL[1] * cylinder:.3g} kg, or check length and diameter"
            )
        if not abs(self.buoyancy) <= 0.05 * self.mass * GRAVITY:
            raise ValueError(f"buoyancy: {self.buoyancy:g} N is more than 5 % of the weight; give ballast, not this")
        self._tail_fits()
        if self.propeller_diameter is not None and self.propeller_diameter > WIDEST_SCREW * self.diameter:
            raise ValueError(
                f"propeller_diameter: {self.propeller_diameter:g} m is more than {WIDEST_SCREW:g} times the hull's "
                f"diameter, {self.diameter:g} m"
            )
        if not self.centre_of_gravity <= 0.5 * self.diameter:
            raise ValueError(f"centre_of_gravity: {self.centre_of_gravity:g} m is outside the hull")
        return self

    def _tail_fits(self) -> None:
        fins, end = self.fins, 0.5 * self.length
        if not fins.place <= end:
            raise ValueError(f"fins.place: {fins.place:g} m is behind the hull's end at {end:g} m")
        if not fins.place >= 0.5 * end:
            raise ValueError(f"fins.place: {fins.place:g} m is no place of tail fins; give {0.5 * end:g} to {end:g} m")
        if not fins.span <= WIDEST_FIN * self.diameter:
            raise ValueError(
                f"fins.span: {fins.span:g} m is more than {WIDEST_FIN:g} times the hull's diameter, {self.diameter:g} m"
            )
        if not ASPECT[0] <= fins.span / fins.chord <= ASPECT[1]:
            raise ValueError(
                f"fins.chord: the span is {fins.span / fins.chord:.3g} times the chord of {fins.chord:g} m; estimates "
                f"hold for {ASPECT[0]:g} to {ASPECT[1]:g}"
            )


def read(path: Path) -> Sheet:
    """Reads a data sheet.

    Raises:
        InputError: One line with the file, the line and the key at fault.
    """
    return model_file.read(path, Sheet, "a data sheet")
