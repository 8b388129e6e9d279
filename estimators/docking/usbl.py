"""Acoustic fixes of a dock: the contents of a packet, and its position in the world (Qiu and Li 2019, eq. 7)."""

import math
from dataclasses import dataclass

import numpy as np

from estimators.core.errors import ParameterError
from estimators.core.types import Array, Measurement
from estimators.docking.sensors import USBL


@dataclass(frozen=True, kw_only=True, slots=True)
class UsblFix:
    """One packet of the dock."""

    stamp: float  # when the transponder was measured [s]
    received: float  # when the packet arrived [s]
    position: (
        tuple[float, float, float] | Array
    )  # transponder from transceiver in the dock's frame, forward, starboard, down [m]
    heading: float  # dock's attitude, ZYX [rad]
    pitch: float = 0.0  # [rad]
    roll: float = 0.0  # [rad]
    sequence: int | None = None  # packet number


@dataclass(frozen=True, kw_only=True, slots=True)
class UsblModel:
    """Model of the dock's USBL that the vehicle assumes.

    The deviations are those of the paper's Table 1 (square roots of its variances), interpolated on logarithmic axes
    and constant outside; they follow no power law.
    """

    transceiver: tuple[float, float, float] = (0.0, 0.0, 0.0)  # its place in the dock's frame [m]
    ranges: tuple[float, ...] = (12.0, 40.0, 100.0, 200.0)  # [m]
    deviations: tuple[float, ...] = (0.0067, 0.0678, 0.3390, 0.4807)  # of each axis at these ranges [m]
    max_range: float = 10_000.0  # no acoustic link reaches farther [m]; fixes beyond are refused
    dock_heading: float = 0.0  # standard deviation of the dock's compass, which acts across the line of sight [rad]

    def __post_init__(self) -> None:
        increasing = all(a < b for a, b in zip(self.ranges, self.ranges[1:], strict=False))
        if not (
            increasing and len(self.ranges) == len(self.deviations) and min((*self.ranges, *self.deviations)) > 0.0
        ):
            raise ParameterError(f"USBL ranges {self.ranges} must rise, with one deviation > 0 each: {self.deviations}")

    def reaches(self, fix: UsblFix) -> bool:
        """Whether a fix is within range; so is one that holds no numbers, which is refused for that."""
        farthest = max(abs(float(x)) for x in fix.position)
        return not math.isfinite(farthest) or farthest <= self.max_range

    def deviation(self, distance: float) -> float:
        """Standard deviation of each axis [m] at a distance [m]."""
        if not distance > self.ranges[0]:
            return self.deviations[0]
        return math.exp(float(np.interp(math.log(distance), np.log(self.ranges), np.log(self.deviations))))

    def world_fix(self, fix: UsblFix) -> Measurement:
        """Transponder (north, east) from the dock's origin by eq. 7, with covariance M Sigma M'."""
        numbers = (*map(float, fix.position), fix.heading, fix.pitch, fix.roll)
        if not all(map(math.isfinite, numbers)):
            numbers = (math.nan,) * 6  # for the history to refuse: the cosine of infinity would raise here
        x, y, z, *attitude = numbers
        M = horizontal_rotation(*attitude)
        value = M @ (np.array((x, y, z)) + self.transceiver)
        variance = self.deviation(math.sqrt(x * x + y * y + z * z)) ** 2
        covariance = variance * (M @ M.T)
        if self.dock_heading > 0.0:
            across = np.array((-value[1], value[0])) * self.dock_heading
            covariance += np.outer(across, across)
        return Measurement(
            kind=USBL, value=value, covariance=covariance, stamp=fix.stamp, received=fix.received, sequence=fix.sequence
        )


def raw_fix(fix: UsblFix) -> Measurement:
    """A packet as the dock measured it, in the dock's frame and without covariance: for a refusal."""
    value, covariance = np.array(fix.position, dtype=float), np.full((3, 3), math.nan)
    return Measurement(
        kind=USBL, value=value, covariance=covariance, stamp=fix.stamp, received=fix.received, sequence=fix.sequence
    )


def horizontal_rotation(heading: float, pitch: float, roll: float) -> Array:
    """First two rows (2, 3) of the ZYX rotation from the dock's frame to north, east, down; the paper's eq. 7."""
    cy, sy, cp, sp, cr, sr = (f(a) for a in (heading, pitch, roll) for f in (math.cos, math.sin))
    return np.array(
        (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        )
    )
