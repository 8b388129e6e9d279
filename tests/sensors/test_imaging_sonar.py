"""The imaging sonar against closed forms: level of a floor, shadows, ranges of walls and spheres, speckle, ghosts."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy import stats
from surroundings import Around

from auvsim.base.frames import euler_to_quaternion
from auvsim.physics import rays
from auvsim.physics.truth import Truth
from auvsim.sensors import sonar_array
from auvsim.sensors.imaging_sonar import ImagingSonar, ImagingSonarSettings, absorption
from auvsim.water.terrain import FlatFloor
from auvsim.water.terrain_grid import Corner, GriddedFloor

WIDE: dict[str, Any] = {
    "elevation_deg": 90.0,
    "depression_deg": 20.0,
    "ghost": 0.0,
    "snr": 200.0,
    "speckle": False,
    "gain": 0.0,
}


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


def test_range_and_shadow_of_a_wall_to_a_bin() -> None:
    """A wall 2 m high at 10 m from 5 m above the floor: where it begins, where it ends, and what it hides."""
    n, e = np.arange(-2.0, 40.0, 0.05), np.arange(-20.0, 20.0, 0.05)
    on = ((n > 9.98) & (n < 10.28))[:, None] * np.ones(len(e), dtype=bool)
    world = Around(
        terrain=GriddedFloor(Corner(-2.0, -20.0, 0.05, 0.05), 20.0 - 2.0 * on, np.where(on, 1e3, 1.0).astype("f4"))
    )
    one = sonar(**WIDE, bins=290, maximum_range=30.0, beams=65)
    bare = one.mean(at(0.0, 0.0, 15.0), Around(terrain=FlatFloor(20.0)))[32].copy()
    beam = one.mean(at(0.0, 0.0, 15.0), world)[32]
    bright = one.ranges[beam > 5.0 * bare]
    assert bright[0] == pytest.approx(math.hypot(10.0, 3.0), abs=one.width)  # its upper edge
    assert bright[-1] == pytest.approx(math.hypot(9.975, 5.0), abs=one.width)  # its foot
    dark = one.ranges[(beam < 0.01 * bare) & (one.ranges > 10.0)]
    assert dark[0] == pytest.approx(math.hypot(9.975, 5.0), abs=1.5 * one.width)  # the bin after that of the foot
    assert dark[-1] == pytest.approx(math.hypot(10.275 * 5.0 / 3.0, 5.0), abs=one.width)
    assert len(dark) * one.width == pytest.approx(dark[-1] - dark[0] + one.width)  # nothing between


class Drawn(Around):
    """A world with what an MJCF text has, met by MuJoCo's rays."""

    def holding(self, geoms: str) -> "Drawn":
        """The same with geoms that are drawn as structures are."""
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        object.__setattr__(self, "_scene", (model, data))
        return self

    def rays(self, place: Any, directions: Any, reach: float) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        """As of the world."""
        return rays.cast(*self._scene, place, directions, reach)  # pyright: ignore


def test_range_and_shadow_of_a_sphere_on_the_floor_to_a_bin() -> None:
    """By rays against MuJoCo's geom, off the bow: its nearest side, the shadow between two tangents."""
    radius, distance, bearing, height = 0.7, 10.0, -0.3, 5.0
    n, e = 1.0 + distance * math.cos(0.8 + bearing), 2.0 + distance * math.sin(0.8 + bearing)
    ball = f'<geom type="sphere" group="1" size="{radius}" pos="{n} {-e} {radius - 20.0}"/>'
    world = Drawn(terrain=FlatFloor(20.0)).holding(ball)
    one = sonar(**WIDE, bins=240, maximum_range=25.0, beams=121, beam_width_deg=1.0)
    place = at(1.0, 2.0, 20.0 - height, heading=0.8)
    bare = one.mean(place, Around(terrain=FlatFloor(20.0))).copy()
    mean = one.mean(place, world).copy()
    beam = int(np.argmin(np.abs(one.bearings - bearing)))
    middle, down = math.hypot(distance, height - radius), math.atan2(height - radius, distance)
    shown = one.ranges[mean[beam] > 1.2 * bare[beam]]
    assert shown[0] == pytest.approx(middle - radius, abs=one.width)
    dark = one.ranges[(mean[beam] < 0.5 * bare[beam])]
    over = height / math.sin(down - math.asin(radius / middle))
    under = height / math.sin(down + math.asin(radius / middle))  # the tangent below it ends before its foot
    assert dark[0] == pytest.approx(under, abs=one.width)
    assert dark[-1] == pytest.approx(over, abs=one.width)
    assert len(dark) * one.width == pytest.approx(dark[-1] - dark[0] + one.width)
    aside = np.abs(one.bearings - bearing) > math.asin(radius / distance) + math.radians(6.0)
    np.testing.assert_array_equal(mean[aside], bare[aside])


def test_a_wall_by_rays_hides_what_is_behind_it() -> None:
    """A box from the floor up to the sonar's depth: one range, no floor behind it, and no ball behind it either."""
    wall = '<geom type="box" group="1" size="0.1 6 2.6" pos="9.1 0 -17.5"/>'
    ball = '<geom type="sphere" group="1" size="0.5" pos="14 0 -17"/>'
    one = sonar(**WIDE, bins=240, maximum_range=25.0, beams=61)
    place = at(0.0, 0.0, 15.0)
    mean = one.mean(place, Drawn(terrain=FlatFloor(20.0)).holding(wall)).copy()
    both = one.mean(place, Drawn(terrain=FlatFloor(20.0)).holding(wall + ball))
    np.testing.assert_array_equal(both, mean)
    heard = one.ranges[mean[30] > 1e-3 * mean[30].max()]
    assert one.ranges[np.argmax(mean[30])] == pytest.approx(9.0, abs=one.width)
    assert heard[-1] == pytest.approx(math.hypot(9.0, 5.0), abs=2.0 * one.width)  # the floor at its foot


