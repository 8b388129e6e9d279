"""Where a sonar's frames can be matched over a floor, before a mission: the bound of one match about each place.

Echoes change with the floor's slope along the line of sight (Lambert's law, to first order) and with its backscatter;
speckle and the receiver's noise hide that. Frames are those of the estimator `sonar`: logarithms of intensities on
cells, without the mean of their surroundings. What speckle leaves of the logarithm of a mean over N samples has the
variance trigamma(N).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import polygamma

from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.missions.track.patterns import points
from auvsim.navigation import registry
from auvsim.navigation.measurements import of_kind
from auvsim.navigation.sonar import POINT_SPREAD, SonarNavigator
from auvsim.sensors.imaging_sonar import ImagingSonar, ImagingSonarSettings
from auvsim.sensors.sonar_echo import BESIDE
from auvsim.simulation.scenario import Scenario
from auvsim.simulation.sensor_settings import on_board
from auvsim.simulation.setups import navigator_setup
from auvsim.vehicles import library
from auvsim.water.terrain import build_terrain
from auvsim.water.terrain_grid import GriddedFloor
from estimators.map_path.bound_map import height_information, image_information, match_bound
from estimators.map_path.frames import SectorGrid

STRIP = 1_000_000  # points of the floor that are worked on at once
COARSE = 2.5  # distance of a floor's points by the side of a frame's cell from which on finer relief is missed
STEP = 1.0  # between points of the planned way at which the bound is told [m]


class Gains(NamedTuple):
    """Change of a frame's cell, by the standard deviation of its noise; rms over the cells that are seen."""

    slope: float  # for a slope of 1 along the line of sight
    strength: float  # for backscatter e times as strong


class Sight(NamedTuple):
    """What looks at the floor."""

    grid: SectorGrid
    gains: Gains
    overlap: float  # share of its cells that a frame has in common with the one that it is matched with
    apart: float  # way from one to the other [m]
    altitude: float  # [m]
    surroundings: float  # standard deviation of the Gaussian whose mean is taken out of frames [m]


class FloorBound(NamedTuple):
    """The bound of one match over a floor."""

    north: Array  # (m,) [m]
    east: Array  # (n,) [m]
    bound: Array  # (m, n) least standard deviation of a match along its worst axis [m]; infinite where nothing tells
    depth: Array  # (m, n) of the floor [m]
    way: Array  # (k, 2) planned points, north, east [m]
    stations: Array  # (j, 2) of the planned way, every metre, north, east [m]
    along: Array  # (j,) bound there [m]; NaN off the floor
    sight: Sight
    resolution: float  # between points of the floor [m]

    @property
    def coarse(self) -> bool:
        """Whether the floor lacks most of the relief that frames show, so that the bound is too large."""
        return self.resolution > COARSE * self.sight.grid.cell


def floor_bound(scenario: Scenario, *, spacing: float = 1.0, altitude: float | None = None) -> FloorBound:
    """The bound over the floor of a scenario with one vehicle that navigates by a sonar.

    Args:
        scenario: whose floor, sonar, altitude and planned way are taken.
        spacing: between points of the map [m].
        altitude: above the floor; by default that of the mission [m].

    Raises:
        InputError: the floor is level, plane or not as wide as `spacing`, or there is no such vehicle.
    """
    name, vehicle = scenario.lone
    floor = build_terrain(scenario.water.terrain, scenario.water.sea_floor)
    if not isinstance(floor, GriddedFloor):
        raise InputError(
            f"water.terrain: a floor of kind {scenario.water.terrain.kind} shows nothing to match; give a grid"
        )
    own = getattr(vehicle.mission, "altitude", None) if altitude is None else altitude
    if own is None:
        raise InputError(f"vehicles.{name}.mission: a {vehicle.mission.kind} keeps no altitude; give --altitude")
    seen = sight(scenario, float(own))
    north, east, bound, depth = _over(floor, seen, spacing)
    pattern = getattr(vehicle.mission, "pattern", None)
    way = points(pattern) if pattern is not None and pattern.kind in ("waypoints", "lawn_mower") else np.empty((0, 2))
    at = stations(way)
    resolution = max(floor.corner.to_north, floor.corner.to_east)
    return FloorBound(north, east, bound, depth, way, at, _along(at, north, east, bound), seen, resolution)


