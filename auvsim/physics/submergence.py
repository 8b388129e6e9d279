"""Submerged part of a hull, fin, propeller or thruster, as compiled functions."""

import math

from numba import njit

from auvsim.physics.forces import DERIVED, HULL, STRIPS
from auvsim.physics.water_slot import ELEVATION, SURFACE

_STRIP_X, _STRIP_VOLUME = HULL["strip_x"][0], DERIVED["strip_volume"][0]
_STRIP_RADIUS, _STRIP_HALF = DERIVED["strip_radius"][0], DERIVED["strip_half_length"][0]
_REACH = DERIVED["reach"][0]

# Not cached by itself: offsets come from `forces`, whose changes numba would not see here.
_inline = njit(inline="never", error_model="numpy", fastmath=False)


@_inline
def disc_share(height, radius):
    """Share of a disc's area that is under a surface at a height [m] above its centre; of a lying cylinder's volume."""
    if height >= radius:
        return 1.0
    if height <= -radius:
        return 0.0
    t = height / radius
    return 0.5 + (t * math.sqrt(1.0 - t * t) + math.asin(t)) / math.pi


@_inline
def surface_above(water, slot, time, x0, x1, x2):
    """Height [m] of the surface above a place in MuJoCo's world, from the expansion in `water[slot:]`."""
    e = slot + ELEVATION
    level = water[e] + water[e + 1] * (time - water[slot])
    return level + water[e + 2] * (x0 - water[slot + 1]) + water[e + 3] * (x1 - water[slot + 2]) - x2


@_inline
def share_under(water, slot, time, x0, x1, x2, radius):
    """Share of a disc of a radius [m] about a place that is under water."""
    if water[slot + SURFACE] == 0.0:
        return 1.0
    return disc_share(surface_above(water, slot, time, x0, x1, x2), radius)


@_inline
def volume_out(c, o, water, slot, time, x0, x1, x2, a0, a1, a2):
    """Volume of a hull that is out of the water, by its strips: cylinders along the axis, cut by a level surface.

    Args:
        c: coefficients, with the record at `o`.
        water: with the slot at `slot`.
        slot: place of the slot.
        time: [s].
        x0, x1, x2: the hull's origin in MuJoCo's world [m].
        a0, a1, a2: its axis, forward, in the world.

    Returns:
        The volume [m3] and its moment about the origin along the axis [m4].
    """
    out, moment = 0.0, 0.0
    if water[slot + SURFACE] == 0.0 or surface_above(water, slot, time, x0, x1, x2) > c[o + _REACH]:
        return out, moment
    for i in range(STRIPS):
        volume = c[o + _STRIP_VOLUME + i]
        if volume == 0.0:
            break
        x, radius, half = c[o + _STRIP_X + i], c[o + _STRIP_RADIUS + i], c[o + _STRIP_HALF + i]
        height = surface_above(water, slot, time, x0 + x * a0, x1 + x * a1, x2 + x * a2)
        extent = math.sqrt(radius * radius * (1.0 - a2 * a2) + half * half * a2 * a2)
        dry = volume * (1.0 - disc_share(height, extent))
        out += dry
        moment += x * dry
    return out, moment
