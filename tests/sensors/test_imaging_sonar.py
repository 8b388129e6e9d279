"""The imaging sonar against closed forms: level of a floor, shadows, ranges of walls and spheres, speckle, ghosts."""

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats
from surroundings import Around

from auvsim.base.frames import euler_to_quaternion
from auvsim.physics.truth import Truth
from auvsim.sensors.imaging_sonar import ImagingSonar, ImagingSonarSettings, absorption
from auvsim.water.terrain import FlatFloor
from auvsim.water.terrain_grid import Corner, GriddedFloor

WIDE = {"elevation_deg": 90.0, "depression_deg": 20.0, "ghost": 0.0, "snr": 200.0, "speckle": False, "gain": 0.0}


def at(north: float, east: float, depth: float, heading: float = 0.0, pitch: float = 0.0) -> Truth:
    """A vehicle at rest."""
    return Truth(
        time=0.0, position=np.array([north, east, depth]), quaternion=euler_to_quaternion(0.0, pitch, heading),
        attitude=np.array([0.0, pitch, heading]), nu=np.zeros(6), current=np.zeros(3), actuators=np.zeros(3),
    )  # fmt: skip


def sonar(seed: int = 1, **settings: Any) -> ImagingSonar:
    """A sonar of the body's origin."""
    return ImagingSonar(ImagingSonarSettings(**settings), np.random.default_rng(seed))


def floor(height: Any, spacing: float = 0.05, north: float = 40.0, east: float = 20.0, level: float = 20.0) -> Around:
    """A floor of heights above a level, as a function of north and east, over -2..north and -east..east."""
    n, e = np.arange(-2.0, north, spacing), np.arange(-east, east, spacing)
    rise = height(n[:, None], e[None, :]) * np.ones((len(n), len(e)))
    return Around(terrain=GriddedFloor(Corner(-2.0, -east, spacing, spacing), level - rise))


def test_level_floor_by_lambert() -> None:
    """Each bin has sin^2(grazing) times the ring's area by range^4, with the beam's pattern and absorption."""
    one = sonar(**WIDE, bins=100, maximum_range=25.0, beams=64)
    mean = one.mean(at(0.0, 0.0, 15.0), Around(terrain=FlatFloor(20.0)))[32]
    R = one.ranges
    seen = R > 5.5
    below = np.arcsin(5.0 / R[seen])
    high, axis = math.radians(90.0), math.radians(20.0)
    pattern = np.exp(-8.0 * math.log(2.0) * ((below - axis) / high) ** 2)
    spacing = float(one.bearings[1] - one.bearings[0])
    # Of a ring on the floor, s ds = R dR.
    expected = np.sin(below) ** 2 * R[seen] * one.width * spacing * pattern / R[seen] ** 4
    expected *= np.exp(-2.0 * absorption(750.0) * R[seen])
    # The walk takes each step's middle for the whole of it: bins differ by up to 6 %, and sum up to 1.5 %.
    far = R[seen] > 8.0
    np.testing.assert_allclose(mean[seen][far][:-1], expected[far][:-1], rtol=0.06)
    assert mean[seen].sum() == pytest.approx(expected.sum(), rel=0.015)
    assert not mean[R < 4.5].any()


