"""Attributes of a log: of the run, of each vehicle and of each structure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

FORMAT_VERSION = 3
STATUSES = ("complete", "diverged", "interrupted")
# What may differ between two runs of the same trial.
WALL_TIME = "wall_time"
VERSIONS = {f"{package}_version": package for package in ("auvsim", "mujoco", "numpy", "numba")}


@dataclass(frozen=True, slots=True)
class AttributeSpec:
    """What an attribute of a log is."""

    meaning: str
    types: type = float  # str, int, or float (which integers fit too)
    required: bool = True
    may_be_nan: bool = False

    def accepts(self, value: Any) -> bool:
        """Whether a value has the attribute's type and is finite where it should be."""
        if isinstance(value, bool) or not isinstance(value, (int, float) if self.types is float else self.types):
            return False
        return isinstance(value, str) or self.may_be_nan or math.isfinite(value)


RUN_ATTRIBUTES: Mapping[str, AttributeSpec] = {
    "format_version": AttributeSpec("version of this layout", int),
    "status": AttributeSpec("complete, diverged or interrupted", str),
    "scenario": AttributeSpec("the full scenario as YAML", str),
    "seed": AttributeSpec("seed of the random streams", int),
    "trial": AttributeSpec("number of the trial under that seed", int),
    WALL_TIME: AttributeSpec("duration of the run [s]; NaN if it was not measured", required=False, may_be_nan=True),
    **{name: AttributeSpec(f"version of {package}", str, required=False) for name, package in VERSIONS.items()},
    "latitude": AttributeSpec("latitude of the origin of NED [deg]", required=False),
    "longitude": AttributeSpec("longitude of the origin of NED [deg]", required=False),
}
VEHICLE_ATTRIBUTES: Mapping[str, AttributeSpec] = {
    "model": AttributeSpec("name of the vehicle's model", str),
    "nose": AttributeSpec("how far the nose is forward of the body origin [m]"),
    "estimator": AttributeSpec("kind of the estimator", str),
    "controller": AttributeSpec("kind of the controller", str),
    "mission": AttributeSpec("kind of the mission", str),
    "dock": AttributeSpec("name of the structure that the mission is about", str, required=False),
}
STRUCTURE_ATTRIBUTES: Mapping[str, AttributeSpec] = {
    "model": AttributeSpec("name of the structure's model", str),
    "north": AttributeSpec("place of the mouth's centre in NED [m]"),
    "east": AttributeSpec("place of the mouth's centre in NED [m]"),
    "depth": AttributeSpec("depth of the mouth's centre [m]"),
    "heading": AttributeSpec("course of a vehicle that enters [rad]"),
    "mouth_radius": AttributeSpec("radius of the mouth [m]"),
    "throat_radius": AttributeSpec("radius of the throat behind the funnel [m]"),
    "cone_length": AttributeSpec("length of the funnel from mouth to throat [m]"),
    "throat_length": AttributeSpec("length of the throat [m]"),
    "latched": AttributeSpec("where the latch holds the nose, along the axis from the mouth [m]", required=False),
    "transceiver_forward": AttributeSpec("place of the USBL transceiver in the dock's frame [m]", required=False),
    "transceiver_starboard": AttributeSpec("place of the USBL transceiver in the dock's frame [m]", required=False),
    "transceiver_down": AttributeSpec("place of the USBL transceiver in the dock's frame [m]", required=False),
}
