"""Readings as measurements for filters of `estimators.core`: value, covariance by the sensor's data sheet, source."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from auvsim.base.frames import Array, rotation
from auvsim.base.reading import Reading
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.fix import FixSettings
from auvsim.sensors.gps import GpsSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.sensors.light import LightSettings
from auvsim.sensors.range import RangeSettings
from estimators.core.types import Measurement
from estimators.docking.aids import BOTTOM, GYRO, LIGHT, RANGE, WATER
from estimators.docking.sensors import COMPASS

FIX = "fix"  # kind of measurement


def measurements(
    reading: Reading,
    settings: Any,
    depth: float,
    origin: tuple[float, float] = (0.0, 0.0),
    tilt: tuple[float, float] = (0.0, 0.0),
) -> Iterator[Measurement]:
    """What a reading says of the horizontal motion; nothing, where its sensor is none that is known here.

    A DVL's track that is lost says nothing; components of one that are not numbers are for the filter to refuse.

    Args:
        reading: Of a compass, gyro, DVL, range, light or position.
        settings: Of its sensor.
        depth: Of the vehicle [m].
        origin: Of the filter's axes, north and east [m].
        tilt: Pitch and roll of the vehicle [rad], by which what is measured in its axes is levelled.
    """
    value = reading.value
    match settings:
        case CompassSettings():
            yield _measurement(COMPASS, reading, value[:1], math.radians(settings.heading_noise_deg))
        case GyroSettings():
            sigma = math.radians(settings.noise_density_deg) * math.sqrt(settings.rate)
            pitch, roll = tilt
            _, q, r = value.tolist()
            turn = (q * math.sin(roll) + r * math.cos(roll)) / math.cos(pitch)
            yield _measurement(GYRO, reading, np.array((turn,)), sigma)
        case DvlSettings():
            level = rotation(tilt[1], tilt[0], 0.0)[:2]
            for kind, track, sigma in (
                (BOTTOM, value[:3], settings.bottom_noise),
                (WATER, value[3:], settings.water_noise),
            ):
                if not np.isnan(track).all():
                    yield _measurement(kind, reading, level @ track, *sigma[:2])
        case RangeSettings():
            north, east, down = settings.beacon
            place = (north - origin[0], east - origin[1], down - depth - settings.transponder[2])
            yield _measurement(RANGE, reading, value, settings.noise, source=reading.sensor, parameters=place)
        case LightSettings():
            azimuth, elevation = value.tolist()
            ray = np.array((math.cos(azimuth), math.sin(azimuth), -math.tan(elevation)))
            x, y, _ = (rotation(tilt[1], tilt[0], 0.0) @ ray).tolist()
            level, sigma = np.array((math.atan2(y, x),)), math.radians(settings.noise_deg)
            yield _measurement(LIGHT, reading, level, sigma, source=reading.sensor)
        case FixSettings():
            yield _measurement(FIX, reading, value[:2], settings.noise, settings.noise)
        case GpsSettings():
            # An error that stays for a while weighs as white noise of its spectral density.
            sigma = math.hypot(settings.noise, settings.wander * math.sqrt(2.0 * settings.wander_time * settings.rate))
            yield _measurement(FIX, reading, value, sigma, sigma)


def _measurement(kind: str, reading: Reading, value: Array, *sigmas: float, **more: Any) -> Measurement:
    """A measurement of white noise; an exact sensor counts as one of a thousandth of a unit."""
    return Measurement(
        kind=kind, value=value, covariance=np.diag(np.maximum(sigmas, 1e-3) ** 2), stamp=reading.stamp,
        received=reading.received, sequence=reading.sequence, **more,
    )  # fmt: skip


def averaged(readings: Sequence[Reading]) -> list[tuple[Reading, int]]:
    """Means of the readings of each sensor, at the mean of their stamps, and how many are in each.

    For sensors that are read often, of which the noise is white. Headings of a compass are taken the short way round;
    where a value is not finite, as of a DVL's lost track, the readings stay single.
    """
    groups: dict[str, list[Reading]] = {}
    for reading in readings:
        groups.setdefault(reading.sensor, []).append(reading)
    means = []
    for group in groups.values():
        values = np.array([r.value for r in group])
        if len(group) == 1 or not np.isfinite(values).all():
            means += [(reading, 1) for reading in group]
            continue
        n, first = len(group), values[0]
        if group[0].sensor == "compass":
            values = first + np.remainder(values - first + math.pi, math.tau) - math.pi
        stamp = sum(r.stamp for r in group) / n
        means.append((group[-1]._replace(stamp=stamp, value=values.sum(axis=0) / n), n))
    return means


def of_kind(sensors: Mapping[str, Any], settings: type) -> dict[str, Any]:
    """The sensors whose settings are of a class, by name."""
    return {name: own for name, own in sensors.items() if isinstance(own, settings)}
