"""The water as the compiled code reads it: its layout in `mjData.userdata`, one slot per vehicle.

A slot is a local expansion about a time and a place, in MuJoCo's world axes. A reset zeroes it: still water without
end. Above the surface, if there is one, there is no water.
"""

from auvsim.base.frames import Array, flip, flip_matrix
from auvsim.water.field import Water
from auvsim.water.surface import Surface

# Offsets: time, place (3), velocity (3), dv/dt (3), dv_i/dx_j (9); 1 if there is a surface, and then its elevation,
# rate, and slopes along x and y.
TIME, PLACE, VELOCITY, DERIVATIVE, GRADIENT, SURFACE, ELEVATION = 0, 1, 4, 7, 10, 19, 20
WATER = 24  # numbers in a slot


def fill(slot: Array, time: float, position: Array, water: Water, surface: Surface | None = None) -> None:
    """Writes the water about a time [s] and a position (3,) in MuJoCo's world [m] into a slot (WATER,).

    Without a surface the water has no end; mean sea level is at z = 0.
    """
    slot[TIME] = time
    slot[PLACE : PLACE + 3] = position
    slot[VELOCITY : VELOCITY + 3] = flip(water.velocity)
    slot[DERIVATIVE : DERIVATIVE + 3] = flip(water.derivative)
    slot[GRADIENT : GRADIENT + 9] = flip_matrix(water.gradient).ravel()
    slot[SURFACE] = 0.0 if surface is None else 1.0
    if surface is not None:
        slot[ELEVATION:WATER] = surface.elevation, surface.rate, surface.north_slope, -surface.east_slope
