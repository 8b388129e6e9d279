"""A sea floor of depths on a regular grid."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvsim.base.frames import Array


class Corner(NamedTuple):
    """Where a regular grid begins, and its spacing."""

    north: float  # [m]
    east: float  # [m]
    to_north: float  # between points [m]
    to_east: float  # between points [m]


@dataclass(frozen=True, eq=False, slots=True)
class GriddedFloor:
    """A sea floor of depths on a regular grid, bilinear between its points; held beyond the edge.

    What is touched are two triangles a cell, which leave the bilinear surface by a quarter of the cell's twist at most.
    """

    corner: Corner  # its south-western point
    depths: Array  # (n, m) by north and east [m]
    strength: NDArray[np.float32] | None = None  # (n, m) backscatter by that of sand; none: sand everywhere

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Its ends in north, and in east [m]."""
        (south, west, to_north, to_east), (rows, columns) = self.corner, self.depths.shape
        return (south, south + to_north * (rows - 1)), (west, west + to_east * (columns - 1))

    def depth(self, north: float, east: float) -> float:
        """Depth of the sea floor [m] at a place in NED [m]."""
        i, s = _cell((north - self.corner.north) / self.corner.to_north, self.depths.shape[0])
        j, t = _cell((east - self.corner.east) / self.corner.to_east, self.depths.shape[1])
        (a, b), (c, d) = self.depths[i : i + 2, j : j + 2].tolist()
        return (a * (1.0 - t) + b * t) * (1.0 - s) + (c * (1.0 - t) + d * t) * s

    def coarse(self, most: int) -> "GriddedFloor":
        """The floor on at most so many points along each side, which lie on it."""
        from scipy.ndimage import map_coordinates

        rows, columns = self.depths.shape
        if max(rows, columns) <= most:
            return self
        i, j = (np.linspace(0.0, count - 1.0, min(count, most)) for count in (rows, columns))
        corner = self.corner._replace(
            to_north=self.corner.to_north * (rows - 1) / (len(i) - 1),
            to_east=self.corner.to_east * (columns - 1) / (len(j) - 1),
        )
        depths = map_coordinates(self.depths, np.meshgrid(i, j, indexing="ij"), order=1)
        return GriddedFloor(corner, np.ascontiguousarray(depths))


def _cell(at: float, count: int) -> tuple[int, float]:
    """Number of the cell in which a place [spacings] is, and the share of the cell before it, held at the edges."""
    at = min(max(at, 0.0), count - 1.0)
    cell = min(int(at), count - 2)
    return cell, at - cell
