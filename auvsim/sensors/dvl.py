"""A Doppler velocity log: velocity over ground (bottom track) and through a layer of water below (water track).

It is taken as measured at the body's origin: the lever arm of its mounting, yaw rate times about half a metre, is
known on a real vehicle, which takes it out with its gyro. Altitude is the vertical distance to the sea floor
below the body's origin.
"""

import math
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.base.frames import rotation
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.sensor import Sensor, Surroundings

Vector = tuple[float, float, float]
USABLE = 0.8  # share of the altitude above which water track sees no bottom (as in Teledyne RDI's Pathfinder guide)


class DvlSettings(Settings):
    """A Doppler velocity log of an AUV; off in docking trials, on in manoeuvres.

    Scale error, bias and altitudes are those that data sheets of the Teledyne RDI Explorer (600 kHz) and the Nortek
    DVL1000 give: 0.1 to 0.3 % and 0.1 to 0.2 cm/s, from 0.3 m to 65 or 75 m. White noise is about 1 cm/s a ping. With
    beams 30 deg off the vertical, noise along the beams weighs 2.4 times less on the vertical than on the horizontal.
    """

    enabled: bool = Field(default=False, description="whether the vehicle has it")
    rate: float = Field(default=5.0, gt=0.0, description="readings per second, divides the control rate [Hz]")
    bottom_noise: Vector = Field(
        default=(0.01, 0.01, 0.004), description="white noise over ground: forward, starboard, down, sd [m/s]"
    )
    water_noise: Vector = Field(
        default=(0.02, 0.02, 0.008), description="white noise through the water: forward, starboard, down, sd [m/s]"
    )
    scale_error: float = Field(default=0.002, ge=0.0, description="scale error of a trial, both tracks, sd [-]")
    bias: float = Field(default=0.002, ge=0.0, description="bias of a trial, each axis and track, sd [m/s]")
    misalignment_deg: float = Field(
        default=0.3, ge=0.0, description="error of its mounting in heading, of a trial, sd [deg]"
    )
    minimum_altitude: float = Field(default=0.5, ge=0.0, description="altitude below which it measures nothing [m]")
    maximum_altitude: float = Field(default=65.0, gt=0.0, description="altitude above which bottom track is lost [m]")
    water_layer: tuple[float, float] = Field(
        default=(2.0, 8.0), description="layer of the water track: near and far edge below the vehicle [m]"
    )
    dropout_probability: float = Field(
        default=0.01, ge=0.0, le=1.0, description="share of readings that each track loses at random [-]"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "DvlSettings":
        if min(*self.bottom_noise, *self.water_noise) < 0.0:
            raise ValueError("bottom_noise and water_noise are standard deviations, they must be >= 0")
        if self.maximum_altitude <= self.minimum_altitude:
            raise ValueError(f"maximum_altitude must be more than minimum_altitude, {self.minimum_altitude} m")
        if not 0.0 <= self.water_layer[0] < self.water_layer[1]:
            raise ValueError(f"water_layer is {list(self.water_layer)}, it must be 0 <= near < far edge")
        return self


class Dvl(Sensor):
    """Measures (6,) [m/s]: u, v, w over ground, then through the water; NaN where that track is lost.

    Each reading takes 6 normals and 2 uniforms, whatever becomes of it. Both tracks share one transducer, and so the
    errors of scale and mounting. The water's velocity is that in the middle of the layer.
    """

    kind, Settings = "dvl", DvlSettings
    value = Variable(
        ("over_ground_and_through_water",),
        "float64",
        "m/s",
        "velocity over ground u, v, w, then through the water u, v, w; NaN where that track is lost",
        "body",
    )
    sizes: ClassVar = {"over_ground_and_through_water": 6}

    def __init__(self, settings: DvlSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        scale, misalignment, *biases = self._noise.normals(8)
        self.scale = 1.0 + settings.scale_error * scale  # of this trial [-]
        self.misalignment = math.radians(settings.misalignment_deg) * misalignment  # of this trial [rad]
        self.biases = settings.bias * np.array(biases)  # (6,) of this trial [m/s]
        self._sigmas = np.array((*settings.bottom_noise, *settings.water_noise))
        # Seen from a transducer that is turned to starboard, the same velocity is turned to port.
        self._errors = self.scale * rotation(0.0, 0.0, self.misalignment).T
        self._below = np.array((0.0, 0.0, 0.5 * sum(settings.water_layer)))

    def measure(self, truth: Truth, world: Surroundings) -> Reading:
        """Pings once and measures both tracks."""
        settings = self.settings
        noise = self.biases + self._sigmas * self._noise.normals(6)
        chances = self._noise.uniforms(2)
        ground = truth.nu[:3]
        water = world.current.evaluate(truth.time, truth.position + self._below).velocity
        through = ground - water @ rotation(*truth.attitude.tolist())
        value = np.concatenate((self._errors @ ground, self._errors @ through)) + noise
        north, east, down = truth.position.tolist()
        altitude = world.terrain.depth(north, east) - down
        bottom = settings.minimum_altitude <= altitude <= settings.maximum_altitude
        layer = altitude >= settings.minimum_altitude and USABLE * altitude >= settings.water_layer[1]
        if not bottom or chances[0] < settings.dropout_probability:
            value[:3] = math.nan
        if not layer or chances[1] < settings.dropout_probability:
            value[3:] = math.nan
        return self._reading(truth.time, value)