def test_shadow_behind_a_wall() -> None:
    """A wall 2 m high at 10 m from 5 m above the floor hides it until 10 * 5 / 3 m, and echoes in its own range."""
    world = floor(lambda n, e: np.where((n >= 10.0) & (n < 10.3), 2.0, 0.0))
    one = sonar(**WIDE, bins=300, maximum_range=30.0, beams=65)
    mean = one.mean(at(0.0, 0.0, 15.0), world)[32]
    end = math.hypot(10.3 * 5.0 / 3.0, 5.0)  # behind its far upper edge
    wall = math.hypot(10.0, 3.0), math.hypot(10.0, 5.0)
    hidden = (one.ranges > wall[1] + 0.3) & (one.ranges < end - 0.3)
    assert mean[hidden].max() < 1e-3 * mean[one.ranges > end + 0.3].max()
    assert mean[(one.ranges > end + 0.2) & (one.ranges < end + 1.0)].min() > 0.0
    bright = float(one.ranges[np.argmax(mean * one.ranges**3 * (one.ranges > 9.5))])
    assert wall[0] - one.width < bright < wall[1] + one.width


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_where_a_rock_is_seen(heading: float) -> None:
    """A half sphere to starboard shows first at the range of its nearest side, in the beam of its bearing."""
    bearing, distance, radius = 0.35, 9.0, 0.8
    n, e = distance * math.cos(heading + bearing), distance * math.sin(heading + bearing)
    grid = np.arange(-12.0, 12.0, 0.05)
    square = (grid[:, None] - n) ** 2 + (grid[None, :] - e) ** 2
    rise = np.sqrt(np.maximum(radius**2 - square, 0.0))
    strength = np.where(rise > 0.0, 50.0, 1.0).astype(np.float32)
    world = Around(terrain=GriddedFloor(Corner(-12.0, -12.0, 0.05, 0.05), 20.0 - rise, strength))
    one = sonar(**WIDE, bins=400, maximum_range=15.0, beams=121, beam_width_deg=1.0)
    mean = one.mean(at(0.0, 0.0, 17.0, heading), world)
    echo = (mean * one.ranges**3).sum(axis=1)
    assert one.bearings[np.argmax(echo)] == pytest.approx(bearing, abs=math.asin(radius / distance))
    beam = mean[int(np.argmin(np.abs(one.bearings - bearing)))] * one.ranges**3
    first = float(one.ranges[np.flatnonzero(beam > 5.0 * np.median(beam[beam > 0.0]))[0]])
    nearest = math.hypot(distance, 3.0) - radius  # on the line to its middle
    assert first == pytest.approx(nearest, abs=3.0 * one.width + 0.05)


def test_the_bow_points_where_the_pitch_says() -> None:
    """A narrow beam whose axis is 10 degrees below the hull meets the floor nearer when the bow points down."""
    brightest = []
    for pitch in (0.0, -0.15):
        one = sonar(**WIDE | {"elevation_deg": 3.0, "depression_deg": 12.0}, bins=400, maximum_range=40.0, beams=9)
        mean = one.mean(at(0.0, 0.0, 16.0, 0.0, pitch), Around(terrain=FlatFloor(20.0)))[4]
        brightest.append(float(one.ranges[np.argmax(mean * one.ranges**3)]))
    expected = [4.0 / math.sin(math.radians(12.0) + turn) for turn in (0.0, 0.15)]
    assert brightest == pytest.approx(expected, rel=0.05)  # the pattern's slope against Lambert's law moves the peak


