"""What is known of a hull's motion before a log is read: from its length, beam, draught and mass alone.

Sway and yaw by the regressions of Clarke, Gedling and Hine (Trans. RINA 125, 1983), surge's added mass by Lamb's
spheroid (Hydrodynamics, art. 114). Of the rudder and the propeller nothing is known so.
"""

import math
from dataclasses import dataclass

import numpy as np

from auvsim.base.errors import InputError

DENSITY = 1025.0  # of sea water [kg/m3]
GYRADIUS = 0.25  # by the length
UNSURE = 0.5  # standard deviation of these coefficients, by their size: scatter of Clarke's data about his regressions


@dataclass(frozen=True, kw_only=True, slots=True)
class Dimensions:
    """A hull."""

    length: float  # [m]
    beam: float  # [m]
    draught: float  # [m]; of a submerged body half its height
    mass: float  # [kg]

    def __post_init__(self) -> None:
        for name in ("length", "beam", "draught", "mass"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise InputError(f"--{name} {value:g} must be positive; lengths in m, the mass in kg")
        if self.beam > 0.6 * self.length:
            raise InputError(f"--beam {self.beam:g} m of a hull {self.length:g} m long: lengths in m, along and across")
        if not 0.05 < self.block < 1.3:
            raise InputError(
                f"--mass {self.mass:g} kg is {self.block:.2g} of the block of water of that length, beam and draught; "
                "a hull's is 0.3 to 0.9: lengths in m, the mass in kg"
            )

    @property
    def block(self) -> float:
        """Block coefficient."""
        return self.mass / (DENSITY * self.length * self.beam * self.draught)


def coefficients(hull: Dimensions) -> dict[str, float]:
    """Coefficients of terms in SI units: what of the motion follows from the hull."""
    L, B, T, m = hull.length, hull.beam, hull.draught, hull.mass
    slender, wide, deep, fat = -math.pi * (T / L) ** 2, B / L, B / T, hull.block * B / T
    unit = 0.5 * DENSITY * L**2
    Y_vd = unit * L * slender * (1.0 + 0.16 * fat - 5.1 * wide**2)
    Y_rd = unit * L**2 * slender * (0.67 * wide - 0.0033 * deep**2)
    N_vd = unit * L**2 * slender * (1.1 * wide - 0.041 * deep)
    N_rd = unit * L**3 * slender * (1.0 / 12.0 + 0.017 * fat - 0.33 * wide)
    Y_uv = unit * slender * (1.0 + 0.40 * fat)
    Y_ur = unit * L * slender * (-0.5 + 2.2 * wide - 0.080 * deep)
    N_uv = unit * L * slender * (0.5 + 2.4 * T / L)
    N_ur = unit * L**2 * slender * (0.25 + 0.039 * deep - 0.56 * wide)
    M = np.array([[m - Y_vd, -Y_rd], [-N_vd, m * (GYRADIUS * L) ** 2 - N_rd]])
    by_sway, by_turning = np.linalg.solve(M, [Y_uv, N_uv]), np.linalg.solve(M, [Y_ur - m, N_ur])
    along = m * (1.0 + _spheroid(L, math.sqrt(2.0 * B * T)))
    return {
        "surge vr": float((m - Y_vd) / along),
        "sway uv": float(by_sway[0]), "sway ur": float(by_turning[0]),
        "yaw uv": float(by_sway[1]), "yaw ur": float(by_turning[1]),
    }  # fmt: skip


def _spheroid(length: float, diameter: float) -> float:
    """Added mass along the axis of a prolate spheroid by that of the water it displaces."""
    e = math.sqrt(max(1.0 - (diameter / length) ** 2, 1e-6))
    alpha = 2.0 * (1.0 - e**2) / e**3 * (0.5 * math.log((1.0 + e) / (1.0 - e)) - e)
    return alpha / (2.0 - alpha)
