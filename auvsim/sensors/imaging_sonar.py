"""A forward-looking multibeam imaging sonar: echo intensity by beam and range of sea floor, docks and vehicles."""

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.base.frames import Array, rotation
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors import sonar_echo
from auvsim.sensors.sensor import Sensor, Surroundings
from auvsim.water.terrain_grid import GriddedFloor

FRAME = Variable(("beam", "bin"), "int8", "0.5 dB", "level above the noise in the middle of the ranges", "body")
ELEVATIONS = 9  # rays to each beam that look for objects
OBJECT_ECHO = 1.0  # backscatter of a hull or frame by that of sand at normal incidence; assumed
TEMPERATURE = 10.0  # of the water that absorbs [deg C]


# Data sheets: Blueprint Subsea, Oculus M750d (750 kHz: 130 deg, 512 beams at 0.25 deg, 1 deg, elevation 20 deg, 0.1 to
# 120 m, up to 40 Hz); Teledyne BlueView M900 series (900 kHz: 130 deg, 768 beams at 0.18 deg, 1 deg, elevation 20 deg,
# to 100 m, up to 25 Hz). Their farthest ranges are cut to those at which a floor still echoes.
_BOTH = {"sector_deg": 130.0, "beam_width_deg": 1.0, "elevation_deg": 20.0}
PRESETS: dict[str, dict[str, float]] = {
    "oculus_m750d": {**_BOTH, "beams": 512, "frequency": 750.0},
    "blueview_m900": {**_BOTH, "beams": 768, "frequency": 900.0},
}


class ImagingSonarSettings(Settings):
    """A multibeam imaging sonar that looks ahead and down.

    The defaults are those of a small forward-looking sonar of some 750 kHz; `preset` has those of two instruments.
    """

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=1.0, gt=0.0, le=20.0, description="frames per second, divides the control rate [Hz]")
    preset: Literal["none", "oculus_m750d", "blueview_m900"] = Field(
        default="none", description="an instrument whose sector, beams and ranges replace those below"
    )
    beams: int = Field(default=128, ge=8, le=1024, description="number of beams [-]")
    sector_deg: float = Field(default=120.0, ge=10.0, le=170.0, description="between the outermost beams [deg]")
    beam_width_deg: float = Field(default=1.2, gt=0.05, le=20.0, description="of a beam at half power [deg]")
    elevation_deg: float = Field(
        default=20.0, gt=1.0, le=90.0, description="of the beams in elevation at half power [deg]"
    )
    depression_deg: float = Field(default=20.0, ge=-30.0, le=90.0, description="of their axis below the hull's [deg]")
    minimum_range: float = Field(default=1.0, ge=0.1, description="nearest echo [m]")
    maximum_range: float = Field(default=20.0, gt=0.5, le=200.0, description="farthest echo [m]")
    bins: int = Field(default=200, ge=8, le=2048, description="ranges of a beam [-]")
    frequency: float = Field(default=750.0, ge=50.0, le=1000.0, description="of the sound, for its absorption [kHz]")
    snr: float = Field(
        default=15.0,
        ge=-100.0,
        le=300.0,
        description="echo of level sand by noise, half the maximum range away and at 5 m height [dB]",
    )
    gain: float = Field(
        default=30.0, ge=0.0, le=40.0, description="of the receiver, times the logarithm of range, with absorption [dB]"
    )
    ghost: float = Field(
        default=0.02, ge=0.0, le=1.0, description="power of the path by the surface by the direct one's [-]"
    )
    speckle: bool = Field(default=True, description="whether each sample has the exponential law of many scatterers")
    log_frames: bool = Field(default=False, description="whether the log holds all frames, some 20 kB each")
    nose: float = Field(
        default=0.0, ge=-20.0, le=20.0, description="place of its transducer ahead of the body's origin [m]"
    )

    @model_validator(mode="after")
    def _ranges_rise(self) -> "ImagingSonarSettings":
        if self.maximum_range <= self.minimum_range:
            raise ValueError(f"maximum_range must be more than minimum_range, {self.minimum_range:g} m")
        return self

    @model_validator(mode="after")
    def _preset_is_whole(self) -> "ImagingSonarSettings":
        for name, number in PRESETS.get(self.preset, {}).items():
            given = getattr(self, name)
            if given not in (number, type(self).model_fields[name].default):
                raise ValueError(
                    f"{name}: {given:g} contradicts the preset {self.preset}, which has {number:g}; leave one of the "
                    "two out"
                )
        return self


