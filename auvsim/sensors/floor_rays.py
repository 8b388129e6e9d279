"""Slant ranges from a transducer to the sea floor along narrow beams, for altimeters and Doppler logs."""

import math

from auvsim.base.frames import Array
from auvsim.water.terrain import Terrain

LEVEL = 0.05  # downward part of a direction from which on a beam is taken as level [-]
MOST_STEPS = 20
CLOSE = 1e-3  # step from which on a range is found [m]


def slant_range(terrain: Terrain, place: Array, direction: Array) -> float:
    """Range [m] along a beam to the sea floor, infinite where it does not meet it at one definite range.

    The depth under the beam's end makes the next range, until they agree: at once over a level floor, quickly where
    the floor's slope times the tangent of the beam's tilt is below 1. Where it is not, as on the side of a rock,
    ranges may not settle: such an echo is spread over many ranges, and counts as none.

    Args:
        terrain: the sea floor.
        place: (3,) of the transducer, NED [m].
        direction: (3,) unit vector, NED.
    """
    north, east, down = place.tolist()
    to_north, to_east, downward = direction.tolist()
    if downward <= LEVEL:
        return math.inf
    distance = (terrain.depth(north, east) - down) / downward
    for _ in range(MOST_STEPS):
        depth = terrain.depth(north + to_north * distance, east + to_east * distance)
        before, distance = distance, (depth - down) / downward
        if abs(distance - before) < CLOSE:
            return distance if distance > 0.0 else math.inf
    return math.inf
