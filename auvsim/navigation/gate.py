"""One gate for all that a vehicle's sensors say, before its estimator, controller or mission hears of it."""

import math
from collections.abc import Mapping, Sequence
from itertools import compress
from typing import Any

import numpy as np

from auvsim.base.reading import Reading
from auvsim.sensors.altimeter import AltimeterSettings
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.depth import DepthSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.feedback import FeedbackSettings
from auvsim.sensors.fix import FixSettings
from auvsim.sensors.gps import GpsSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.sensors.imaging_sonar import ImagingSonarSettings, resolved
from auvsim.sensors.imu import ImuSettings
from auvsim.sensors.light import LightSettings
from auvsim.sensors.range import RangeSettings
from auvsim.vehicles.actuation import Actuation
from estimators.core.screening import Limits, Screen, judge
from estimators.core.types import Outcome
from estimators.map_path.frames import WRONG_SIZE, fault

SURE = 11.0  # deviations of white noise by which two readings never differ: 8 of their difference
EQUAL = 20  # readings in a row that a sensor with noise never repeats
CLOCK = 1e-6  # by which a stamp may lie ahead of its arrival [s]
DEPTHS = (-10.0, 11_000.0)  # from the crest of a wave to the deepest trench [m]
CLIMB, TURN, SPIN = 15.0, 1.5, 20.0  # fastest changes: of depth [m/s], of heading [rad/s], of a rate of turn [rad/s2]
FASTEST, SPEED, JOLT = (
    10.0,
    20.0,
    10.0,
)  # of a range [m/s]; largest speed [m/s], its fastest change, bumps included [m/s2]
FARTHEST = 1e6  # position from the datum [m]
RATE = 10.0  # largest rate of turn [rad/s]
SHOCK = 200.0  # largest specific force, bumps included [m/s2]


class Gate:
    """Judges readings by what their sensors can show, see `estimators.core.screening`.

    Only what cannot be is refused: no number, a value beyond any vehicle, a jump, a value that stays the same to the
    last bit, a stamp from the future or before the last one. A DVL's track that is lost is none of these. Frames of a
    sonar are refused if they are empty, not finite, saturated or not of its size; they may come in any order.

    Args:
        sensors: Settings of those on board by name; others pass.
        actuation: Of the vehicle, whose channels the feedback shows.
        frozen: Whether to look for values that stay the same: not in logs that round them.
    """

    def __init__(self, sensors: Mapping[str, Any], actuation: Actuation, *, frozen: bool = True) -> None:
        self._screens = {
            name: [Screen(one) for one in limits]
            for name, settings in sensors.items()
            if (limits := _limits(settings, actuation, frozen))
        }
        self._dvls = {name for name, settings in sensors.items() if isinstance(settings, DvlSettings)}
        self._frames = {
            name: (own.beams, own.bins)
            for name, settings in sensors.items()
            if isinstance(settings, ImagingSonarSettings) and (own := resolved(settings))
        }
        self.refused: dict[str, int] = {}  # in a row, by sensor

    def judge(self, reading: Reading) -> str:
        """Why a reading is to be refused; "" if it is not."""
        if (shape := self._frames.get(reading.sensor)) is not None and reading.image is not None:
            # Speckle never repeats: samples that share the largest value are at the receiver's limit.
            frame = reading.image
            return fault(frame, math.prod(shape), float(frame.max())) if frame.shape == shape else WRONG_SIZE
        screens = self._screens.get(reading.sensor)
        if screens is None:
            return ""
        if reading.stamp > reading.received + CLOCK:
            return "clock"
        values = reading.value.tolist()
        if reading.sensor in self._dvls:  # two tracks, either of which may be lost
            heard = np.repeat(~np.isnan(reading.value.reshape(2, 3)).all(axis=1), 3).tolist()
            screens, values = list(compress(screens, heard)), list(compress(values, heard))
        return judge(screens, reading.stamp, values)

    def passed(self, readings: Sequence[Reading]) -> tuple[list[Reading], list[Outcome]]:
        """Those that may be heard, and the fates of the others."""
        good, refused = [], []
        for reading in readings:
            reason = self.judge(reading)
            if reason:
                sensor, sequence = reading.sensor, reading.sequence
                refused.append(Outcome(sensor, "", reading.stamp, sequence, False, reason, math.nan))
                self.refused[sensor] = self.refused.get(sensor, 0) + 1
            else:
                good.append(reading)
        return good, refused


def _limits(settings: Any, actuation: Actuation, frozen: bool) -> list[Limits]:
    """What each component of a sensor's readings can show; none of a sensor that is not known."""

    def noisy(sigma: float, low: float, high: float, rate: float, period: float | None = None) -> Limits:
        live = EQUAL / settings.rate if frozen and sigma > 0.0 else math.inf
        return Limits(low=low, high=high, rate=rate, noise=SURE * sigma, frozen=live, period=period)

    turn, full = math.tau, Limits(low=-math.pi, high=math.pi)
    match settings:
        case CompassSettings():
            return [noisy(math.radians(settings.heading_noise_deg), -turn, turn, TURN, turn), full, full]
        case DepthSettings():
            return [noisy(settings.noise, *DEPTHS, CLIMB)]
        case GyroSettings():
            sigma = math.radians(settings.noise_density_deg) * math.sqrt(settings.rate)
            return [noisy(sigma, -RATE, RATE, SPIN)] * 3
        case DvlSettings():
            sigmas = (*settings.bottom_noise, *settings.water_noise)
            return [noisy(sigma, -SPEED, SPEED, JOLT) for sigma in sigmas]
        case RangeSettings():
            return [noisy(settings.noise, -SURE * settings.noise, 1.1 * settings.maximum, FASTEST)]
        case LightSettings():
            return [full, full]
        case AltimeterSettings():
            return [noisy(settings.noise, -SURE * settings.noise, 1.2 * settings.maximum_range, math.inf)]
        case ImuSettings():
            return [Limits(low=-RATE, high=RATE)] * 3 + [Limits(low=-SHOCK, high=SHOCK)] * 3
        case FixSettings() | GpsSettings():
            return [Limits(low=-FARTHEST, high=FARTHEST)] * 2
        case FeedbackSettings():
            return [Limits(low=2.0 * low, high=2.0 * high) for low, high in actuation.limits.tolist()]
    return []
