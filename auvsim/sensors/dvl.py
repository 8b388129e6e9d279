"""A Doppler velocity log: velocity over ground (bottom track) and through a layer of water below (water track).

It is taken as measured at the body's origin: the lever arm of its mounting, yaw rate times about half a metre, is
known on a real vehicle, which takes it out with its gyro. Four beams, 45 deg off the bow and the stern, meet the sea
floor as the hull lies and the floor rises; bottom track needs three of them. The floor is at rest, so its slope does
not change what a beam shows.
"""

import math
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.base.frames import Array, rotation
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors.floor_rays import slant_range
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
    beam_tilt_deg: float = Field(default=30.0, ge=10.0, le=45.0, description="of the four beams off its axis [deg]")
    minimum_altitude: float = Field(
        default=0.5, ge=0.0, description="altitude, by a beam's range, below which that measures nothing [m]"
    )
    maximum_altitude: float = Field(
        default=65.0, gt=0.0, description="altitude, by a beam's range, above which that sees no bottom [m]"
    )
    dropout_at_maximum: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description="share of bottom tracks lost besides at the maximum altitude; it falls with the altitude's fourth "
        "power [-]",
    )
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
        tilt = math.radians(settings.beam_tilt_deg)
        self._beams, self._along = beams(tilt), math.cos(tilt)
        self._three = [three_beams(self._beams, lost) for lost in range(4)]

    def measure(self, truth: Truth, world: Surroundings) -> Reading:
        """Pings once and measures both tracks."""
        settings = self.settings
        draws, chances = np.array(self._noise.normals(6)), self._noise.uniforms(2)
        turn = rotation(*truth.attitude.tolist())
        altitudes = [self._along * slant_range(world.terrain, truth.position, beam) for beam in self._beams @ turn.T]
        seen = [settings.minimum_altitude <= altitude <= settings.maximum_altitude for altitude in altitudes]
        if sum(seen) == 3:
            draws[:3] = self._three[seen.index(False)] @ draws[:3]
        ground = truth.nu[:3]
        water = world.current.evaluate(truth.time, truth.position + self._below).velocity
        through = ground - water @ turn
        value = np.concatenate((self._errors @ ground, self._errors @ through)) + (self.biases + self._sigmas * draws)
        if sum(seen) < 3 or chances[0] < self._lost(altitudes, seen):
            value[:3] = math.nan
        north, east, down = truth.position.tolist()
        altitude = world.terrain.depth(north, east) - down
        layer = altitude >= settings.minimum_altitude and USABLE * altitude >= settings.water_layer[1]
        if not layer or chances[1] < settings.dropout_probability:
            value[3:] = math.nan
        return self._reading(truth.time, value)

    def _lost(self, altitudes: list[float], seen: list[bool]) -> float:
        """Probability that a bottom track is lost, at altitudes by the beams [m] that see the bottom."""
        settings = self.settings
        mean = sum(a for a, sees in zip(altitudes, seen, strict=True) if sees) / sum(seen)
        share = settings.dropout_at_maximum * (mean / settings.maximum_altitude) ** 4
        return settings.dropout_probability + (1.0 - settings.dropout_probability) * share


def beams(tilt: float) -> Array:
    """Unit vectors (4, 3) of the beams in the body's axes, 45 deg off bow and stern, tilted off the downward axis."""
    aside = math.sin(tilt) * math.sqrt(0.5)
    return np.array([(x * aside, y * aside, math.cos(tilt)) for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))])


def three_beams(all_four: Array, lost: int) -> Array:
    """Matrix (3, 3) that makes noise of three beams from white noise: unit deviations are those of all four.

    Each beam errs alike and by itself; a velocity is the least-squares solution of those that see the bottom.
    """
    of_four = np.linalg.inv(all_four.T @ all_four)
    rest = np.delete(all_four, lost, axis=0)
    deviations = np.sqrt(np.diagonal(of_four))
    return np.asarray(np.linalg.cholesky(np.linalg.inv(rest.T @ rest) / np.outer(deviations, deviations)), dtype=float)
