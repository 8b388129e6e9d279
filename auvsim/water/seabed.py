"""A sea floor made from a seed: fractal roughness, ripples, rocks, debris, a pipeline; on a grid.

The roughness is a Gaussian field whose spectrum falls with a power of the wave number (Jackson and Richardson 2007,
High-Frequency Seafloor Acoustics, ch. 6), drawn by a fast Fourier transform.
"""

import math
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.random import Generator
from pydantic import Field, model_validator

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.base.randomness import stream
from auvsim.base.settings import Settings
from auvsim.water.terrain_grid import Corner, GriddedFloor

MOST_CELLS = 4097 * 4097
MOST_ROCKS = 200_000
ROCK_ECHO = 10.0  # backscatter of rock by that of sand: some 10 dB at grazing angles of 10 to 60 deg (ibid., fig. G.1)
PIPE_ECHO = 15.0  # of a steel or concrete pipe; assumed
DEBRIS_ECHO = 15.0  # of boxes, drums and beams of steel; assumed


class PipelineSettings(Settings):
    """A straight pipeline on the sea floor."""

    north: float = Field(default=0.0, description="of a point on it [m]")
    east: float = Field(default=0.0, description="of that point [m]")
    heading_deg: float = Field(default=90.0, description="direction in which it runs, from north [deg]")
    diameter: float = Field(default=0.5, gt=0.05, le=3.0, description="[m]")


class SeabedSettings(Settings):
    """A sea floor made from a seed, `sea_floor` deep on average; beyond its edge it stays as deep as there."""

    kind: Literal["generated"] = "generated"
    seed: int = Field(default=0, ge=0, description="of roughness and rocks; the same seed makes the same floor")
    center: tuple[float, float] = Field(default=(0.0, 0.0), description="north, east of its middle [m]")
    extent: float = Field(default=256.0, ge=10.0, le=5000.0, description="length of its sides [m]")
    spacing: float = Field(default=0.25, ge=0.05, le=10.0, description="between its points [m]")
    roughness: float = Field(default=0.3, ge=0.0, le=10.0, description="rms height of the fractal part [m]")
    exponent: float = Field(
        default=3.25, ge=2.1, le=4.0, description="with which its spectrum falls with the wave number [-]"
    )
    longest: float = Field(default=60.0, gt=0.0, description="longest wave of the fractal part [m]")
    ripple_height: float = Field(default=0.0, ge=0.0, le=1.0, description="from trough to crest [m]")
    ripple_length: float = Field(default=1.0, ge=0.1, le=50.0, description="from crest to crest [m]")
    ripple_direction_deg: float = Field(default=0.0, description="across the crests, from north [deg]")
    rocks: float = Field(default=0.01, ge=0.0, le=1.0, description="number of rocks [1/m2]")
    rock_radius: float = Field(default=0.3, gt=0.0, le=5.0, description="their median; sizes are log-normal [m]")
    debris: float = Field(default=0.0, ge=0.0, le=1.0, description="number of boxes and beams that lie about [1/m2]")
    debris_length: float = Field(
        default=1.0, gt=0.0, le=20.0, description="their median; a third as wide and a quarter as high [m]"
    )
    pipeline: PipelineSettings | None = Field(default=None, description="none: there is none")

    @model_validator(mode="after")
    def _fits(self) -> "SeabedSettings":
        cells = (self.extent / self.spacing + 1.0) ** 2
        if cells > MOST_CELLS:
            raise ValueError(
                f"extent {self.extent:g} m at spacing {self.spacing:g} m has {cells:.2g} points, at most "
                f"{MOST_CELLS:.2g}: give a spacing of {self.extent / (math.sqrt(MOST_CELLS) - 1.0):.2g} m or more"
            )
        for key, density in (("rocks", self.rocks), ("debris", self.debris)):
            if (count := density * self.extent**2) > MOST_ROCKS:
                raise ValueError(
                    f"{key}: {density:g} 1/m2 on {self.extent:g} m squared are {count:.2g}, at most {MOST_ROCKS}: give "
                    f"{MOST_ROCKS / self.extent**2:.2g} or less"
                )
        waves = {"longest": self.roughness and self.longest, "ripple_length": self.ripple_height and self.ripple_length}
        for key, length in waves.items():
            if 0.0 < length < 2.0 * self.spacing:
                raise ValueError(
                    f"{key}: {length:g} m is too short for points {self.spacing:g} m apart; give "
                    f"{2.0 * self.spacing:g} m or more, or less spacing"
                )
        if self.pipeline is not None and not self._is_crossed_by(self.pipeline):
            raise ValueError(f"pipeline: it passes the generated floor of {self.extent:g} m; move it, or the center")
        return self

    def _is_crossed_by(self, pipe: PipelineSettings) -> bool:
        """Whether a pipeline lies on the floor: corners are on both sides of it."""
        heading, half = math.radians(pipe.heading_deg), 0.5 * self.extent
        north, east = self.center[0] - pipe.north, self.center[1] - pipe.east
        across = math.cos(heading) * east - math.sin(heading) * north
        return abs(across) < half * (abs(math.cos(heading)) + abs(math.sin(heading)))


