"""A forward-looking multibeam imaging sonar: echo intensity by beam and range of sea floor, docks and vehicles."""

import math
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.base.frames import Array, rotation
from auvsim.base.reading import Reading
from auvsim.base.settings import Settings
from auvsim.data.variables import Variable
from auvsim.physics.truth import Truth
from auvsim.sensors import sonar_array, sonar_echo
from auvsim.sensors.sensor import Sensor, Surroundings
from auvsim.sensors.sonar_faults import FaultSettings, spoiled
from auvsim.water.terrain_grid import GriddedFloor

FRAME = Variable(("beam", "bin"), "int8", "0.5 dB", "level above the noise in the middle of the ranges", "body")
ELEVATIONS = 24  # rays to each beam that look for objects
FINE = math.radians(0.1)  # between the rays of beams that have met one, for shadows as sharp as the floor's [rad]
STEEPEST = 1.55  # angle below the horizon beyond which nothing is looked for [rad]
OBJECT_ECHO = 1.0  # backscatter of a hull or frame by that of sand at normal incidence; assumed
TEMPERATURE = 10.0  # of the water that absorbs [deg C]


class Preset(NamedTuple):
    """What a data sheet says of an instrument."""

    settings: dict[str, float]  # that it replaces
    farthest: float  # echo that it can show [m]
    resolution: float  # in range, the least width of a bin [m]


# From data sheets: Blueprint Subsea, Oculus M750d at 750 kHz (512 beams 0.25 deg apart); Teledyne BlueView M900-130 at
# 900 kHz (768 beams 0.18 deg apart, which would be 138 deg: here they are spread over the 130 deg). Sui, Pan, Jing and
# Leung (IEEE Robotics and Automation Letters 9(2), 2024) list the same numbers of both. They make 40 and 25 frames a
# second, more than `rate` can be. Not on data sheets, and so assumed here as everywhere: depression, signal to noise,
# gain, second path, Gaussian beams in elevation, and in bearing beams of a line with a Hann shading.
_BOTH = {"sector_deg": 130.0, "beam_width_deg": 1.0, "elevation_deg": 20.0}
PRESETS: dict[str, Preset] = {
    "oculus_m750d": Preset({**_BOTH, "beams": 512, "frequency": 750.0}, 120.0, 0.004),
    "blueview_m900": Preset({**_BOTH, "beams": 768, "frequency": 900.0}, 100.0, 0.014),
}


class ImagingSonarSettings(Settings):
    """A multibeam imaging sonar that looks ahead and down.

    The defaults are those of a small forward-looking sonar of some 750 kHz; `preset` has those of two instruments.
    """

    enabled: bool = Field(default=True, description="whether the vehicle has it")
    rate: float = Field(default=1.0, gt=0.0, le=20.0, description="frames per second, divides the control rate [Hz]")
    preset: Literal["none", "oculus_m750d", "blueview_m900"] = Field(
        default="none",
        description="an instrument whose sector, beams and frequency replace those below; it limits the farthest range",
    )
    beams: int = Field(default=128, ge=8, le=1024, description="number of beams [-]")
    sector_deg: float = Field(default=120.0, ge=10.0, le=170.0, description="between the outermost beams [deg]")
    beam_width_deg: float = Field(default=1.2, gt=0.05, le=20.0, description="of a beam at half power [deg]")
    elements: int = Field(
        default=0,
        ge=0,
        le=1024,
        description="of its line array, half a wavelength apart: what they hear is steered to the beams, which widen "
        "off the axis and share speckle; 0: beams of beam_width_deg, each by itself [-]",
    )
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
    faults: FaultSettings = Field(default=FaultSettings(), description="Frames that go wrong.")
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
        preset = PRESETS.get(self.preset)
        if preset is None:
            return self
        for name, number in preset.settings.items():
            given = getattr(self, name)
            if given not in (number, type(self).model_fields[name].default):
                raise ValueError(
                    f"{name}: {given:g} contradicts the preset {self.preset}, which has {number:g}; leave one of the "
                    "two out"
                )
        if self.maximum_range > preset.farthest:
            raise ValueError(
                f"maximum_range: {self.maximum_range:g} m; {self.preset} has {preset.farthest:g} m or less"
            )
        width = (self.maximum_range - self.minimum_range) / self.bins
        if width < preset.resolution:
            raise ValueError(
                f"bins: {width:g} m wide; {self.preset} has {preset.resolution:g} m or more, so give fewer"
            )
        return self

    @model_validator(mode="after")
    def _beams_suffice(self) -> "ImagingSonarSettings":
        settings = resolved(self)
        if not settings.elements:
            return self
        width = math.degrees(sonar_array.beam_width(settings.elements))
        apart = settings.sector_deg / (settings.beams - 1)
        if apart > 0.5 * width:
            raise ValueError(
                f"beams: {settings.elements} elements make beams of {width:.2g} deg, which must stand at most half of "
                f"that apart, {apart:.2g} deg; give {math.ceil(2.0 * settings.sector_deg / width) + 1} beams or more"
            )
        return self


