"""Bearing to a light in a dock's mouth, by a camera in the nose: the sensor of the last metres."""

import math
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.base.frames import Array, rotation
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import StructurePose, Truth
from auvsim.sensors.sensor import Sensor, Surroundings

Vector = tuple[float, float, float]


class LightSettings(Settings):
    """A camera that looks ahead and finds the light in the centre of a dock's mouth.

    How far a light is seen depends on the water; nearer than `minimum_range` it dazzles. It shines out of the mouth, so
    that nothing is seen from behind. Of several docks the camera finds the nearest that it sees.
    """

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=2.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    camera: Vector = Field(default=(0.7, 0.0, 0.0), description="place in the vehicle's body frame [m]")
    minimum_range: float = Field(default=1.0, ge=0.1, le=100.0, description="range below which nothing is seen [m]")
    maximum_range: float = Field(default=15.0, gt=0.0, le=200.0, description="range beyond which nothing is seen [m]")
    field_of_view_deg: float = Field(
        default=70.0, gt=0.0, le=170.0, description="full width of the cone about the bow in which it sees [deg]"
    )
    noise_deg: float = Field(default=0.5, ge=0.0, le=30.0, description="white noise of each angle, sd [deg]")
    bias_deg: float = Field(
        default=0.5, ge=0.0, le=30.0, description="error of the mounting of a trial, each angle, sd [deg]"
    )
    dropout_probability: float = Field(default=0.05, ge=0.0, le=1.0, description="share of readings lost [-]")

    @model_validator(mode="after")
    def _ranges_rise(self) -> "LightSettings":
        if self.maximum_range <= self.minimum_range:
            raise ValueError(f"maximum_range must be more than minimum_range, {self.minimum_range:g} m")
        return self


class Light(Sensor):
    """Measures azimuth and elevation (2,) [rad] of a dock's light from the bow, in the vehicle's axes.

    Azimuth is positive to starboard, elevation positive above the bow. A reading takes 2 normals and 1 uniform, whether
    the light is seen or not.
    """

    kind, Settings = "light", LightSettings
    value = Variable(
        ("direction",),
        "float64",
        "rad",
        "direction of the dock's light from the bow",
        "body",
        labels=("azimuth", "elevation"),
    )
    sizes: ClassVar = {"direction": 2}

    def __init__(self, settings: LightSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        self.bias = math.radians(settings.bias_deg) * np.array(self._noise.normals(2))  # of this trial [rad]
        self._camera = np.array(settings.camera)
        self._half = 0.5 * math.radians(settings.field_of_view_deg)

    def measure(self, truth: Truth, world: Surroundings) -> Reading | None:
        """The direction now, or None where no light is seen."""
        settings = self.settings
        draws, (chance,) = np.array(self._noise.normals(2)), self._noise.uniforms(1)
        turned = rotation(*truth.attitude.tolist())
        eye = truth.position + turned @ self._camera
        seen = [ray for dock in world.structures.values() if (ray := self._ray(dock.pose, eye, turned)) is not None]
        if not seen or chance < settings.dropout_probability:
            return None
        x, y, z = min(seen, key=lambda ray: float(ray @ ray)).tolist()
        direction = np.array((math.atan2(y, x), math.atan2(-z, math.hypot(x, y))))
        return self._reading(truth.time, direction + self.bias + math.radians(settings.noise_deg) * draws)

    def _ray(self, dock: StructurePose, eye: Array, turned: Array) -> Array | None:
        """From the camera to a dock's light (3,) in the vehicle's axes [m]; None where it is not seen."""
        away = dock.position - eye
        distance = math.sqrt(float(away @ away))
        inward = rotation(dock.roll, dock.pitch, dock.heading)[:, 0]
        ray = turned.T @ away
        near = self.settings.minimum_range <= distance <= self.settings.maximum_range
        return ray if near and inward @ away > 0.0 and ray[0] >= distance * math.cos(self._half) else None