def test_a_hill_hides_what_is_behind_it() -> None:
    """Of a pole behind a ridge only what stands above the line over the ridge is seen, and nothing of a low one."""
    world = Drawn(terrain=floor(lambda n, e: np.where((n >= 8.0) & (n < 9.0), 2.5, 0.0)).terrain)
    one = sonar(**WIDE, bins=240, maximum_range=25.0, beams=61)
    echoes = []
    for top in (1.0, 5.0):  # of a pole at 14 m; over the ridge's far edge, 2.5 m below, the line is 3.9 m down there
        pole = f'<geom type="box" group="1" size="0.2 0.2 {top / 2}" pos="14.2 0 {-20.0 + top / 2}"/>'
        mean = one.mean(at(0.0, 0.0, 15.0), world.holding(pole))[30]
        echoes.append(mean[np.abs(one.ranges - 14.3) < 0.5].sum())
    assert echoes[0] == 0.0
    assert echoes[1] > 0.0


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


def test_an_object_has_a_second_path_too() -> None:
    """A ball in mid water, far above the floor: a tenth of its echo comes again by half the way by the surface."""
    world = Drawn(terrain=FlatFloor(500.0)).holding('<geom type="sphere" group="1" size="0.3" pos="9 0 -7"/>')
    place = at(0.0, 0.0, 4.0)
    found = [
        sonar(**WIDE | {"ghost": g}, bins=200, maximum_range=25.0, beams=61).mean(place, world) for g in (0.0, 0.1)
    ]
    direct, ghost = found[0][30], (found[1] - found[0])[30]
    assert ghost.sum() == pytest.approx(0.1 * direct.sum(), rel=1e-6)
    R = sonar(**WIDE, bins=200, maximum_range=25.0, beams=61).ranges
    near, far = (math.hypot(9.0, z) - 0.3 for z in (3.0, 11.0))
    assert R[np.flatnonzero(ghost)[0]] == pytest.approx(0.5 * (near + far), abs=0.3)  # other points of the ball


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


def test_beams_of_an_array_are_as_wide_as_its_elements_make_them() -> None:
    """Half power 1.44 lengths' inverse off a lone echo, 1 / cos(bearing) wider off the axis; nothing is lost."""
    one = sonar(beams=801, elements=48, **WIDE)
    assert one._response is not None
    power = one._response**2
    np.testing.assert_allclose(power.sum(axis=1), 1.0)
    for bearing in (0.0, -0.7):
        beam = power[int(np.argmin(np.abs(one.bearings - bearing)))]
        half = one.bearings[beam > 0.5 * beam.max()]
        width = sonar_array.beam_width(48) / math.cos(bearing)
        assert half[-1] - half[0] == pytest.approx(width, abs=2.5 * float(one.bearings[1] - one.bearings[0]))


def test_neighbouring_beams_of_an_array_share_speckle() -> None:
    """Each sample is exponential; of two beams, correlation is the square of their patterns' product (300 pings)."""
    one = sonar(7, beams=61, elements=16, snr=40.0, bins=60)
    world, place = Around(terrain=FlatFloor(20.0)), at(0.0, 0.0, 15.0)
    gain = one.ranges**3.0 * np.exp(2.0 * one.absorption * one.ranges)
    expected = (one.mean(place, world) + one.noise) * gain
    frames = np.array([one.image(place, world) for _ in range(300)]) / expected
    near, far = frames[:, 30, 30:], frames[:, 33, 30:]
    assert stats.kstest(near.ravel(), "expon").pvalue > 0.01
    assert one._response is not None
    inner = float(one._response[30] @ one._response[33])
    found = np.mean([np.corrcoef(near[:, k], far[:, k])[0, 1] for k in range(30)])
    assert 0.3 < inner**2 < 0.9
    assert found == pytest.approx(inner**2, abs=4.0 / math.sqrt(300 * 30))


def test_an_array_needs_beams_that_overlap() -> None:
    """128 elements make beams of 1.3 deg; 64 beams over 120 deg stand 1.9 deg apart."""
    with pytest.raises(ValueError, match=r"beams: 128 elements make beams of 1\.3 deg.* give 188 beams or more"):
        ImagingSonarSettings(elements=128, beams=64)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"maximum_range": 130.0}, "maximum_range: 130 m; oculus_m750d has 120 m or less"),
        ({"maximum_range": 5.0, "bins": 1200}, "bins: 0.00333333 m wide; oculus_m750d has 0.004 m or more"),
    ],
)
def test_what_an_instrument_cannot_do_is_refused(change: dict, says: str) -> None:
    """Beyond the range and the resolution of its data sheet."""
    with pytest.raises(ValueError, match=says):
        ImagingSonarSettings(preset="oculus_m750d", **change)


@pytest.mark.parametrize(("preset", "apart"), [("oculus_m750d", 0.25), ("blueview_m900", 0.18)])
def test_presets_are_those_of_the_data_sheets(preset: Any, apart: float) -> None:
    """Beams stand as far apart as the data sheet says, to the 6 % by which its own numbers contradict each other."""
    one = sonar(preset=preset)
    assert math.degrees(one.bearings[-1] - one.bearings[0]) == pytest.approx(130.0)
    assert math.degrees(one.bearings[1] - one.bearings[0]) == pytest.approx(apart, rel=0.06)
