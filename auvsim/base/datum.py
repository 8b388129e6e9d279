"""The datum: where on the earth the origin of NED is, and the exact conversion between NED and geodetic coordinates.

NED is the local tangent plane of the WGS84 ellipsoid at the datum (origin on the ellipsoid), reached through
earth-centred earth-fixed coordinates (ECEF), so that nothing is linearised.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from auvsim.base.errors import InputError
from auvsim.base.frames import Array

SEMI_MAJOR = 6378137.0  # of WGS84 [m]
FLATTENING = 1.0 / 298.257223563  # of WGS84
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)  # first eccentricity, squared
_ITERATIONS = 6  # each divides the error of latitude by 150 or more near the surface: 1e-16 after the fifth


class Geodetic(NamedTuple):
    """Places on the earth."""

    latitude: Array  # (...) [deg]
    longitude: Array  # (...) [deg], in (-180, 180]
    height: Array  # (...) above the ellipsoid [m]


def geodetic_to_ecef(latitude: "Array | float", longitude: "Array | float", height: "Array | float" = 0.0) -> Array:
    """ECEF positions (..., 3) [m] of latitudes, longitudes (...) [deg] and heights (...) [m]."""
    phi, lam, height = np.broadcast_arrays(np.radians(latitude), np.radians(longitude), np.asarray(height, dtype=float))
    normal = SEMI_MAJOR / np.sqrt(1.0 - ECCENTRICITY2 * np.sin(phi) ** 2)  # radius of curvature in the prime vertical
    across = (normal + height) * np.cos(phi)
    along = (normal * (1.0 - ECCENTRICITY2) + height) * np.sin(phi)
    return np.stack([across * np.cos(lam), across * np.sin(lam), along], axis=-1)


def ecef_to_geodetic(ecef: Array) -> Geodetic:
    """Latitude, longitude [deg] and height [m] of ECEF positions (..., 3) [m], by Bowring's iteration to convergence.

    Exact to rounding for places within some 1000 km of the surface.
    """
    x, y, z = np.moveaxis(np.asarray(ecef, dtype=float), -1, 0)
    p = np.hypot(x, y)
    reduced = np.arctan2(z, (1.0 - FLATTENING) * p)  # reduced latitude of the ellipsoid's point below
    phi = reduced
    for _ in range(_ITERATIONS):
        second = ECCENTRICITY2 / (1.0 - FLATTENING)
        phi = np.arctan2(
            z + second * SEMI_MAJOR * np.sin(reduced) ** 3, p - ECCENTRICITY2 * SEMI_MAJOR * np.cos(reduced) ** 3
        )
        reduced = np.arctan2((1.0 - FLATTENING) * np.sin(phi), np.cos(phi))
    root = np.sqrt(1.0 - ECCENTRICITY2 * np.sin(phi) ** 2)
    height = p * np.cos(phi) + z * np.sin(phi) - SEMI_MAJOR * root
    return Geodetic(np.degrees(phi), np.degrees(np.arctan2(y, x)), height)


@dataclass(frozen=True, kw_only=True)
class Datum:
    """Place on the WGS84 ellipsoid that is the origin of NED.

    Raises:
        InputError: the latitude is not within -90 to 90 degrees or the longitude not within -180 to 180.
    """

    latitude: float  # geodetic [deg]
    longitude: float  # [deg]

    def __post_init__(self) -> None:
        if not (-90.0 <= self.latitude <= 90.0 and -180.0 <= self.longitude <= 180.0):
            raise InputError(
                f"datum at latitude {self.latitude:g}, longitude {self.longitude:g} deg: latitude must be within "
                "-90 to 90 and longitude within -180 to 180"
            )

    @cached_property
    def _origin(self) -> Array:
        return geodetic_to_ecef(self.latitude, self.longitude)

    @cached_property
    def _rotation(self) -> Array:
        """Rotation matrix (3, 3) from NED to ECEF (Fossen 2021, eq. 2.105)."""
        phi, lam = np.radians(self.latitude), np.radians(self.longitude)
        sp, cp, sl, cl = np.sin(phi), np.cos(phi), np.sin(lam), np.cos(lam)
        return np.array([[-sp * cl, -sl, -cp * cl], [-sp * sl, cl, -cp * sl], [cp, 0.0, -sp]])

    def geodetic(self, position: Array) -> Geodetic:
        """Latitude, longitude [deg] and height [m] of positions (..., 3) in NED [m]."""
        return ecef_to_geodetic(self._origin + np.asarray(position, dtype=float) @ self._rotation.T)

    def ned(self, latitude: "Array | float", longitude: "Array | float", height: "Array | float" = 0.0) -> Array:
        """Positions (..., 3) in NED [m] of latitudes, longitudes (...) [deg] and heights (...) [m]."""
        return (geodetic_to_ecef(latitude, longitude, height) - self._origin) @ self._rotation
