"""The strips of a hull as the cylinders that the surface cuts."""

import numpy as np

from auvsim.base.frames import Array


def submerged_strips(fields: dict[str, Array]) -> dict[str, Array]:
    """Finds the cylinders along a hull's axis whose volume the surface cuts, and how deep none is cut.

    Lengths are from the strips' spacing, diameters from their areas, volumes in proportion, sloped along the axis so
    that their centre is the origin. A hull without strips, or whose strips do not allow that, is one cylinder as long
    as thick.

    Args:
        fields: of the hull, by name.

    Returns:
        Values of the fields `forces.DERIVED`, by name.
    """
    volume = fields["displaced_volume"][0]
    x, area = fields.get("strip_x", np.zeros(0)), fields.get("strip_area", np.zeros(0))
    if x.size > 1 and abs(np.sign(np.diff(x)).sum()) == x.size - 1 and np.all(area > 0):
        length = np.abs(np.gradient(x))
        radius = 0.5 * area / length
        share = radius**2 * length
        share *= 1.0 - x * (share @ x) / (share @ x**2)
        if np.all(share > 0):
            reach = 1.5 * np.max(np.abs(x) + np.hypot(radius, 0.5 * length))  # waves may be as steep as 1 in 2
            return {
                "strip_volume": volume * share / share.sum(),
                "strip_radius": radius,
                "strip_half_length": 0.5 * length,
                "reach": np.array([reach]),
            }
    radius = np.cbrt(volume / (2.0 * np.pi))
    one = np.array([radius])
    return {"strip_volume": np.array([volume]), "strip_radius": one, "strip_half_length": one, "reach": 1.5 * one}
