"""Gyro, DVL, ranges and a dock's light for the docking filters: which are on board, and their constant errors."""

import math
from collections.abc import Collection, Mapping
from typing import Any

from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.sensors.light import LightSettings
from auvsim.sensors.range import RangeSettings
from estimators.docking.aids import Aids
from estimators.docking.noise import Bias

KINDS = {"gyro": GyroSettings, "dvl": DvlSettings, "range": RangeSettings, "light": LightSettings}
SPEED = 1.5  # at which a DVL's errors of scale and mounting are taken for biases [m/s]


def used(sensors: Mapping[str, Any], use: Collection[str]) -> dict[str, Any]:
    """Settings of those sensors on board, by name, that are of the kinds to be used."""
    kinds = tuple(KINDS[kind] for kind in use)
    return {name: settings for name, settings in sensors.items() if isinstance(settings, kinds)}


def assumed(sensors: Mapping[str, Any]) -> Aids:
    """What a docking filter is told of them."""
    return Aids(
        gyro=any(isinstance(s, GyroSettings) for s in sensors.values()),
        dvl=any(isinstance(s, DvlSettings) for s in sensors.values()),
        ranges={name: s.transponder[:2] for name, s in sensors.items() if isinstance(s, RangeSettings)},
        lights={name: s.camera[:2] for name, s in sensors.items() if isinstance(s, LightSettings)},
    )


def biases(sensors: Mapping[str, Any], compass: Any) -> dict[str, Bias]:
    """Their constant errors, as states; that of the compass, too, which they make visible."""
    found: dict[str, Bias] = {}
    if sensors and isinstance(compass, CompassSettings) and compass.heading_bias_deg > 0.0:
        found["compass"] = Bias(math.radians(compass.heading_bias_deg))
    for name, s in sensors.items():
        match s:
            case GyroSettings():
                found["gyro"] = Bias(math.radians(s.bias_deg), math.radians(s.bias_walk_deg) ** 2)
            case DvlSettings():
                found["dvl_surge"] = Bias(math.hypot(s.bias, SPEED * s.scale_error))
                found["dvl_sway"] = Bias(math.hypot(s.bias, SPEED * math.radians(s.misalignment_deg)))
            case RangeSettings():
                found[f"range_{name}"] = Bias(s.bias)
                found[f"range_scale_{name}"] = Bias(s.scale_error)
            case LightSettings():
                found[f"light_{name}"] = Bias(math.radians(s.bias_deg))
    return {name: bias for name, bias in found.items() if bias.deviation > 0.0}