class ImagingSonar(Sensor):
    """Measures intensities (beams, bins), from port to starboard and from near to far; a frame a reading.

    A frame takes beams times bins draws from the exponential law, and one block of them, whatever it shows.
    """

    kind, Settings = "imaging_sonar", ImagingSonarSettings
    value: Variable = Variable(
        ("statistic",),
        "float64",
        "1",
        "of a frame, after the gain: mean intensity, and the largest by the mean",
        "body",
    )
    sizes: Mapping[str, int] = {"statistic": 2}

    def __init__(self, settings: ImagingSonarSettings, generator: Generator, **of_instance: Any) -> None:
        super().__init__(settings, generator, **of_instance)
        self.bearings, self.ranges = geometry(settings)
        settings = settings.model_copy(update=PRESETS.get(settings.preset, {}))
        self.settings, self._generator = settings, generator
        self.width = (settings.maximum_range - settings.minimum_range) / settings.bins  # of a bin [m]
        spacing = float(self.bearings[1] - self.bearings[0])
        self._weights = sonar_echo.pattern(spacing, math.radians(settings.beam_width_deg))
        self._high = math.radians(settings.elevation_deg)
        self._axis = math.radians(settings.depression_deg)
        self.absorption = absorption(settings.frequency)
        self._bins = np.array((self.ranges[0], self.width))
        self._beam = np.array((spacing, self._high))
        self._loss = np.exp(-2.0 * self.absorption * self.ranges) / self.ranges**4
        self.noise = self.level_echo(0.5 * settings.maximum_range, 5.0) / 10.0 ** (0.1 * settings.snr)
        self._gain = (self.ranges ** (0.1 * settings.gain) * np.exp(2.0 * self.absorption * self.ranges)).astype(
            np.float32
        )
        shape = (settings.beams, settings.bins)
        self._narrow, self._mean = np.zeros(shape), np.zeros(shape)
        if settings.log_frames:
            self.value, self.sizes = FRAME, {"beam": settings.beams, "bin": settings.bins}
        self.reference = float(self.noise * np.median(self._gain))  # intensity of level 0

    def level_echo(self, distance: float, height: float) -> float:
        """Intensity in a bin of level sand at a range [m], in the beam's axis, before the gain."""
        ground = math.sqrt(max(distance**2 - height**2, 1e-6))
        along = self.width * distance / ground
        facing = height / distance
        return facing**2 * ground * self._beam[0] * along * math.exp(-2.0 * self.absorption * distance) / distance**4

    def measure(self, truth: Truth, world: Surroundings) -> Reading:
        """Takes a frame: `image` has the intensities (beams, bins), `value` what the log holds of it."""
        frame = self.image(truth, world)
        if self.settings.log_frames:
            value: Any = np.clip(np.rint(2.0 * self.level(frame)), -128, 127).astype(np.int8)
        else:
            mean = float(frame.mean())
            value = np.array((mean, float(frame.max()) / max(mean, 1e-300)))
        return self._reading(truth.time, value)._replace(image=frame)

    def level(self, frame: np.ndarray) -> np.ndarray:
        """Intensities as levels above the noise in the middle of the ranges [dB]."""
        return 10.0 * np.log10(np.maximum(frame, 1e-30) / self.reference)

    def image(self, truth: Truth, world: Surroundings) -> np.ndarray:
        """Intensities (beams, bins) of one ping from here."""
        mean = self.mean(truth, world)
        draws = self._generator.standard_exponential(mean.shape, dtype=np.float32)
        power = (mean + self.noise).astype(np.float32)
        return (power * draws if self.settings.speckle else power) * self._gain

    def mean(self, truth: Truth, world: Surroundings) -> Array:
        """Mean intensities (beams, bins) before noise, speckle and gain."""
        turn = rotation(*truth.attitude.tolist())
        place = truth.position + turn @ np.array((self.settings.nose, 0.0, 0.0))
        roll_free = math.asin(min(1.0, max(-1.0, float(turn[2, 0]))))  # how far the bow points down [rad]
        pose = np.array((*place, float(truth.attitude[2]), self._axis + roll_free))
        hits, echoes = self._objects(world, place, pose)
        self._narrow[:] = echoes
        depths, strength, grid = floor_of(world.terrain, place)
        sonar_echo.scan(
            depths,
            strength,
            grid,
            pose,
            self.bearings,
            self._bins,
            self._beam,
            self._loss,
            self.settings.ghost,
            hits,
            self._narrow,
        )
        sonar_echo.spread(self._narrow, self._weights, self._mean)
        return self._mean

    def _objects(self, world: Surroundings, place: Array, pose: Array) -> tuple[Array, Array]:
        """Ranges (beams, e) at which rays meet docks and vehicles, and their echoes (beams, bins)."""
        echoes = np.zeros(self._narrow.shape)
        below = pose[4] + self._high * ((np.arange(ELEVATIONS) + 0.5) / ELEVATIONS - 0.5)
        azimuth = pose[3] + self.bearings
        directions = np.stack(np.broadcast_arrays(
            np.cos(below) * np.cos(azimuth)[:, None], np.cos(below) * np.sin(azimuth)[:, None], np.sin(below)
        ), axis=2)  # fmt: skip
        found = world.rays(place, directions.reshape(-1, 3), self.settings.maximum_range)
        if found is None:
            return np.zeros((len(self.bearings), 0)), echoes
        hits, facing = found
        hits, facing = hits.reshape(-1, ELEVATIONS), facing.reshape(-1, ELEVATIONS)
        met = np.isfinite(hits) & (hits >= self.settings.minimum_range) & (hits < self.settings.maximum_range)
        b, e = np.nonzero(met)
        distance = hits[met]
        sharpness = 8.0 * math.log(2.0) / self._high**2
        share = np.exp(-sharpness * (below[e] - pose[4]) ** 2 - 2.0 * self.absorption * distance) / distance**2
        share *= self._beam[0] * self._high / ELEVATIONS * OBJECT_ECHO * facing[met]
        np.add.at(echoes, (b, ((distance - self.settings.minimum_range) / self.width).astype(int)), share)
        return hits, echoes


