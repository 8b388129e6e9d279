"""Where matching will hold, before the mission: the Cramér-Rao bound of a match, cell by cell of a floor.

Two frames of the same floor, each with white noise of variance s2 in a cell, tell their offset with the information
J = sum over the cells both see of grad z grad z' / (2 s2). A frame of unknown heading shows, of a height field, its
slope along the line of sight (Lambert's echo to first order); over all directions the mean of grad z grad z' is
g^2 Hess^2 / 2.
"""

import numpy as np
from scipy.ndimage import gaussian_filter, uniform_filter

from estimators.core.errors import ParameterError
from estimators.core.types import Array
from estimators.map_path.frames import SectorGrid


def image_information(image: Array, cell: float, spread: float) -> Array:
    """Products grad z grad z' (rows, columns, 2, 2) [unit^2/m^2] of the image of a floor, smoothed by a point spread.

    Args:
        image: What frames show of the floor (rows to the north, columns to the east), whatever the heading.
        cell: Of it [m].
        spread: Standard deviation of the sonar's point spread [m]; 0 if it is in the image.
    """
    smooth = gaussian_filter(np.asarray(image, dtype=float), spread / cell) if spread > 0.0 else image
    north, east = np.gradient(smooth, cell)
    gradient = np.stack((north, east), axis=-1)
    return gradient[..., :, None] * gradient[..., None, :]


def height_information(height: Array, cell: float, spread: float, gain: float) -> Array:
    """Information on the shift in frames of a height field [m]; `gain`: the echo's change [unit] for a slope of 1."""
    smooth = gaussian_filter(np.asarray(height, dtype=float), spread / cell) if spread > 0.0 else height
    north, east = np.gradient(smooth, cell)
    rows = [np.stack(tuple(np.gradient(slope, cell)), axis=-1) for slope in (north, east)]
    hessian = np.stack(rows, axis=-2)
    hessian = 0.5 * (hessian + np.swapaxes(hessian, -1, -2))
    return 0.5 * gain**2 * hessian @ hessian


def match_bound(information: Array, cell: float, grid: SectorGrid, noise: float, overlap: float = 0.85) -> Array:
    """Standard deviation [m] of a match, along its worst axis, about each cell; infinite where the floor shows nothing.

    The sector stands as a square of its area about the cell; the heading is taken as known, so that it is a bound.

    Args:
        information: As of `image_information` or `height_information`.
        cell: Of the floor [m].
        grid: Of the frames.
        noise: Standard deviation in a cell of a frame, in the frames' unit.
        overlap: Share of its cells that a frame has in common with the one before.

    Raises:
        ParameterError: There are holes in the floor, or a number is not above 0.
    """
    if not np.isfinite(information).all():
        holes = int(np.count_nonzero(~np.isfinite(information).all(axis=(2, 3))))
        raise ParameterError(f"the floor has {holes} cells that are holes or beside one; fill them first")
    if not (cell > 0.0 and noise > 0.0 and 0.0 < overlap <= 1.0):
        raise ParameterError(f"cell {cell} m and noise {noise} must be above 0, the overlap {overlap} in 0..1")
    count = np.count_nonzero(grid.seen)
    side = max(1, round(np.sqrt(count) * grid.cell / cell))
    mean = np.stack(
        [uniform_filter(information[..., i, j], side, mode="nearest") for i, j in ((0, 0), (0, 1), (1, 1))], axis=-1
    )
    J = overlap * count * mean / (2.0 * noise**2)
    middle, half = 0.5 * (J[..., 0] + J[..., 2]), 0.5 * (J[..., 0] - J[..., 2])
    least = middle - np.hypot(half, J[..., 1])
    with np.errstate(divide="ignore"):
        return np.where(least > 1e-12 * np.maximum(middle, 1e-300), 1.0 / np.sqrt(np.maximum(least, 1e-300)), np.inf)