class WithSphere(Around):
    """A world with one sphere in it, by its closed form."""

    def rays(self, place: Any, directions: Any, reach: float) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Nearest of the two roots, and the cosine at the sphere."""
        middle, radius = np.array([8.0, -2.0, 15.0]), 1.0
        along = directions @ (middle - place)
        miss = np.sum((middle - place) ** 2) - along**2
        half = np.sqrt(np.maximum(radius**2 - miss, 0.0))
        met = (miss < radius**2) & (along > 0.0)
        return np.where(met, along - half, np.inf), np.where(met, half / radius, 0.0)


def test_objects_echo_and_hide_the_floor() -> None:
    """A sphere in mid water shows at its nearest range in its own beams, and hides the floor behind it."""
    world = WithSphere(terrain=FlatFloor(20.0))
    one = sonar(**WIDE | {"elevation_deg": 40.0}, bins=400, maximum_range=30.0, beams=121)
    place = at(0.0, 0.0, 12.5)
    mean = one.mean(place, world).copy()
    open_floor = one.mean(place, Around(terrain=FlatFloor(20.0))).copy()
    beam = int(np.argmin(np.abs(one.bearings - math.atan2(-2.0, 8.0))))
    nearest = math.sqrt(8.0**2 + 2.0**2 + 2.5**2) - 1.0
    found = np.flatnonzero((mean - open_floor)[beam] > 0.0)
    assert float(one.ranges[found[0]]) == pytest.approx(nearest, abs=one.width + 0.05)
    below = math.atan2(2.5, math.hypot(8.0, 2.0))
    behind = int(np.argmin(np.abs(one.ranges - 7.5 / math.sin(below))))
    assert mean[beam, behind] < 0.1 * open_floor[beam, behind]
    np.testing.assert_array_equal(mean[100], open_floor[100])


def test_second_path_by_the_surface() -> None:
    """Half of the way out and half of the longer way back by the surface: the strongest echo comes again, weaker."""
    world = floor(lambda n, e: np.where((n >= 12.0) & (n < 12.2), 1.5, 0.0), level=9.0)
    one = sonar(**WIDE | {"ghost": 0.1}, bins=400, maximum_range=25.0, beams=9)
    place = at(0.0, 0.0, 4.0)
    both = one.mean(place, world)[4].copy()
    direct = sonar(**WIDE, bins=400, maximum_range=25.0, beams=9).mean(place, world)[4]
    ghost = both - direct
    k = int(np.argmax(direct * one.ranges**3 * (one.ranges > 11.0)))
    s = math.sqrt(one.ranges[k] ** 2 - 4.25**2)  # the middle of the wall
    expected = 0.5 * (float(one.ranges[k]) + math.hypot(s, 4.0 + 8.25))
    late = float(one.ranges[np.argmax(ghost)])
    assert late == pytest.approx(expected, abs=0.3)  # the wall is 1.5 m high
    assert ghost.sum() == pytest.approx(0.1 * direct.sum(), rel=0.35)


def test_speckle_is_exponential_and_new_in_each_frame() -> None:
    """Intensity by its mean follows the exponential law (Kolmogorov-Smirnov), and two pings are independent."""
    one = sonar(5, beams=128, bins=200, snr=10.0)
    world, place = Around(terrain=FlatFloor(20.0)), at(0.0, 0.0, 15.0)
    first, second = one.image(place, world).copy(), one.image(place, world).copy()
    expected = (one.mean(place, world) + one.noise) * (one.ranges**3.0 * np.exp(2.0 * one.absorption * one.ranges))
    a, b = (frame / expected for frame in (first, second))
    assert stats.kstest(a.ravel(), "expon").pvalue > 0.01
    assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 4.0 / math.sqrt(a.size)
    again = sonar(5, beams=128, bins=200, snr=10.0)
    np.testing.assert_array_equal(again.image(place, world), first)


def test_snr_is_that_of_the_settings() -> None:
    """Level sand half the range away from 5 m above it stands 12 dB over the noise in the beam's axis."""
    axis = math.degrees(math.asin(0.5))
    one = sonar(snr=12.0, maximum_range=20.0, depression_deg=axis, ghost=0.0, speckle=False, bins=400)
    mean = one.mean(at(0.0, 0.0, 15.0), Around(terrain=FlatFloor(20.0)))[64]
    k = int(np.argmin(np.abs(one.ranges - 10.0)))
    assert 10.0 * math.log10(mean[k - 3 : k + 4].mean() / one.noise) == pytest.approx(12.0, abs=0.2)


@pytest.mark.parametrize("key", ["snr", "nose"])
@pytest.mark.parametrize("value", [-1e5, 1e5])
def test_what_no_instrument_has_is_refused(key: str, value: float) -> None:
    """An echo beyond what numbers hold, a transducer far from the vehicle."""
    with pytest.raises(ValueError, match=key):
        ImagingSonarSettings(**{key: value})


def test_absorption_at_100_kilohertz() -> None:
    """Sea water of 10 degrees takes some 35 dB of a kilometre (Francois and Garrison 1982, fig. 5: 34)."""
    assert 10.0 / math.log(10.0) * 1000.0 * absorption(100.0) == pytest.approx(34.0, abs=2.0)
