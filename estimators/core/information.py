"""What ranges and bearings at one moment say of a place: Fisher information, error ellipses, criteria of design.

Places are (..., d) with d = 2, north and east, or d = 3, north, east and depth [m]; leading axes are grids or trials.
Source: Bishop et al. (2010), Optimality analysis of sensor-target localization geometries; Moreno-Salinas (2013).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimators.core.consistency import chi_square
from estimators.core.errors import NotPositiveDefiniteError, ParameterError
from estimators.core.types import Array

SINGULAR = 1e-12  # least over largest eigenvalue below which information leaves a direction open


class Ellipse(NamedTuple):
    """An error ellipse in the horizontal plane."""

    major: float  # semi-axis [m]
    minor: float  # semi-axis [m]
    bearing: float  # of the major axis from north, clockwise, in [0, pi) [rad]

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return math.pi * self.major * self.minor


class Criteria(NamedTuple):
    """The usual scalars of an information matrix, the larger the better."""

    d: Array  # (...,) determinant of the information: D-optimality
    a: Array  # (...,) 1 / trace of the bound: A-optimality; 0 where a direction is open
    e: Array  # (...,) least eigenvalue of the information: E-optimality


def directions(place: ArrayLike, beacons: ArrayLike) -> tuple[Array, Array]:
    """Unit vectors (..., n, d) from n beacons (n, d) to places (..., d), and the ranges (..., n) [m].

    Raises:
        ParameterError: A place lies on a beacon, where a range has no derivative, or sizes do not fit.
    """
    place, beacons = np.asarray(place, dtype=float), np.atleast_2d(np.asarray(beacons, dtype=float))
    if place.shape[-1] not in (2, 3) or beacons.shape[-1] != place.shape[-1]:
        raise ParameterError(f"places {place.shape} and beacons {beacons.shape} must both have 2 or both 3 coordinates")
    away = place[..., None, :] - beacons
    ranges = np.linalg.norm(away, axis=-1)
    if not (ranges > 0.0).all():
        raise ParameterError("a place lies on a beacon, where a range has no derivative")
    return away / ranges[..., None], ranges


def range_information(place: ArrayLike, beacons: ArrayLike, deviations: ArrayLike) -> Array:
    """Information (..., d, d) [1/m^2] of a range to each of n beacons, F = sum u u' / sigma^2.

    Args:
        place: Where the vehicle is (..., d).
        beacons: Where the beacons are (n, d).
        deviations: Of each range [m]; one number stands for all.

    Raises:
        ParameterError: A deviation is not positive and finite, or as `directions`.
    """
    u, _ = directions(place, beacons)
    return _summed(u, _weights(deviations, u.shape[-2]))


def bearing_information(
    place: ArrayLike, beacons: ArrayLike, deviations: ArrayLike, elevations: ArrayLike | None = None
) -> Array:
    """Information (..., d, d) [1/m^2] of a bearing to each of n beacons, in 3-D with elevations too if they are given.

    A bearing says b' / rho of the horizontal, b across the line of sight and rho its horizontal length; an elevation
    e' / r, e across the line of sight in the vertical plane and r its length.

    Args:
        place: Where the vehicle is (..., d).
        beacons: Where the beacons are (n, d).
        deviations: Of each bearing [rad]; one number stands for all.
        elevations: Deviations of each elevation [rad]; None: none is measured.

    Raises:
        ParameterError: A deviation is not positive and finite, elevations in 2-D, a place straight above or below a
            beacon, or as `directions`.
    """
    u, r = directions(place, beacons)
    shares = np.hypot(u[..., 0], u[..., 1])  # of the range that is horizontal
    if not (shares > 0.0).all():
        raise ParameterError("a place lies straight above or below a beacon, where a bearing has no derivative")
    across = np.zeros_like(u)
    across[..., 0], across[..., 1] = -u[..., 1] / shares, u[..., 0] / shares
    F = _summed(across / (shares * r)[..., None], _weights(deviations, u.shape[-2]))
    if elevations is None:
        return F
    if u.shape[-1] != 3:
        raise ParameterError("elevations need places in 3-D")
    upright = np.empty_like(u)
    upright[..., :2], upright[..., 2] = -u[..., :2] * (u[..., 2] / shares)[..., None], shares
    return F + _summed(upright / r[..., None], _weights(elevations, u.shape[-2]))


def with_known_depth(information: Array) -> Array:
    """Horizontal information (..., 2, 2) of (..., 3, 3) when a gauge gives the depth."""
    return information[..., :2, :2]


def marginal(information: Array, keep: int) -> Array:
    """Information (..., keep, keep) of the first `keep` states when the others are unknown too (Schur complement).

    Raises:
        NotPositiveDefiniteError: The others cannot be told even if the first are known.
    """
    A, B, C = information[..., :keep, :keep], information[..., :keep, keep:], information[..., keep:, keep:]
    if C.shape[-1] and not (np.linalg.eigvalsh(C)[..., 0] > 0.0).all():
        raise NotPositiveDefiniteError("the other states cannot be told; give them prior information")
    return A - B @ np.linalg.solve(C, np.swapaxes(B, -1, -2))


def bound(information: Array) -> Array:
    """The Cramér-Rao bound (..., d, d), the inverse; infinite on the diagonal where a direction is open."""
    information = np.asarray(information, dtype=float)
    values = np.linalg.eigvalsh(information)
    blind = ~(values[..., 0] > SINGULAR * values[..., -1])
    d = information.shape[-1]
    result = np.linalg.inv(np.where(blind[..., None, None], np.eye(d), information))
    return np.where(blind[..., None, None], np.where(np.eye(d, dtype=bool), np.inf, 0.0), result)


def rms_bound(information: Array) -> Array:
    """Least rms error of the place (...,) [m], the root of the bound's trace; infinite where a direction is open."""
    return np.sqrt(np.trace(bound(information), axis1=-2, axis2=-1))


