"""The feature map: frames laid over each other along a path, as an image with a place on the earth."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Array
from estimators.map_path.frames import SectorGrid


class FeatureMap(NamedTuple):
    """Mean echo of each cell of the floor."""

    image: Array  # (rows to the north, columns to the east); NaN where nothing was seen
    counts: np.ndarray  # (rows, columns) frames that saw the cell
    origin: tuple[float, float]  # north, east of the middle of cell (0, 0) [m]
    cell: float  # [m]

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """West, east, south, north edges [m], as pictures take them."""
        rows, columns = self.image.shape
        south, west = self.origin[0] - 0.5 * self.cell, self.origin[1] - 0.5 * self.cell
        return west, west + columns * self.cell, south, south + rows * self.cell


class Mosaic:
    """Frames laid over each other on a map as they come; each cell takes the nearest one of a frame that saw it.

    Args:
        poses: Poses (k, 3) of the frames to come, north, east [m] and heading [rad]: as far as they see the map goes.
        grid: Of the frames.
        cell: Of the map [m].

    Raises:
        ParameterError: There is no pose.
    """

    def __init__(self, poses: Array, grid: SectorGrid, cell: float = 0.5) -> None:
        if not len(poses):
            raise ParameterError("no poses: a map needs one frame at least")
        self._grid, self._cell, self._reach = grid, cell, grid.ranges[1] + abs(grid.ahead)
        self._low = np.floor((poses[:, :2].min(axis=0) - self._reach) / cell) * cell
        high = poses[:, :2].max(axis=0) + self._reach
        shape = tuple(np.ceil((high - self._low) / cell).astype(int) + 1)
        self._total, self._counts = np.zeros(shape), np.zeros(shape, dtype=int)

    def add(self, image: Array, pose: Array) -> None:
        """Lays a frame (rows, columns), filtered or not, taken at a pose (3,)."""
        grid, low, cell = self._grid, self._low, self._cell
        rows, columns = _about(pose, low, cell, self._counts.shape, self._reach)
        north = low[0] + cell * rows[:, None] - pose[0]
        east = low[1] + cell * columns[None, :] - pose[1]
        c, s = np.cos(pose[2]), np.sin(pose[2])
        places = np.stack((c * north + s * east, -s * north + c * east), axis=2)
        seen = grid.holds(places)
        near = np.floor((places - grid.centres[0, 0]) / grid.cell + 0.5).astype(int)[seen]
        inside = (near >= 0).all(axis=1) & (near < grid.shape).all(axis=1)
        at = tuple(index[inside] for index in np.nonzero(seen))
        at = (rows[at[0]], columns[at[1]])
        self._total[at] += image[near[inside, 0], near[inside, 1]]
        self._counts[at] += 1

    @property
    def map(self) -> FeatureMap:
        """The mean of the frames so far."""
        mean = np.where(self._counts > 0, self._total / np.maximum(self._counts, 1), np.nan)
        return FeatureMap(mean, self._counts.copy(), (float(self._low[0]), float(self._low[1])), self._cell)


def feature_map(images: Sequence[Array] | Array, poses: Array, grid: SectorGrid, cell: float = 0.5) -> FeatureMap:
    """The mean of frames on a map, see `Mosaic`.

    Args:
        images: Frames (rows, columns), filtered or not.
        poses: Where each was taken (k, 3).
        grid: Of the frames.
        cell: Of the map [m].

    Raises:
        ParameterError: There are not as many poses as images, or none.
    """
    if len(images) != len(poses) or not len(images):
        raise ParameterError(f"{len(images)} frames and {len(poses)} poses: there must be as many, one at least")
    mosaic = Mosaic(poses, grid, cell)
    for image, pose in zip(images, poses, strict=True):
        mosaic.add(image, pose)
    return mosaic.map


def _about(pose: Array, low: Array, cell: float, shape: tuple, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the map within reach of a pose."""
    spans = []
    for k in range(2):
        first = max(0, int((pose[k] - reach - low[k]) / cell))
        last = min(shape[k] - 1, int((pose[k] + reach - low[k]) / cell) + 1)
        spans.append(np.arange(first, last + 1))
    return spans[0], spans[1]