@lru_cache(maxsize=4)
def make(settings: SeabedSettings, sea_floor: float) -> GriddedFloor:
    """The sea floor of settings around a mean depth [m].

    Raises:
        InputError: it would rise out of the water.
    """
    count = round(settings.extent / settings.spacing) + 1
    axis = np.asarray(settings.spacing * (np.arange(count) - 0.5 * (count - 1)), dtype=np.float64)
    heights = settings.roughness * fractal(
        count, settings.spacing, settings.exponent, settings.longest, stream(settings.seed, 0, "seabed/roughness")
    )
    direction = math.radians(settings.ripple_direction_deg)
    along = math.cos(direction) * axis[:, None] + math.sin(direction) * axis[None, :]
    heights += 0.5 * settings.ripple_height * np.cos(2.0 * math.pi / settings.ripple_length * along)
    strength = np.ones((count, count), dtype=np.float32)
    _lay_pipeline(settings, axis, heights, strength)
    _place_rocks(settings, axis, heights, strength, stream(settings.seed, 0, "seabed/rocks"))
    _place_debris(settings, axis, heights, strength, stream(settings.seed, 0, "seabed/debris"))
    depths = sea_floor - heights
    if depths.min() < 0.5:
        raise InputError(
            f"terrain: the generated floor rises to {depths.min():.1f} m; make sea_floor ({sea_floor:g} m) deeper or "
            "roughness less"
        )
    north, east = settings.center
    corner = Corner(north + float(axis[0]), east + float(axis[0]), settings.spacing, settings.spacing)
    return GriddedFloor(corner, depths, strength)


def fractal(count: int, spacing: float, exponent: float, longest: float, generator: Generator) -> Array:
    """A Gaussian field (count, count) of unit variance, whose spectrum falls as wave number ** -exponent.

    It is drawn on twice its size and cut, since the transform's field repeats.

    Args:
        count: points along a side.
        spacing: between them [m].
        exponent: of the two-dimensional spectrum.
        longest: wave; the spectrum is flat for longer ones [m].
        generator: of its phases and amplitudes.
    """
    size = 1 << (2 * count - 1).bit_length() - 1 if count > 1 else 2
    size = max(size, count)
    k = 2.0 * math.pi * np.fft.fftfreq(size, spacing)
    number = np.hypot(k[:, None], k[None, : size // 2 + 1])
    floor = 2.0 * math.pi / longest
    amplitude = np.maximum(number, floor) ** (-0.5 * exponent)
    amplitude[0, 0] = 0.0
    white = np.fft.rfft2(generator.standard_normal((size, size)))
    field = np.fft.irfft2(white * amplitude[:, : white.shape[1]], s=(size, size))
    weights = np.full(white.shape[1], 2.0)
    weights[0] = weights[-1] = 1.0 if size % 2 == 0 else 2.0
    weights[0] = 1.0
    deviation = math.sqrt(float((amplitude[:, : white.shape[1]] ** 2 * weights).sum())) / size
    return field[:count, :count] / deviation


def _lay_pipeline(settings: SeabedSettings, axis: Array, heights: Array, strength: np.ndarray) -> None:
    pipe = settings.pipeline
    if pipe is None:
        return
    heading = math.radians(pipe.heading_deg)
    north, east = axis + settings.center[0] - pipe.north, axis + settings.center[1] - pipe.east
    across = math.cos(heading) * east[None, :] - math.sin(heading) * north[:, None]
    radius = 0.5 * pipe.diameter
    on = np.abs(across) < radius
    # It lies on the floor's own profile; its upper half is all that a height field can show.
    top = radius + np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    heights[on] += top[on]
    strength[on] = PIPE_ECHO


def _scattered(
    density: float, size: float, settings: SeabedSettings, axis: Array, generator: Generator
) -> tuple[Array, Array]:
    """Places (n, 2) of so many things a square metre, and their log-normal sizes (n,) about a median [m]."""
    count = generator.poisson(density * settings.extent**2)
    places = generator.uniform(axis[0], axis[-1], (count, 2))
    return places, size * np.exp(0.4 * generator.standard_normal(count))


def _place_rocks(
    settings: SeabedSettings, axis: Array, heights: Array, strength: np.ndarray, generator: Generator
) -> None:
    """Half-buried spheres."""
    places, radii = _scattered(settings.rocks, settings.rock_radius, settings, axis, generator)
    for (north, east), radius in zip(places.tolist(), radii.tolist(), strict=True):
        i0, i1 = np.searchsorted(axis, (north - radius, north + radius))
        j0, j1 = np.searchsorted(axis, (east - radius, east + radius))
        square = (axis[i0:i1, None] - north) ** 2 + (axis[None, j0:j1] - east) ** 2
        rise = np.sqrt(np.maximum(radius**2 - square, 0.0))
        on = rise > 0.0
        heights[i0:i1, j0:j1] += rise
        strength[i0:i1, j0:j1][on] = ROCK_ECHO


def _place_debris(
    settings: SeabedSettings, axis: Array, heights: Array, strength: np.ndarray, generator: Generator
) -> None:
    """Boxes on the floor as it is there, each turned its own way."""
    places, lengths = _scattered(settings.debris, settings.debris_length, settings, axis, generator)
    turns = generator.uniform(0.0, math.pi, len(places))
    for (north, east), length, turn in zip(places.tolist(), lengths.tolist(), turns.tolist(), strict=True):
        half = 0.5 * length
        i0, i1 = np.searchsorted(axis, (north - half, north + half))
        j0, j1 = np.searchsorted(axis, (east - half, east + half))
        n, e = axis[i0:i1, None] - north, axis[None, j0:j1] - east
        along, across = n * math.cos(turn) + e * math.sin(turn), e * math.cos(turn) - n * math.sin(turn)
        on = (np.abs(along) < half) & (np.abs(across) < length / 6.0)
        heights[i0:i1, j0:j1][on] += 0.25 * length
        strength[i0:i1, j0:j1][on] = DEBRIS_ECHO
