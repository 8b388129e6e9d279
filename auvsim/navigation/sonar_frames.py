"""From an imaging sonar's intensities to frames that the estimators of `map_path` compare: on the level, standardised.

A sonar measures slant ranges, and echoes that fall with range and have speckle. The estimators take a frame for a map
of a level floor in white noise of one size. So each beam is laid on the floor by the altitude, and intensities are
averaged over cells, which takes out most of the speckle. Of their logarithm the mean of the surroundings is removed,
since broad light and shade partly go with the vehicle and would pull matches to no motion; then it is given mean 0 and
a variance of 1 that does not fall with range. Nothing is made even range by range: a bright rock would darken the arc
of its range, and arcs come nearer by less than the vehicle moves.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from auvsim.base.frames import Array
from estimators.map_path.frames import PolarGrid, SectorGrid, SonarFrame, to_sector

LEAST_HEARD = 100  # cells within the sonar's ranges, fewer and a frame shows nothing
BLANK = 1e-9  # spread of a frame below which it shows nothing
LEAST = 1e-9  # intensity by the mean of its frame below which the logarithm is cut
FAINT = 1e-4  # square of a value by their mean below which its logarithm says nothing of the spread


@dataclass(frozen=True, kw_only=True)
class SectorFrames:
    """Makes standardised frames on a sector grid of polar intensities (beams, ranges)."""

    polar: PolarGrid  # of the sonar, its ranges slant
    grid: SectorGrid
    surroundings: float = 1.0  # standard deviation of the Gaussian over which the mean of a cell's is taken [m]
    nearer: float = 0.0  # by which echoes come from before what they are of, along the level [m]

    def frame(self, intensity: np.ndarray, *, altitude: float, stamp: float, sequence: int | None = None) -> SonarFrame:
        """The standardised frame of a ping.

        Args:
            intensity: (beams, ranges), of any unit.
            altitude: of the sonar above the floor [m].
            stamp: when the ping was sent [s].
            sequence: counts the frames.
        """
        level = self._on_the_floor(np.asarray(intensity, dtype=float), altitude)
        cells = to_sector(level, self._floor, self.grid)[self.grid.seen]
        image = np.zeros(self.grid.shape)
        image[self.grid.seen] = np.log(np.maximum(cells, max(LEAST * cells.mean(), 1e-300)))
        image[self.grid.seen] = self._standardised(self._detailed(image)[self.grid.seen], altitude)
        return SonarFrame(stamp=stamp, intensity=image, geometry=self.grid, sequence=sequence)

    def _on_the_floor(self, intensity: Array, altitude: float) -> Array:
        """Intensities (beams, ranges) at even horizontal ranges, interpolated; the last ones held."""
        slant, horizontal = np.array(self.polar.ranges), np.array(self._floor.ranges)
        at = (np.hypot(np.maximum(horizontal - self.nearer, 0.0), altitude) - slant[0]) / (slant[1] - slant[0])
        at = np.clip(at, 0.0, len(slant) - 1.0)
        before = np.minimum(at.astype(int), len(slant) - 2)
        share = at - before
        return intensity[:, before] * (1.0 - share) + intensity[:, before + 1] * share

    def _detailed(self, image: Array) -> Array:
        """An image (rows, columns) without the mean of each cell's surroundings, of the cells that are seen."""
        from scipy.ndimage import gaussian_filter

        width = self.surroundings / self.grid.cell
        shares = np.maximum(gaussian_filter(self.grid.seen.astype(float), width), 1e-12)
        return image - gaussian_filter(image, width) / shares

    def _standardised(self, values: Array, altitude: float) -> Array:
        """Values of the cells that are seen, of mean 0 and of variance 1 at all ranges; 0 beyond the sonar's ranges.

        The logarithm of the variance is taken for a parabola over range.
        """
        slant = np.hypot(self._distances, altitude)
        heard = (slant >= self.polar.ranges[0]) & (slant <= self.polar.ranges[-1])
        result, own = np.zeros(values.shape), values[heard]
        if not np.isfinite(own).all():
            result[heard] = np.nan
            return result
        if own.size < LEAST_HEARD or own.std() < BLANK:
            return result
        own = own - own.mean()
        basis = np.vander(self._distances[heard] / self.grid.ranges[1], 3)
        logarithms = np.log(own**2 + FAINT * np.mean(own**2))
        own = own * np.exp(-0.5 * (basis @ np.linalg.solve(basis.T @ basis, basis.T @ logarithms)))
        result[heard] = (own - own.mean()) / own.std()
        return result

    @cached_property
    def _floor(self) -> PolarGrid:
        """The beams with even horizontal ranges, as fine as the sonar's slant ones."""
        step = self.polar.ranges[1] - self.polar.ranges[0]
        low, high = self.grid.ranges
        count = math.ceil((high + self.grid.cell - 0.5 * low) / step)
        return PolarGrid(bearings=self.polar.bearings, ranges=tuple((0.5 * low + step * np.arange(count)).tolist()))

    @cached_property
    def _distances(self) -> Array:
        return np.hypot(*(self.grid.centres[self.grid.seen] - (self.grid.ahead, 0.0)).T)
