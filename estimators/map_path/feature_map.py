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


def feature_map(images: Sequence[Array], poses: Array, grid: SectorGrid, cell: float = 0.5) -> FeatureMap:
    """The mean of frames on a map; each of the map's cells takes the nearest cell of each frame that saw it.

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
    reach = grid.ranges[1] + abs(grid.ahead)
    low = np.floor((poses[:, :2].min(axis=0) - reach) / cell) * cell
    high = poses[:, :2].max(axis=0) + reach
    shape = tuple(np.ceil((high - low) / cell).astype(int) + 1)
    total, counts = np.zeros(shape), np.zeros(shape, dtype=int)
    for image, pose in zip(images, poses, strict=True):
        rows, columns = _about(pose, low, cell, shape, reach)
        north = low[0] + cell * rows[:, None] - pose[0]
        east = low[1] + cell * columns[None, :] - pose[1]
        c, s = np.cos(pose[2]), np.sin(pose[2])
        places = np.stack((c * north + s * east, -s * north + c * east), axis=2)
        seen = grid.holds(places)
        near = np.floor((places - grid.centres[0, 0]) / grid.cell + 0.5).astype(int)[seen]
        inside = (near >= 0).all(axis=1) & (near < grid.shape).all(axis=1)
        at = tuple(index[inside] for index in np.nonzero(seen))
        at = (rows[at[0]], columns[at[1]])
        total[at] += image[near[inside, 0], near[inside, 1]]
        counts[at] += 1
    with np.errstate(invalid="ignore"):
        mean = np.where(counts > 0, total / np.maximum(counts, 1), np.nan)
    return FeatureMap(mean, counts, (float(low[0]), float(low[1])), cell)


def _about(pose: Array, low: Array, cell: float, shape: tuple, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the map within reach of a pose."""
    spans = []
    for k in range(2):
        first = max(0, int((pose[k] - reach - low[k]) / cell))
        last = min(shape[k] - 1, int((pose[k] + reach - low[k]) / cell) + 1)
        spans.append(np.arange(first, last + 1))
    return spans[0], spans[1]
