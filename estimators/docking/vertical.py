"""Depth from the dock: what the vehicle's gauge shows too much against the dock's, from the downward part of fixes.

The gauge is precise and off by a constant; a fix is exact on average but for the dock's tilt, which the dock measures
wrongly by constants too. Near the dock the tilt no longer counts, and the gauge takes over what the fixes say there.
"""

import math
from collections import deque

import numpy as np

from estimators.core import outliers
from estimators.core.outliers import Outliers
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel
from estimators.docking.usbl import UsblFix, UsblModel

KIND = "usbl_depth"
GAUGE_NOISE = 0.03  # of the smoothed gauge and of the dock's report [m]
WRONG = Outliers(prior=0.05, deviations=(2.0, 15.0))  # fixes that are wrong


class _Offset(MeasurementModel):
    """Gauge less fix: the offset, and the dock's tilt (forward, starboard) by the distances to either side."""

    is_linear = True

    def evaluate(self, x: Array, measurement: Measurement) -> Array:
        return self.jacobian(x, measurement) @ x

    def jacobian(self, x: Array, measurement: Measurement) -> Array:
        return np.array((measurement.parameters,))


class VerticalFilter:
    """Offset of the depth gauge against the depth that the dock reports, from the downward part of its fixes.

    Args:
        usbl: Model of the dock's USBL.
        transponder: Its height above the vehicle's origin, negative above [m].
        offset: Standard deviation of the offset before any fix [m].
        tilt: Of the error of the dock's measured pitch and roll [rad].
        keep: Age up to which fixes are used [s].
    """

    def __init__(
        self,
        usbl: UsblModel,
        transponder: float = 0.0,
        *,
        offset: float = 0.5,
        tilt: float = 0.0087,
        keep: float = 30.0,
    ) -> None:
        self._usbl, self._transponder, self._keep = usbl, transponder, keep
        self._prior = np.diag(np.square((offset, tilt, tilt)))
        self._model = _Offset()
        self.reset()

    def reset(self) -> None:
        """Forgets everything."""
        self.belief = Gaussian(mean=np.zeros(3), covariance=self._prior.copy())
        self._gauge: deque[tuple[float, float]] = deque()  # times [s] and smoothed depths [m]
        self._reports = (0, 0.0)  # number and sum of the depths that the dock reported

    @property
    def offset(self) -> float:
        """By how much the gauge shows more than depth below the dock's reported one says [m]."""
        return float(self.belief.mean[0])

    @property
    def variance(self) -> float:
        """Of the offset [m2]."""
        return float(self.belief.covariance[0, 0])

    def gauge(self, time: float, depth: float) -> None:
        """Takes the smoothed depth [m] of the gauge now."""
        self._gauge.append((time, depth))
        while self._gauge[0][0] < time - self._keep:
            self._gauge.popleft()

    def fix(self, fix: UsblFix, dock_depth: float) -> None:
        """Takes a packet, with the depth of the mouth [m] that it reports; ignores one that does not fit in time."""
        shown = self._gauge_at(fix.stamp)
        x, y, z = map(float, fix.position)
        numbers = (x, y, z, fix.heading, fix.pitch, fix.roll, dock_depth)
        if shown is None or not all(map(math.isfinite, numbers)) or not self._usbl.reaches(fix):
            return
        count, total = self._reports[0] + 1, self._reports[1] + dock_depth
        self._reports = count, total
        sp, cp, sr, cr = math.sin(fix.pitch), math.cos(fix.pitch), math.sin(fix.roll), math.cos(fix.roll)
        tx, ty, tz = self._usbl.transceiver
        below = -sp * (x + tx) + cp * sr * (y + ty) + cp * cr * (z + tz) - self._transponder
        deviation = self._usbl.deviation(math.sqrt(x * x + y * y + z * z))
        measurement = Measurement(
            kind=KIND, value=np.array((shown - total / count - below,)), stamp=fix.stamp, received=fix.received,
            covariance=np.array(((deviation**2 + GAUGE_NOISE**2,),)), parameters=(1.0, x, -y),
        )  # fmt: skip
        self.belief = outliers.correct(self.belief, measurement, self._model, WRONG).belief

    def _gauge_at(self, time: float) -> float | None:
        """The gauge's depth at a time [s], linear between those kept; None outside of them."""
        after = None
        for known in reversed(self._gauge):
            if known[0] <= time:
                if after is None:
                    return known[1] if time - known[0] < 1.0 else None
                share = (time - known[0]) / (after[0] - known[0])
                return known[1] + share * (after[1] - known[1])
            after = known
        return None
