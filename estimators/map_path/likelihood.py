"""How well two sonar frames agree on a relative pose: log-likelihood ratios, as printed in paper 5 and mended.

Frames show point features of a Gaussian point spread in white noise. Taken as a Gaussian field of spectrum S in noise
of variance s2, a frame and k earlier ones of the same floor have the log-likelihood ratio sum over those and over cells
of Y(c) Y'(warped c), with Y the frame filtered by T, T^2 = S / (s2^2 + (k + 1) S s2): a matched filter, weakened where
features stand out of the noise anyhow.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Array
from estimators.map_path import kernels
from estimators.map_path.frames import SectorGrid
from estimators.map_path.poses import compose

UPSAMPLING = 5  # samples of the earlier frame per cell; odd, so that cells lie on samples
MARGIN = 1.0  # cells of the later frame count that lie so far inside the earlier one's sector [cells]
Weighting = Literal["field", "point", "literal"]


@dataclass(frozen=True, kw_only=True, slots=True)
class FrameModel:
    """Statistics of frames."""

    density: float = 0.1  # of features [1/m^2]
    amplitude: float = 1.0  # of a feature in the middle of its cell, in the frames' unit
    point_spread: float = 0.5  # standard deviation of a feature's image [m]
    noise: float = 1.0  # standard deviation of the noise in a cell, in the frames' unit
    weighting: Weighting = "field"  # the ratio above; "point" and "literal": the paper's, mended and as printed
    gain: float = 2.0  # of the weighting "point"
    together: int = 1  # k, earlier frames that a frame is compared with at once

    def __post_init__(self) -> None:
        if not (
            min(self.density, self.point_spread, self.noise, self.gain) > 0.0 and min(self.amplitude, self.together) > 0
        ):
            raise ParameterError(f"{self}: all numbers must be above 0")

    def scaled(self, snr: float) -> "FrameModel":
        """The likelihood at a signal to noise ratio [dB] of a feature's middle cell."""
        return replace(self, noise=self.amplitude / 10.0 ** (snr / 20.0))


class Prepared(NamedTuple):
    """A frame that is ready to be compared."""

    values: Array  # (rows, columns) filtered
    fine: Array  # (5 rows, 5 columns) the same, upsampled
    scatter: float = np.nan  # of its match with those before, see `matching.Match`; NaN of one that was not matched


class Matcher:
    """Compares frames of one grid and one model."""

    def __init__(self, grid: SectorGrid, model: FrameModel) -> None:
        self.grid, self.model = grid, model
        rows, columns = grid.shape
        self._places = grid.centres[grid.seen]
        self._upsample_rows, self._upsample_columns = _upsampling(rows), _upsampling(columns)
        # Of sample (0, 0) of the upsampled frame, and samples a metre.
        self._corner = grid.centres[0, 0] - 0.5 * grid.cell * (1.0 - 1.0 / UPSAMPLING)
        self._density = UPSAMPLING / grid.cell

    def prepare(self, intensity: Array) -> Prepared:
        """A frame (rows, columns), or flattened, without its mean, filtered, and upsampled by cubic splines."""
        image, seen = np.asarray(intensity, dtype=float).reshape(self.grid.shape), self.grid.seen
        image = np.where(seen, image - image[seen].mean(), 0.0)
        if self.model.weighting == "literal":
            return Prepared(image, self._upsample_rows @ image @ self._upsample_columns.T)
        shape = tuple(2 * size for size in image.shape)
        spectrum = np.fft.rfft2(image, shape) * self._transfer
        values = np.ascontiguousarray(np.fft.irfft2(spectrum, shape)[: image.shape[0], : image.shape[1]])
        return Prepared(values, self._upsample_rows @ values @ self._upsample_columns.T)

    def shared_cells(self, relative: Array) -> np.ndarray:
        """Which cells of the sector a frame shares with an earlier one, at a relative pose (3,) that is near enough.

        The set is to be the same for all poses that are compared: a sum over the overlap rewards small motions.
        """
        places = np.column_stack((self._places, np.zeros(len(self._places))))
        return self.grid.holds(compose(relative, places)[:, :2], MARGIN * self.grid.cell)

    def log_likelihood(self, later: Prepared, earlier: Prepared, poses: Array, cells: np.ndarray) -> Array:
        """Log-likelihood (k,) of relative poses (k, 3), but for a constant, over a fixed set of cells."""
        values = later.values[self.grid.seen][cells]
        places = np.ascontiguousarray(self._places[cells])
        arguments = (values, places, earlier.fine, self._density, *self._corner, np.ascontiguousarray(poses))
        if self.model.weighting == "literal":
            return -kernels.square_differences(*arguments) / (4.0 * self.model.noise**2)
        return kernels.products(*arguments)

    def seen(self, earlier: Prepared, poses: Array, cells: np.ndarray) -> Array:
        """An earlier frame (k, rows, columns) where some cells see it from relative poses (k, 3); 0 elsewhere."""
        images = np.zeros((len(poses), *self.grid.shape))
        places = np.ascontiguousarray(self._places[cells])
        arguments = (places, earlier.fine, self._density, *self._corner, np.ascontiguousarray(poses))
        images[:, self._index[0][cells], self._index[1][cells]] = kernels.samples(*arguments)
        return images

    @cached_property
    def _index(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the cells of the sector."""
        row, column = np.nonzero(self.grid.seen)
        return row, column

    @cached_property
    def noise_filtered(self) -> float:
        """Standard deviation of the noise in a prepared frame."""
        shape = tuple(2 * size for size in self.grid.shape)
        response = np.fft.irfft2(self._transfer, shape)
        return self.model.noise * float(np.sqrt(np.sum(response**2)))

    @cached_property
    def _transfer(self) -> Array:
        """Transfer function of the filter on the frame padded to twice its size."""
        model, cell = self.model, self.grid.cell
        rows, columns = (2 * size for size in self.grid.shape)
        frequencies = np.fft.fftfreq(rows, cell)[:, None], np.fft.rfftfreq(columns, cell)[None, :]
        square = sum((2.0 * np.pi * f) ** 2 for f in frequencies)
        # Of a Gaussian sampled in cells, so fine that nothing folds back.
        spread = 2.0 * np.pi * (model.point_spread / cell) ** 2 * np.exp(-0.5 * square * model.point_spread**2)
        noise, density = model.noise**2, model.density * cell**2 * model.amplitude**2
        if model.weighting == "point":
            return spread * np.sqrt(model.gain * density / (noise**2 + 2.0 * noise * density * spread.max() ** 2))
        return spread * np.sqrt(density / (noise**2 + (model.together + 1.0) * noise * density * spread**2))


def _upsampling(size: int) -> Array:
    """Matrix (5 size, size) of cubic spline interpolation with mirrored ends."""
    from scipy.ndimage import spline_filter1d

    coefficients = spline_filter1d(np.eye(size), order=3, axis=0, mode="mirror")
    places = (np.arange(size * UPSAMPLING) + 0.5) / UPSAMPLING - 0.5
    matrix = np.zeros((places.size, size))
    first = np.floor(places).astype(int) - 1
    for tap in range(4):
        index, t = first + tap, np.abs(places - first - tap)
        weight = np.where(t < 1.0, 2.0 / 3.0 - t**2 + 0.5 * t**3, np.maximum(2.0 - t, 0.0) ** 3 / 6.0)
        reflected = np.abs(index)
        reflected = np.where(reflected > size - 1, 2 * (size - 1) - reflected, reflected)
        np.add.at(matrix, (np.arange(places.size), reflected), weight)
    return matrix @ coefficients
