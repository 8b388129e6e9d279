"""From the elements of a line array to a polar frame: shaded delay-and-sum at one frequency, and the envelope."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Array
from estimators.map_path.frames import PolarGrid


@dataclass(frozen=True, kw_only=True)
class LineArray:
    """A horizontal line array across the bow, of elements half a wavelength apart, with Hann shading."""

    elements: int = 32
    beams: int = 64  # uniform in the sine of the bearing
    half_sector: float = np.radians(60.0)  # bearing of the outermost beams [rad]
    ranges: tuple[float, ...] = tuple(0.25 + 0.5 * k for k in range(40))  # middles of the range bins [m]

    def __post_init__(self) -> None:
        if not (self.elements >= 3 and self.beams >= 2 and 0.0 < self.half_sector < 0.5 * np.pi):
            raise ParameterError(f"{self}: three elements or more, two beams or more, a half sector below 90 degrees")

    @cached_property
    def grid(self) -> PolarGrid:
        """Bearings of the beams, and ranges."""
        sines = np.linspace(-1.0, 1.0, self.beams) * np.sin(self.half_sector)
        return PolarGrid(bearings=tuple(np.arcsin(sines).tolist()), ranges=self.ranges)

    @cached_property
    def shading(self) -> Array:
        """Weights (elements,) of sum 1."""
        weights = np.hanning(self.elements + 2)[1:-1]
        return weights / weights.sum()

    def steering(self, bearings: Array) -> np.ndarray:
        """Phases (elements, k) with which the elements hear a distant source at each bearing (k,) [rad]."""
        places = np.arange(self.elements) - 0.5 * (self.elements - 1)
        return np.exp(1j * np.pi * places[:, None] * np.sin(bearings)[None, :])

    def beamform(self, signals: np.ndarray) -> Array:
        """Envelope (beams, ranges) of the elements' complex signals (elements, ranges)."""
        weights = self.shading[:, None] * self.steering(np.array(self.grid.bearings))
        return np.abs(weights.conj().T @ signals)
