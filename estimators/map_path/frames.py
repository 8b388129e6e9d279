"""Sonar frames: an image on a polar or a Cartesian grid ahead of the vehicle, its geometry and stamp; and bad ones.

A body's axes are forward and starboard, bearings are positive to starboard, headings clockwise from north.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Array, Measurement

if TYPE_CHECKING:
    from scipy import sparse

KIND = "sonar"  # of measurements that are frames
EMPTY, SATURATED, WRONG_SIZE, NOT_FINITE = "empty", "saturated", "wrong_size", "not_finite"
MOST_SATURATED = 0.2  # share of cells at the receiver's limit beyond which a frame is refused


@dataclass(frozen=True, kw_only=True)
class SectorGrid:
    """A Cartesian grid of square cells ahead of the vehicle, of which a sector of ranges and bearings is seen.

    Row 0 is the nearest, column 0 the one furthest to port.
    """

    cell: float = 0.5  # [m]
    shape: tuple[int, int] = (40, 80)  # rows forward, columns to starboard
    ranges: tuple[float, float] = (1.0, 20.0)  # that are seen [m]
    half_sector: float = math.radians(60.0)  # bearings seen are at most this [rad]
    ahead: float = 0.0  # of the vehicle's origin, where the sonar is [m]; ranges and bearings are the sonar's

    def __post_init__(self) -> None:
        low, high = self.ranges
        if not (self.cell > 0.0 and min(self.shape) >= 3 and 0.0 <= low < high and 0.0 < self.half_sector <= math.pi):
            raise ParameterError(f"sonar grid {self} must have a cell > 0, 3 x 3 cells or more, and 0 <= ranges rising")

    @cached_property
    def centres(self) -> Array:
        """Places (rows, columns, 2) of the cells: forward, starboard of the vehicle's origin [m]."""
        rows, columns = self.shape
        forward = self.ahead + self.cell * (np.arange(rows) + 0.5)
        starboard = self.cell * (np.arange(columns) + 0.5 - columns / 2)
        return np.stack(np.meshgrid(forward, starboard, indexing="ij"), axis=2).astype(np.float64)

    @cached_property
    def seen(self) -> np.ndarray:
        """Which cells (rows, columns) lie in the sector."""
        return self.holds(self.centres)

    def holds(self, places: Array, margin: float = 0.0) -> np.ndarray:
        """Which places (..., 2) lie in the sector, at least `margin` [m] from its edges."""
        forward, starboard = places[..., 0] - self.ahead, places[..., 1]
        distance = np.hypot(forward, starboard)
        bearing = np.abs(np.arctan2(starboard, forward))
        inside = (distance >= self.ranges[0] + margin) & (distance <= self.ranges[1] - margin)
        aside = distance * np.sin(np.minimum(self.half_sector - bearing, 0.5 * math.pi))
        return inside & (bearing <= self.half_sector) & (aside >= margin)


@dataclass(frozen=True, kw_only=True)
class PolarGrid:
    """A sonar's own grid: one row for each beam, from port to starboard, one column for each range."""

    bearings: tuple[float, ...]  # of the beams, rising [rad]
    ranges: tuple[float, ...]  # of the bins' middles, rising evenly [m]

    def __post_init__(self) -> None:
        steps = np.diff(self.ranges)
        even = len(steps) > 0 and np.allclose(steps, steps[0], rtol=1e-6)
        if not (len(self.bearings) >= 2 and (np.diff(self.bearings) > 0.0).all() and even and steps[0] > 0.0):
            raise ParameterError("a polar sonar grid must have two beams or more and ranges rising in equal steps")

    @property
    def shape(self) -> tuple[int, int]:
        """Beams and ranges."""
        return len(self.bearings), len(self.ranges)


Geometry = SectorGrid | PolarGrid


@dataclass(frozen=True, kw_only=True, slots=True)
class SonarFrame:
    """One frame: echo intensities on a grid, as of one instant (the vehicle's motion within it is left out)."""

    stamp: float  # when it was true [s]
    intensity: Array  # as the geometry's shape; in any unit, but always the same
    geometry: Geometry
    received: float | None = None  # when it arrived [s]; None: at once
    sequence: int | None = None  # counts the frames

    def measurement(self) -> Measurement:
        """The frame as a measurement of kind `sonar`; which grid it is on, its shape says."""
        value = np.asarray(self.intensity, dtype=float)
        received = self.stamp if self.received is None else self.received
        return Measurement(
            kind=KIND,
            value=value.ravel(),
            covariance=np.eye(1),
            stamp=self.stamp,
            received=received,
            sequence=self.sequence,
        )


def fault(intensity: Array, size: int, limit: float = math.inf) -> str:
    """Why a frame cannot be used: `wrong_size`, `not_finite`, `empty` or `saturated`; "" if it can.

    Args:
        intensity: The frame, of any shape.
        size: Cells that there must be.
        limit: Value at which the receiver saturates.
    """
    if intensity.size != size:
        return WRONG_SIZE
    if not np.isfinite(intensity).all():
        return NOT_FINITE
    if not np.ptp(intensity) > 0.0:
        return EMPTY
    return SATURATED if np.mean(intensity >= limit) > MOST_SATURATED else ""


def to_sector(intensity: Array, polar: PolarGrid, sector: SectorGrid) -> Array:
    """A polar frame (beams, ranges) on a sector grid: the mean over each cell, 0 outside what the beams see."""
    return (_resampling(polar, sector) @ np.asarray(intensity, dtype=float).ravel()).reshape(sector.shape)


@lru_cache(maxsize=8)
def _resampling(polar: PolarGrid, sector: SectorGrid) -> "sparse.csr_matrix":
    """Weights (cells, samples): bilinear in bearing and range, averaged over 4 x 4 points of each cell."""
    from scipy import sparse

    bearings, ranges = np.array(polar.bearings), np.array(polar.ranges)
    cells = np.arange(sector.seen.size)[sector.seen.ravel()]
    points = 4
    offsets = sector.cell * ((np.arange(points) + 0.5) / points - 0.5)
    shape = (sector.seen.size, bearings.size * ranges.size)
    total = sparse.csr_matrix(shape)
    for forward in offsets:
        for starboard in offsets:
            places = sector.centres.reshape(-1, 2)[cells] + (forward - sector.ahead, starboard)
            bearing, distance = np.arctan2(places[:, 1], places[:, 0]), np.hypot(places[:, 0], places[:, 1])
            beam, between = _neighbours(bearings, bearing)
            column, along = _neighbours(ranges, distance)
            for b, wb in ((beam, 1.0 - between), (beam + 1, between)):
                for r, wr in ((column, 1.0 - along), (column + 1, along)):
                    total = total + sparse.csr_matrix((wb * wr / points**2, (cells, b * ranges.size + r)), shape=shape)
    return sparse.csr_matrix(total)


def _neighbours(axis: Array, values: Array) -> tuple[np.ndarray, Array]:
    """Index of the sample before each value, and how far it is to the next, in 0..1."""
    index = np.clip(np.searchsorted(axis, values) - 1, 0, axis.size - 2)
    return index, np.clip((values - axis[index]) / (axis[index + 1] - axis[index]), 0.0, 1.0)