def geometry(settings: ImagingSonarSettings) -> tuple[Array, Array]:
    """Bearings (beams,) [rad] and ranges (bins,) [m] of a sonar's samples."""
    settings = settings.model_copy(update=PRESETS.get(settings.preset, {}))
    half = 0.5 * math.radians(settings.sector_deg)
    width = (settings.maximum_range - settings.minimum_range) / settings.bins
    ranges = settings.minimum_range + width * (np.arange(settings.bins) + 0.5)
    bearings = np.linspace(-half, half, settings.beams)
    return np.asarray(bearings, dtype=float), np.asarray(ranges, dtype=float)


def absorption(frequency: float) -> float:
    """Absorption of sound's power in sea water of 10 degrees, 35 and pH 8 near the surface [1/m].

    Ainslie and McColm, "A simplified formula for viscous and chemical absorption in sea water", J. Acoust. Soc. Am.
    103 (1998), for 100 Hz to 1 MHz.

    Args:
        frequency: [kHz].
    """
    f, boric, magnesium = frequency, 0.78 * math.exp(TEMPERATURE / 26.0), 42.0 * math.exp(TEMPERATURE / 17.0)
    decibels = 0.106 * boric * f**2 / (boric**2 + f**2)
    decibels += 0.52 * (1.0 + TEMPERATURE / 43.0) * magnesium * f**2 / (magnesium**2 + f**2)
    decibels += 4.9e-4 * f**2 * math.exp(-TEMPERATURE / 27.0)  # per km
    return decibels * 1e-3 * math.log(10.0) / 10.0


def floor_of(terrain: Any, place: Array) -> tuple[Array, np.ndarray, Array]:
    """Depths, backscatter and place of the grid that is the floor round a place; of planes one of four points."""
    if isinstance(terrain, GriddedFloor):
        corner = terrain.corner
        grid = np.array((corner.north, corner.east, corner.to_north, corner.to_east))
        return terrain.depths, _SAND if terrain.strength is None else terrain.strength, grid
    half = 300.0
    north, east = float(place[0]) - half, float(place[1]) - half
    depths = np.array([[terrain.depth(n, e) for e in (east, east + 2 * half)] for n in (north, north + 2 * half)])
    return depths, _SAND, np.array((north, east, 2 * half, 2 * half))


_SAND = np.ones((1, 1), dtype=np.float32)