class ImagingSonar(Sensor):
    """Measures intensities (beams, bins), from port to starboard and from near to far; a frame a reading.

    A frame takes beams times bins draws from the exponential law, and one block of them, whatever it shows; with
    `elements`, twice as many from the normal one.
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
        settings = resolved(settings)
        self.settings, self._generator = settings, generator
        # A stream of their own, so that noise is the same with faults and without.
        self._chances = generator.spawn(1)[0] if settings.faults.total else None
        self.width = (settings.maximum_range - settings.minimum_range) / settings.bins  # of a bin [m]
        spacing = float(self.bearings[1] - self.bearings[0])
        self._weights = sonar_echo.pattern(spacing, math.radians(settings.beam_width_deg))
        self._response = sonar_array.response(self.bearings, settings.elements) if settings.elements else None
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

    def measure(self, truth: Truth, world: Surroundings) -> Reading | None:
        """Takes a frame: `image` has the intensities (beams, bins), `value` what the log holds of it.

        A frame that goes missing has a number in the sequence, too; one that is late is `received` then.
        """
        faults = self.settings.faults
        fault = faults.of(float(self._chances.random())) if self._chances is not None else None
        frame = spoiled(self.image(truth, world), fault)
        reading = self._reading(truth.time, self._logged(frame))
        if fault == "missing":
            return None
        return reading._replace(image=frame, received=truth.time + (faults.delay if fault == "late" else 0.0))

    def _logged(self, frame: np.ndarray) -> Any:
        """What the log holds of a frame; of one that has not its size, no sample at all."""
        if not self.settings.log_frames:
            mean = float(frame.mean())
            return np.array((mean, float(frame.max()) / max(mean, 1e-300)))
        if frame.shape != self._mean.shape:
            return np.full(self._mean.shape, -128, dtype=np.int8)
        levels = np.where(np.isfinite(frame), 2.0 * self.level(frame), -128.0)
        return np.clip(np.rint(levels), -128, 127).astype(np.int8)

    def level(self, frame: np.ndarray) -> np.ndarray:
        """Intensities as levels above the noise in the middle of the ranges [dB]."""
        return 10.0 * np.log10(np.maximum(frame, 1e-30) / self.reference)

    def image(self, truth: Truth, world: Surroundings) -> np.ndarray:
        """Intensities (beams, bins) of one ping from here."""
        mean = self.mean(truth, world)
        power = (mean + self.noise).astype(np.float32)
        if self._response is not None and self.settings.speckle:
            return sonar_array.steered(self._response, self._narrow + self.noise, self._generator) * self._gain
        draws = self._generator.standard_exponential(mean.shape, dtype=np.float32)
        return (power * draws if self.settings.speckle else power) * self._gain

    def mean(self, truth: Truth, world: Surroundings) -> Array:
        """Mean intensities (beams, bins) before noise, speckle and gain."""
        turn = rotation(*truth.attitude.tolist())
        place = truth.position + turn @ np.array((self.settings.nose, 0.0, 0.0))
        roll_free = math.asin(min(1.0, max(-1.0, float(turn[2, 0]))))  # how far the bow points down [rad]
        pose = np.array((*place, float(truth.attitude[2]), self._axis + roll_free))
        depths, strength, grid = floor_of(world.terrain, place)
        beside = sonar_echo.BESIDE * self._high
        fan = np.array((max(pose[4] - beside, -STEEPEST), min(pose[4] + beside, STEEPEST)))
        hits, facing = self._met(world, place, pose, fan)
        if hits.size:
            sonar_echo.hide(depths, grid, pose, self.bearings, self.width, fan, hits)
        self._narrow[:] = self._echoes(hits, facing, pose, fan) if hits.size else 0.0
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
            fan,
            hits,
            self._narrow,
        )
        if self._response is not None:
            return np.asarray(self._response**2 @ self._narrow, dtype=float)
        sonar_echo.spread(self._narrow, self._weights, self._mean)
        return self._mean

    def _met(self, world: Surroundings, place: Array, pose: Array, fan: Array) -> tuple[Array, Array]:
        """Ranges (beams, e) at which rays meet docks and vehicles, and cosines there; (beams, 0) where none does.

        Few rays of each beam find the beams that meet something; many of those, and of their neighbours, measure it.
        """
        nothing = np.zeros((len(self.bearings), 0))
        found = self._cast(world, place, pose, fan, ELEVATIONS, np.arange(len(self.bearings)))
        if found is None or not np.isfinite(found[0]).any():
            return nothing, nothing
        met = np.convolve(np.isfinite(found[0]).any(axis=1), np.ones(3), mode="same") > 0.0
        beams = np.flatnonzero(met)
        count = math.ceil(float(fan[1] - fan[0]) / FINE)
        hits, facing = np.full((len(met), count), np.inf), np.zeros((len(met), count))
        fine = self._cast(world, place, pose, fan, count, beams)
        if fine is not None:
            hits[beams], facing[beams] = fine
        return hits, facing

    def _cast(
        self, world: Surroundings, place: Array, pose: Array, fan: Array, count: int, beams: np.ndarray
    ) -> tuple[Array, Array] | None:
        """What so many rays of each beam meet: ranges (beams, count) [m] and cosines."""
        below = _middles(fan, count)
        azimuth = pose[3] + self.bearings[beams]
        directions = np.stack(np.broadcast_arrays(
            np.cos(below) * np.cos(azimuth)[:, None], np.cos(below) * np.sin(azimuth)[:, None], np.sin(below)
        ), axis=2)  # fmt: skip
        found = world.rays(place, directions.reshape(-1, 3), self.settings.maximum_range)
        return None if found is None else (found[0].reshape(-1, count), found[1].reshape(-1, count))

    def _echoes(self, hits: Array, facing: Array, pose: Array, fan: Array) -> Array:
        """Intensities (beams, bins) of what rays (beams, e) meet from a pose, see `_met` and `sonar_echo.scan`."""
        echoes = np.zeros(self._narrow.shape)
        count = hits.shape[1]
        met = (hits >= self.settings.minimum_range) & (hits < self.settings.maximum_range)
        b, e = np.nonzero(met)
        distance, below = hits[met], _middles(fan, count)[e]
        sharpness = 8.0 * math.log(2.0) / self._high**2
        share = np.exp(-sharpness * (below - pose[4]) ** 2 - 2.0 * self.absorption * distance) / distance**2
        share *= self._beam[0] * float(fan[1] - fan[0]) / count * OBJECT_ECHO * facing[met]
        mirrored = np.hypot(distance * np.cos(below), distance * np.sin(below) + 2.0 * pose[2])  # back by the surface
        for path, power in ((distance, 1.0), (0.5 * (distance + mirrored), self.settings.ghost)):
            heard = path < self.settings.maximum_range
            bins = ((path[heard] - self.settings.minimum_range) / self.width).astype(int)
            np.add.at(echoes, (b[heard], bins), power * share[heard])
        return echoes


def _middles(fan: Array, count: int) -> Array:
    """Middles (count,) of equal parts of a fan, its two angles [rad]."""
    return np.asarray(fan[0] + (fan[1] - fan[0]) * (np.arange(count) + 0.5) / count, dtype=float)


def resolved(settings: ImagingSonarSettings) -> ImagingSonarSettings:
    """Settings with those of the instrument that they name."""
    preset = PRESETS.get(settings.preset)
    return settings if preset is None else settings.model_copy(update=preset.settings)


def geometry(settings: ImagingSonarSettings) -> tuple[Array, Array]:
    """Bearings (beams,) [rad] and ranges (bins,) [m] of a sonar's samples."""
    settings = resolved(settings)
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