def sight(scenario: Scenario, altitude: float) -> Sight:
    """How the lone vehicle of a scenario looks at the floor from an altitude [m].

    Raises:
        InputError: it does not navigate by a sonar, or that hears no floor from there.
    """
    name, vehicle = scenario.lone
    navigator = registry.build(navigator_setup(scenario, name, library.vehicle(vehicle.model)))
    if not isinstance(navigator, SonarNavigator):
        raise InputError(f"vehicles.{name}.estimator: a {vehicle.estimator.kind} matches no frames; give kind sonar")
    ((_, settings),) = of_kind(dict(on_board(vehicle.sensors)), ImagingSonarSettings).items()
    gains = frame_gains(ImagingSonar(settings, np.random.default_rng(0)), navigator.grid, altitude)
    if gains.slope <= 0.0:
        raise InputError(f"altitude {altitude:g} m: the sonar, with ranges to {settings.maximum_range:g} m, hears no "
                         "floor from there")  # fmt: skip
    apart = float(getattr(vehicle.mission, "speed", 1.0)) * vehicle.estimator.stride / settings.rate  # pyright: ignore
    grid = navigator.grid
    overlap = float(grid.holds(grid.centres[grid.seen] + (apart, 0.0)).mean())
    return Sight(grid, gains, max(overlap, 0.01), apart, altitude, navigator._frames.surroundings)


def frame_gains(sonar: ImagingSonar, grid: SectorGrid, altitude: float) -> Gains:
    """How a frame's cells answer to slope and backscatter of a floor that is level on the whole.

    Args:
        sonar: that takes the frames.
        grid: on which they are laid.
        altitude: of the sonar above the floor [m].
    """
    s = sonar.settings
    level = np.hypot(*(grid.centres[grid.seen] - (grid.ahead, 0.0)).T)
    slant = np.hypot(level, altitude)
    high, spacing = math.radians(s.elevation_deg), float(sonar.bearings[1] - sonar.bearings[0])
    below = np.arctan2(altitude, level) - math.radians(s.depression_deg)
    beam = np.where(np.abs(below) < BESIDE * high, np.exp(-8.0 * math.log(2.0) * (below / high) ** 2), 0.0)
    echo = beam * np.array([sonar.level_echo(distance, altitude) for distance in slant.tolist()])
    echo[(slant < sonar.ranges[0]) | (slant > sonar.ranges[-1])] = 0.0
    share = echo / (echo + sonar.noise)
    # A sample covers one bin and one beam, or its width where beams overlap; a cell takes one at least.
    wide = max(spacing, math.radians(s.beam_width_deg))
    samples = np.maximum(grid.cell**2 / (sonar.width * slant * wide), 1.0)
    deviation = np.sqrt(polygamma(1, samples))
    strength = share / deviation
    slope = 2.0 * level / altitude * strength  # of the logarithm of the grazing angle's squared sine
    return Gains(float(np.sqrt(np.mean(slope**2))), float(np.sqrt(np.mean(strength**2))))


