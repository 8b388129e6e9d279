"""The bound of matches over a floor: gains in closed form, places, strips, the planned way, and matches of frames."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import truth

from auvsim.analysis import floor_bound as module
from auvsim.analysis.floor_bound import Gains, Sight, floor_bound, frame_gains, sight
from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.navigation import registry
from auvsim.sensors.imaging_sonar import ImagingSonar, ImagingSonarSettings
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.sensor_settings import on_board
from auvsim.simulation.setups import navigator_setup
from auvsim.vehicles import library
from auvsim.water.terrain import build_terrain
from auvsim.water.terrain_grid import Corner, GriddedFloor
from estimators.map_path.frames import SectorGrid
from estimators.map_path.matching import Search, match
from estimators.map_path.poses import between, compose

GRID = SectorGrid(cell=0.4, shape=(25, 50), ranges=(2.0, 10.0), half_sector=1.0, ahead=0.8)
SIGHT = Sight(grid=GRID, gains=Gains(slope=4.0, strength=1.1), overlap=0.6, apart=3.0, altitude=4.0, surroundings=1.0)
CORNER = Corner(-30.0, 12.0, 0.2, 0.25)


def sonar(**settings: Any) -> ImagingSonar:
    """Wide in elevation, without noise to speak of."""
    values = {"snr": 300.0, "elevation_deg": 90.0, "depression_deg": 30.0, "maximum_range": 30.0, **settings}
    return ImagingSonar(ImagingSonarSettings(**values), np.random.default_rng(0))


def rough(rows: int, columns: int, seed: int = 1) -> Array:
    """Depths that are rough in the north-east only."""
    depth = np.full((rows, columns), 20.0)
    relief = np.random.default_rng(seed).normal(scale=0.02, size=depth.shape)
    is_rough = np.logical_and.outer(np.arange(rows) > 0.6 * rows, np.arange(columns) > 0.6 * columns)
    return depth + np.where(is_rough, relief, 0.0)


def test_gains_are_those_of_lamberts_law_and_speckle() -> None:
    """One sample a cell: deviation pi / root 6 of its logarithm; ln sin^2 of the grazing angle changes by 2 r / h."""
    altitude = 4.0
    found = frame_gains(sonar(beams=16, bins=60), GRID, altitude)  # samples of 0.5 m by 8 deg, more than cells
    level = np.hypot(*(GRID.centres[GRID.seen] - (0.8, 0.0)).T)
    beyond = np.abs(np.arctan2(altitude, level) - math.radians(30.0)) > 1.2 * math.radians(90.0)
    assert not beyond.any()
    deviation = math.pi / math.sqrt(6.0)
    assert found.strength == pytest.approx(1.0 / deviation, rel=1e-6)
    assert found.slope == pytest.approx(float(np.sqrt(np.mean((2.0 * level / altitude) ** 2))) / deviation, rel=1e-6)


def test_more_samples_and_less_noise_show_more() -> None:
    """Four bins for one halve the deviation in the end; where echoes equal the noise half of a change is seen."""
    few, many = (frame_gains(sonar(beams=1024, bins=n, beam_width_deg=0.2), GRID, 4.0) for n in (400, 1600))
    # N = cell^2 / (bin * slant * 0.2 deg) is 60 at 10 m, where trigamma(N) is 1 / N to 1 %
    assert many.strength / few.strength == pytest.approx(2.0, rel=0.01)
    loud = frame_gains(sonar(), GRID, 4.0)
    assert frame_gains(sonar(snr=10.0), GRID, 4.0).slope < loud.slope
    deaf = frame_gains(sonar(maximum_range=5.0), GRID, 6.0)
    assert deaf.slope == deaf.strength == 0.0


def test_matching_holds_where_it_is_rough() -> None:
    """In the north-east, with its coordinates; elsewhere nothing tells, and the depth is the floor's."""
    floor = GriddedFloor(CORNER, rough(400, 300))
    north, east, bound, depth = module._over(floor, SIGHT, 2.0)
    assert (north[0], east[0]) == (-30.0, 12.0)
    assert (north[1] - north[0], east[1] - east[0]) == pytest.approx((2.0, 2.0))
    assert (north[-1], east[-1]) == pytest.approx((48.0, 86.0), abs=2.0)
    assert np.isfinite(bound[(north > 35.0)][:, east > 72.0]).all()
    assert np.isinf(bound[(north < 5.0)][:, east < 45.0]).all()
    np.testing.assert_allclose(depth, 20.0, atol=0.1)


