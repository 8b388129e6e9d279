"""Coefficients of a torpedo-shaped vehicle from its data sheet: Lamb, strip theory, lift slopes, friction line.

Each is what literature gives where nothing is measured; errors of 20 to 50 % are usual. Axes about amidships.
"""

import math
from dataclasses import dataclass

from auvsim.base.errors import InputError
from auvsim.vehicles.sheet import DENSITY, GRAVITY, Sheet

VISCOSITY = 1.19e-6  # kinematic, of sea water at 15 degrees [m2/s]
CROSS_FLOW = 1.1  # drag coefficient of a cylinder across the flow (Hoerner 1965)
BODY_SLOPE = 0.003  # lift slope of slender hulls on l d [1/deg] (Hoerner 1965), as Prestero 2001 has it
BODY_CENTRE = 0.65  # where it acts, in lengths behind the nose (the same)
K_T, K_Q = (0.4566, -0.4174), (0.07, -0.0585)  # Wageningen B, linear in J, as of the REMUS-100
WAKE, DEDUCTION = 0.056, 0.1  # shares, as of the REMUS-100
ROLL = 0.3  # damping ratio of roll at rest


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimates:
    """Numbers that a data sheet does not give; SNAME signs of M_A and D, which are positive."""

    volume: float  # [m3]
    inertia: tuple[float, float]  # about the axis, and across, of the mass alone [kg m2]
    added_mass: tuple[float, float]  # along and across [kg]
    added_inertia: float  # across [kg m2]
    surge_drag: float  # on |u| u [kg/m]
    roll_damping: float  # [N m s]
    body_lift: float  # [kg/m]
    body_lift_x: float  # [m]
    fin_area: float  # [m2]
    fin_slope: float  # [1/rad]
    fin_induced: float  # on C_L squared [-]
    propeller_diameter: float  # [m]
    thrust_factor: float  # on K_T, that reaches the top speed [-]


def lamb(length: float, diameter: float) -> tuple[float, float, float]:
    """Lamb's factors of a prolate spheroid: along, across, turning (Lamb 1932, art. 114; Fossen 2021, sec. 8.4.2)."""
    a, b = 0.5 * length, 0.5 * diameter
    e = math.sqrt(1.0 - (b / a) ** 2)
    log = math.log((1.0 + e) / (1.0 - e))
    alpha = 2.0 * (1.0 - e * e) / e**3 * (0.5 * log - e)
    beta = 1.0 / e**2 - (1.0 - e * e) / (2.0 * e**3) * log
    turning = e**4 * (beta - alpha) / ((2.0 - e * e) * (2.0 * e * e - (2.0 - e * e) * (beta - alpha)))
    return alpha / (2.0 - alpha), beta / (2.0 - beta), turning


def lift_slope(span: float, chord: float) -> float:
    """Slope of a low-aspect fin on a hull, which doubles its aspect ratio [1/rad] (Hoerner 1965, by Prestero 2001)."""
    aspect = 2.0 * span / chord
    return 1.0 / (1.0 / (2.0 * math.pi * 0.9) + 1.0 / (math.pi * aspect))


def hull_drag(length: float, diameter: float, speed: float) -> float:
    """Drag of a streamlined hull on |u| u [kg/m]: ITTC 1957 friction line and Hoerner's form factor."""
    ratio = diameter / length
    friction = 0.075 / (math.log10(speed * length / VISCOSITY) - 2.0) ** 2
    wetted = 0.9 * math.pi * diameter * length  # of the cylinder's side
    return 0.5 * DENSITY * wetted * friction * (1.0 + 1.5 * ratio**1.5 + 7.0 * ratio**3)


def estimate(sheet: Sheet) -> Estimates:
    """All that a sheet does not give.

    Raises:
        InputError: No propeller reaches the top speed at the shaft speed.
    """
    volume = (sheet.mass + sheet.buoyancy / GRAVITY) / DENSITY
    a, b = 0.5 * sheet.length, 0.5 * sheet.diameter
    along, across, turning = lamb(sheet.length, sheet.diameter)
    water = DENSITY * volume
    inertia = 0.4 * sheet.mass * b * b, 0.2 * sheet.mass * (a * a + b * b)
    fins = sheet.fins
    slope = lift_slope(fins.span, fins.chord)
    area = fins.span * fins.chord
    profile = 4.0 * 0.5 * DENSITY * area * 0.01
    if sheet.drag is None:
        surge = 1.2 * hull_drag(sheet.length, sheet.diameter, sheet.top_speed)  # a fifth for what sticks out
    else:
        surge = sheet.drag / sheet.top_speed**2 - profile
        if surge <= 0.0:
            raise InputError(f"drag: {sheet.drag:g} N at {sheet.top_speed:g} m/s is less than that of the fins alone")
    diameter, factor = _propeller(sheet, surge + profile)
    weight = sheet.mass * GRAVITY
    return Estimates(
        volume=volume, inertia=inertia, added_mass=(along * water, across * water),
        added_inertia=turning * 0.2 * water * (a * a + b * b), surge_drag=surge,
        roll_damping=2.0 * ROLL * math.sqrt(inertia[0] * weight * sheet.centre_of_gravity),
        body_lift=0.5 * DENSITY * sheet.diameter * sheet.length * BODY_SLOPE * 180.0 / math.pi,
        body_lift_x=(0.5 - BODY_CENTRE) * sheet.length, fin_area=area, fin_slope=slope,
        fin_induced=1.0 / (math.pi * 0.9 * 2.0 * fins.span / fins.chord), propeller_diameter=diameter,
        thrust_factor=factor,
    )  # fmt: skip


def _propeller(sheet: Sheet, drag: float) -> tuple[float, float]:
    """Diameter [m] and factor on K_T with which thrust is drag at the top speed and shaft speed.

    Where the sheet gives the diameter, the factor is found; else the smallest diameter, with a factor of 1 (bisection).
    """
    rate = sheet.shaft_rpm / 60.0
    needed = drag * sheet.top_speed**2 / (1.0 - DEDUCTION)

    def thrust(diameter: float) -> float:
        advance = sheet.top_speed * (1.0 - WAKE) / (rate * diameter)
        return DENSITY * rate**2 * diameter**4 * (K_T[0] + K_T[1] * advance)

    if sheet.propeller_diameter is not None:
        found = thrust(sheet.propeller_diameter)
        if not found > 0.2 * needed:
            raise InputError(
                f"propeller_diameter: a screw of {sheet.propeller_diameter:g} m at {sheet.shaft_rpm:g} rpm does not "
                f"drive {sheet.top_speed:g} m/s; give a larger one, or a higher shaft_rpm"
            )
        return sheet.propeller_diameter, needed / found
    low, high = 0.01, 2.0 * sheet.diameter
    if thrust(high) < needed:
        raise InputError(
            f"shaft_rpm: no propeller up to twice the hull's diameter drives {sheet.top_speed:g} m/s at "
            f"{sheet.shaft_rpm:g} rpm; check both"
        )
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if thrust(middle) < needed else (low, middle)
    return high, 1.0