def _over(floor: GriddedFloor, seen: Sight, spacing: float) -> tuple[Array, Array, Array, Array]:
    """North (m,), east (n,), bound and depth (m, n) over a floor, strip by strip."""
    cell = max(0.5 * (floor.corner.to_north + floor.corner.to_east), seen.grid.cell)
    rows, columns = (
        max(2, 1 + math.floor((count - 1) * step / cell + 1e-9))
        for count, step in zip(floor.depths.shape, (floor.corner.to_north, floor.corner.to_east), strict=True)
    )
    every = max(1, round(spacing / cell))
    if every >= min(rows, columns):
        sides = " x ".join(f"{cell * (count - 1):.4g}" for count in (rows, columns))
        raise InputError(f"spacing {spacing:g} m: a floor of {sides} m has one point only; give less")
    margin = math.ceil(
        (0.5 * math.sqrt(np.count_nonzero(seen.grid.seen)) * seen.grid.cell + 5.0 * seen.surroundings) / cell
    )
    height = max(every, STRIP // columns // every * every)
    bounds, depths = [], []
    for start in range(0, rows, height):
        low, high = max(0, start - margin), min(rows, start + height + margin)
        depth, strength = _sampled(floor, cell, slice(low, high), columns)
        part = slice(start - low, min(start + height, rows) - low, every)
        bounds.append(_bound(depth, strength, cell, seen)[part, ::every])
        depths.append(depth[part, ::every])
    north: Array = floor.corner.north + cell * np.arange(0.0, rows, every)
    east: Array = floor.corner.east + cell * np.arange(0.0, columns, every)
    return north, east, np.concatenate(bounds), np.concatenate(depths)


def _sampled(floor: GriddedFloor, cell: float, rows: slice, columns: int) -> tuple[Array, Array | None]:
    """Depths of some rows of a grid of square cells over the floor, and backscatter, None where it is one everywhere.

    Where the floor's points are closer together than cells, each cell has the mean about its middle.
    """
    from scipy.ndimage import map_coordinates, uniform_filter

    steps = floor.corner.to_north, floor.corner.to_east
    at = np.arange(rows.start, rows.stop) * cell / steps[0], np.arange(columns) * cell / steps[1]
    first = max(0, math.floor(at[0][0]) - 8)
    last = min(floor.depths.shape[0], math.ceil(at[0][-1]) + 9)
    places = np.stack(np.meshgrid(at[0] - first, at[1], indexing="ij"))
    sizes: Any = [max(1, round(cell / step)) for step in steps]
    found: list[Any] = []
    for values in (floor.depths, None if floor.strength is None else np.log(floor.strength)):
        if values is None:
            found.append(None)
            continue
        own = np.asarray(values[first:last], dtype=float)
        own = uniform_filter(own, sizes, mode="nearest") if max(sizes) > 1 else own
        found.append(map_coordinates(own, places, order=1, mode="nearest"))
    return found[0], found[1]


def _bound(depth: Array, strength: Array | None, cell: float, seen: Sight) -> Array:
    """The bound (m, n) of depths (m, n) and logarithms of backscatter, whose broad variation frames do not show."""
    width = seen.surroundings / cell
    information = height_information(depth - gaussian_filter(depth, width), cell, POINT_SPREAD, seen.gains.slope)
    if strength is not None:
        detail = seen.gains.strength * (strength - gaussian_filter(strength, width))
        information = information + image_information(detail, cell, POINT_SPREAD)
    return match_bound(information, cell, seen.grid, 1.0, seen.overlap)


def stations(way: Array) -> Array:
    """Places (j, 2) every metre along a way (k, 2) of north, east [m]."""
    if len(way) < 2:
        return np.empty((0, 2))
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))))
    at = np.arange(0.0, lengths[-1], STEP)
    return np.column_stack([np.interp(at, lengths, way[:, k]) for k in range(2)])


def _along(places: Array, north: Array, east: Array, bound: Array) -> Array:
    """The bound (j,) at the points of the map nearest to places (j, 2); NaN off the map."""
    found = np.full(len(places), math.nan)
    rows, columns = (
        np.rint((places[:, k] - axis[0]) / (axis[1] - axis[0])).astype(int) for k, axis in enumerate((north, east))
    )
    on = (rows >= 0) & (rows < len(north)) & (columns >= 0) & (columns < len(east))
    found[on] = bound[rows[on], columns[on]]
    return found
