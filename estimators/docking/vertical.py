"""Depth from the dock: what the vehicle's gauge shows too much against the dock's, from fixes and the dock's light.

The gauge is precise and off by a constant; a fix is exact on average but for the dock's tilt, which the dock measures
wrongly by constants too. Near the dock the tilt no longer counts, and the gauge takes over what the fixes say there.
So it does with the elevation of the light in the mouth, whose constant error counts by the distance.
"""

import math
from collections import deque
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from estimators.core import outliers
from estimators.core.outliers import Outliers
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel
from estimators.docking.usbl import UsblFix, UsblModel

KIND = "usbl_depth"
GAUGE_NOISE = 0.03  # of the smoothed gauge and of the dock's report [m]
WRONG = Outliers(prior=0.05, deviations=(2.0, 15.0))  # fixes that are wrong
DAZZLED = Outliers(prior=0.05, deviations=(0.5, 4.0))  # sights of something else than the light
STEEP = 1.0  # elevation beyond which a camera in the nose sees no light of a dock [rad]


class _Offset(MeasurementModel):
    """Gauge less fix or light: the offset, the dock's tilt (forward, starboard) and errors of cameras by distances."""

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
        lights: Standard deviation of the constant error of each camera's elevation [rad], by name.
    """

    def __init__(
        self,
        usbl: UsblModel,
        transponder: float = 0.0,
        *,
        offset: float = 0.5,
        tilt: float = 0.0087,
        keep: float = 30.0,
        lights: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._usbl, self._transponder, self._keep = usbl, transponder, keep
        self._prior = np.diag(np.square((offset, tilt, tilt, *lights.values())))
        self._lights = {name: 3 + k for k, name in enumerate(lights)}  # their states
        self._model = _Offset()
        self.reset()

    def reset(self) -> None:
        """Forgets everything."""
        self.belief = Gaussian(mean=np.zeros(len(self._prior)), covariance=self._prior.copy())
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
        self._take(fix.stamp, shown - total / count - below, deviation, (1.0, x, -y), WRONG)

    def light(self, time: float, name: str, elevation: float, deviation: float, distance: float, camera: float) -> None:
        """Takes the elevation of the light in the mouth, levelled; ignores it before the dock has reported its depth.

        Args:
            time: When it was seen [s].
            name: Of the camera.
            elevation: Of the light above the horizontal [rad].
            deviation: Of its white noise, that of the levelling included [rad].
            distance: Horizontal, from the camera to the mouth [m].
            camera: Its place below the vehicle's origin [m].
        """
        shown, (count, total) = self._gauge_at(time), self._reports
        if shown is None or not count or not (math.isfinite(elevation) and abs(elevation) < STEEP):
            return
        below = distance * math.tan(elevation) - camera
        slopes = np.zeros(len(self._prior))
        slopes[0], slopes[self._lights[name]] = 1.0, -distance
        self._take(time, shown - total / count - below, distance * deviation, tuple(slopes.tolist()), DAZZLED)

    def _take(self, time: float, value: float, deviation: float, slopes: tuple[float, ...], wrong: Outliers) -> None:
        """Takes what the gauge shows more than fix or light say [m], with its slopes by the states."""
        measurement = Measurement(
            kind=KIND, value=np.array((value,)), stamp=time, received=time, parameters=self._padded(slopes),
            covariance=np.array(((deviation**2 + GAUGE_NOISE**2,),)),
        )  # fmt: skip
        self.belief = outliers.correct(self.belief, measurement, self._model, wrong).belief

    def _padded(self, slopes: tuple[float, ...]) -> tuple[float, ...]:
        return (*slopes, *(0.0 for _ in range(len(self._prior) - len(slopes))))

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
