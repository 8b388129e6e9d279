"""From an imaging sonar's intensities to frames that the estimators of `map_path` compare: on the level, standardised.

A sonar measures slant ranges, and echoes that fall with range and have speckle. The estimators take a frame for a map
of a level floor in white noise of one size. So each beam is laid on the floor by the altitude, each range is divided by
its mean over the beams, and intensities are averaged over cells, which takes out most of the speckle. Of their
logarithm the mean of the surroundings is removed, since broad light and shade partly go with the vehicle and would pull
matches to no motion; then each ring of ranges is given mean 0 and variance 1.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from auvsim.base.frames import Array
from estimators.map_path.frames import PolarGrid, SectorGrid, SonarFrame, to_sector

SURROUNDINGS = 1.0  # standard deviation of the Gaussian over which their mean is taken [m]
RING = 1.0  # width of the rings that are standardised [m]
BLANK = 1e-9  # spread of a ring below which it shows nothing
LEAST = 1e-3  # intensity by the mean of its range below which the logarithm is cut


@dataclass(frozen=True, kw_only=True)
class SectorFrames:
    """Makes standardised frames on a sector grid of polar intensities (beams, ranges)."""

    polar: PolarGrid  # of the sonar, its ranges slant
    grid: SectorGrid

    def frame(self, intensity: np.ndarray, *, altitude: float, stamp: float, sequence: int | None = None) -> SonarFrame:
        """The standardised frame of a ping.

        Args:
            intensity: (beams, ranges), of any unit.
            altitude: of the sonar above the floor [m].
            stamp: when the ping was sent [s].
            sequence: counts the frames.
        """
        level = self._on_the_floor(np.asarray(intensity, dtype=float), altitude)
        level /= np.maximum(level.mean(axis=0), 1e-300)
        cells = to_sector(level, self._floor, self.grid)[self.grid.seen]
        image = np.zeros(self.grid.shape)
        image[self.grid.seen] = np.log(np.maximum(cells, LEAST))
        image[self.grid.seen] = self._standardised(self._detailed(image)[self.grid.seen], altitude)
        return SonarFrame(stamp=stamp, intensity=image, geometry=self.grid, sequence=sequence)

    def _on_the_floor(self, intensity: Array, altitude: float) -> Array:
        """Intensities (beams, ranges) at even horizontal ranges, interpolated; the last ones held."""
        slant, horizontal = np.array(self.polar.ranges), np.array(self._floor.ranges)
        at = (np.hypot(horizontal, altitude) - slant[0]) / (slant[1] - slant[0])
        at = np.clip(at, 0.0, len(slant) - 1.0)
        before = np.minimum(at.astype(int), len(slant) - 2)
        share = at - before
        return intensity[:, before] * (1.0 - share) + intensity[:, before + 1] * share

    def _detailed(self, image: Array) -> Array:
        """An image (rows, columns) without the mean of each cell's surroundings, of the cells that are seen."""
        from scipy.ndimage import gaussian_filter

        width = SURROUNDINGS / self.grid.cell
        shares = np.maximum(gaussian_filter(self.grid.seen.astype(float), width), 1e-12)
        return image - gaussian_filter(image, width) / shares

    def _standardised(self, values: Array, altitude: float) -> Array:
        """Values of the cells that are seen, each ring's of mean 0 and variance 1; 0 beyond the sonar's ranges."""
        ring, slant = self._rings, np.hypot(self._distances, altitude)
        counts = np.maximum(np.bincount(ring), 1)
        values = values - (np.bincount(ring, values) / counts)[ring]
        spread = np.sqrt(np.bincount(ring, values**2) / counts)[ring]
        heard = (slant >= self.polar.ranges[0]) & (slant <= self.polar.ranges[-1])
        blank = spread < BLANK  # not where it is not finite: that is to be seen
        return np.where(heard & ~blank, values / np.where(blank, 1.0, spread), 0.0)

    @cached_property
    def _floor(self) -> PolarGrid:
        """The beams with even horizontal ranges, as fine as the sonar's slant ones."""
        step = self.polar.ranges[1] - self.polar.ranges[0]
        low, high = self.grid.ranges
        count = math.ceil((high + self.grid.cell - 0.5 * low) / step)
        return PolarGrid(bearings=self.polar.bearings, ranges=tuple((0.5 * low + step * np.arange(count)).tolist()))

    @cached_property
    def _distances(self) -> Array:
        return np.hypot(*self.grid.centres[self.grid.seen].T)

    @cached_property
    def _rings(self) -> np.ndarray:
        return (self._distances / RING).astype(int)
