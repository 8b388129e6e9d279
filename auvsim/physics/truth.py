"""What a world says of its vehicle and its dock: the state that sensors measure and logs keep."""

from dataclasses import dataclass
from typing import NamedTuple

from auvsim.base.frames import Array


class Truth(NamedTuple):
    """True state of a vehicle at one instant, in NED and forward-starboard-down.

    The origin of NED is on the sea surface above the centre of the dock's mouth.
    """

    time: float  # [s]
    position: Array  # (3,) north, east, down of the body origin (centre of buoyancy) [m]
    quaternion: Array  # (4,) wxyz, body to NED
    attitude: Array  # (3,) roll, pitch, yaw [rad]
    nu: Array  # (6,) body velocity over ground u, v, w, p, q, r [m/s, rad/s]
    current: Array  # (3,) water velocity at the body origin, NED [m/s]
    fins: Array  # (n,) fin angles, in the order of the vehicle's allocation [rad]
    shaft_speed: float  # propeller shaft speed [rad/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class DockPose:
    """Where the dock truly is: the centre of its mouth is at (0, 0, depth) in NED."""

    depth: float  # of the centre of the mouth [m]
    heading: float  # course of a vehicle that enters [rad]
    pitch: float = 0.0  # [rad]
    roll: float = 0.0  # [rad]