def test_strips_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """A floor that is worked on in parts is that in one, also where its backscatter tells."""
    rng = np.random.default_rng(6)
    strength = np.exp(0.3 * rng.normal(size=(600, 160))).astype(np.float32)
    floor = GriddedFloor(CORNER, 20.0 + 0.05 * rng.normal(size=strength.shape), strength)
    whole = module._over(floor, SIGHT, 1.0)
    monkeypatch.setattr(module, "STRIP", 4000)
    parts = module._over(floor, SIGHT, 1.0)
    np.testing.assert_array_equal(parts[0], whole[0])
    # Gaussians are cut at four deviations, and the mean over a sector reaches as far as the margin
    np.testing.assert_allclose(parts[2], whole[2], rtol=1e-6)
    np.testing.assert_allclose(parts[3], whole[3])
    assert np.isfinite(whole[2]).all()
    plain = module._over(replace_strength(floor), SIGHT, 1.0)
    assert (plain[2] > whole[2]).all()


def replace_strength(floor: GriddedFloor) -> GriddedFloor:
    """The same relief of sand only."""
    return replace(floor, strength=None)


def test_the_planned_way_is_told_metre_by_metre() -> None:
    """The bound at the nearest point of the map; NaN off it."""
    north, east = np.arange(0.0, 10.0, 2.0), np.arange(5.0, 11.0, 2.0)
    bound = np.add.outer(10.0 * np.arange(5), np.arange(3))
    at = module.stations(np.array([(0.0, 5.0), (8.0, 5.0), (8.0, 30.0)]))
    np.testing.assert_allclose(at[[3, 10]], [(3.0, 5.0), (8.0, 7.0)])
    found = module._along(at, north, east, bound)
    np.testing.assert_array_equal(found[[0, 2, 4, 8, 10, 12]], [0.0, 10.0, 20.0, 40.0, 41.0, 42.0])
    assert len(found) == 33
    assert np.isnan(found[14:]).all()
    assert not len(module.stations(np.empty((0, 2))))


def test_what_cannot_be_judged_is_refused() -> None:
    """In one line that says what would be right."""
    scenario = load_scenario("survey")
    with pytest.raises(InputError, match="kind flat shows nothing to match; give a grid"):
        floor_bound(load_scenario("survey", water={"terrain": {"kind": "flat"}}))
    with pytest.raises(InputError, match="hears no floor"):
        sight(scenario, 30.0)
    reckoning = {"remus100": {"estimator": {"kind": "dead_reckoning"}}}
    with pytest.raises(InputError, match="a dead_reckoning matches no frames; give kind sonar"):
        sight(load_scenario("survey", vehicles=reckoning), 5.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "terrain", [{"rocks": 0.05}, {"rocks": 0.0}, {"rocks": 0.01, "roughness": 0.1}], ids=lambda t: str([*t.values()])
)
def test_matches_of_ray_cast_frames_scatter_as_the_bound_says(terrain: dict[str, float]) -> None:
    """Over 80 pairs 6 m apart, the heading known: between 0.7 and 2 times the bound's median.

    Scatter is by the median of absolute values along each axis, since some matches take a wrong peak. The bound is of
    first order and of white noise; a match by a filter that is not the signal's own loses up to that.
    """
    scenario = load_scenario("survey", water={"terrain": terrain})
    found, (name, vehicle) = floor_bound(scenario), scenario.lone
    navigator: Any = registry.build(navigator_setup(scenario, name, library.vehicle(vehicle.model)))
    own: Any = dict(on_board(vehicle.sensors))["sonar"]
    own, rng = ImagingSonar(own, np.random.default_rng(1)), np.random.default_rng(40)
    world: Any = SimpleNamespace(
        terrain=build_terrain(scenario.water.terrain, scenario.water.sea_floor), rays=lambda *_: None
    )
    depth = scenario.water.sea_floor - found.sight.altitude

    def frame(pose: Array) -> Any:
        image = own.image(truth(0.0, (pose[0], pose[1], depth), (0.0, 0.0, pose[2]), (0.0, 0.0, 0.0)), world)
        made = navigator._frames.frame(image, altitude=found.sight.altitude, stamp=0.0)
        return navigator._matcher.prepare(made.intensity)

    offsets, bounds = [], []
    for _ in range(80):
        first = np.array([*rng.uniform(-60.0, 110.0, 2), rng.uniform(-math.pi, math.pi)])
        second = compose(first, np.array([found.sight.apart, 0.0, 0.0]))
        prior = np.diag([0.09, 0.09, 1e-8])
        matched = match(
            navigator._matcher, frame(second), [frame(first)], between(first, second)[None], prior, Search()
        )
        if not isinstance(matched, str):
            offsets.append(matched.offset[:2])
            place = (np.abs(axis - at).argmin() for axis, at in zip((found.north, found.east), first, strict=False))
            bounds.append(found.bound[tuple(place)])
    off = np.array(offsets) - np.median(offsets, axis=0)
    scatter = 1.4826 * np.median(np.abs(off), axis=0)
    assert len(off) > 60
    assert (scatter > 0.7 * np.median(bounds)).all(), scatter / np.median(bounds)
    assert (scatter < 2.0 * np.median(bounds)).all(), scatter / np.median(bounds)
