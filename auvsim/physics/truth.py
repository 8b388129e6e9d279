"""True states of vehicles and structures: what sensors measure and logs keep."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auvsim.base.frames import Array


class Truth(NamedTuple):
    """True state of a vehicle at one instant, in NED from the datum and forward-starboard-down."""

    time: float  # [s]
    position: Array  # (3,) north, east, down of the body origin (centre of buoyancy) [m]
    quaternion: Array  # (4,) wxyz, body to NED
    attitude: Array  # (3,) roll, pitch, yaw [rad]
    nu: Array  # (6,) body velocity over ground u, v, w, p, q, r [m/s, rad/s]
    current: Array  # (3,) water velocity at the body origin, NED [m/s]
    actuators: Array  # (n,) in the order of the actuation's channels: fin angles [rad], then shaft speed [rad/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class StructurePose:
    """Where a structure truly is: the centre of its mouth in NED, and its attitude."""

    north: float = 0.0  # [m]
    east: float = 0.0  # [m]
    depth: float  # [m]
    heading: float  # course of a vehicle that enters [rad]
    pitch: float = 0.0  # [rad]
    roll: float = 0.0  # [rad]

    @property
    def position(self) -> Array:
        """Centre of the mouth (3,) in NED [m]."""
        return np.array([self.north, self.east, self.depth])