def criteria(information: Array) -> Criteria:
    """D, A and E criteria of information (..., d, d)."""
    with np.errstate(divide="ignore"):
        a = 1.0 / np.trace(bound(information), axis1=-2, axis2=-1)
    least = np.asarray(np.linalg.eigvalsh(information)[..., 0], dtype=np.float64)
    return Criteria(np.linalg.det(information), a, least)


def error_ellipse(covariance: Array, probability: float | None = None) -> Ellipse:
    """The ellipse of a covariance (2, 2), or of the horizontal part of a larger one.

    Args:
        covariance: [m^2], positive semi-definite; infinite axes are allowed.
        probability: That a Gaussian error lies inside; None: of one standard deviation (39 %).

    Raises:
        NotPositiveDefiniteError: It is not positive semi-definite.
    """
    P = np.asarray(covariance, dtype=float)[:2, :2]
    if not np.isfinite(P).all():
        return Ellipse(math.inf, math.inf, 0.0)
    values, vectors = np.linalg.eigh(P)
    if values[0] < -1e-9 * abs(values[1]):
        raise NotPositiveDefiniteError(f"covariance {P.tolist()} is not positive semi-definite")
    scale = 1.0 if probability is None else chi_square(probability, 2)
    minor, major = np.sqrt(np.maximum(values, 0.0) * scale)
    return Ellipse(float(major), float(minor), math.atan2(vectors[1, 1], vectors[0, 1]) % math.pi)


def _weights(deviations: ArrayLike, count: int) -> Array:
    sigma = np.broadcast_to(np.asarray(deviations, dtype=float), (count,))
    if not (np.isfinite(sigma) & (sigma > 0.0)).all():
        raise ParameterError(f"deviations {sigma.tolist()} must be finite and above 0")
    return sigma**-2


def _summed(rows: Array, weights: Array) -> Array:
    return np.einsum("...ni,n,...nj->...ij", rows, weights, rows)
