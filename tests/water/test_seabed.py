"""The generated sea floor: its spectrum, its seed, and what lies on it."""

import math

import numpy as np
import pytest
from scipy import ndimage

from auvsim.base.errors import InputError
from auvsim.physics.scenery import MOST_POINTS
from auvsim.physics.scenes import WorldSettings, scene
from auvsim.physics.world import World
from auvsim.water import seabed
from auvsim.water.currents import Uniform
from auvsim.water.seabed import PipelineSettings, SeabedSettings
from auvsim.water.terrain_grid import GriddedFloor


def test_variance_and_spectrum_of_the_fractal() -> None:
    """Unit variance over many floors, and a spectrum that falls as the wave number to the power asked for."""
    fields = [seabed.fractal(256, 0.5, 3.0, 16.0, np.random.default_rng(k)) for k in range(12)]
    # Twelve fields of some 60 independent patches each: 3 standard errors of their variance are about 0.16.
    assert np.mean([field.var() for field in fields]) == pytest.approx(1.0, abs=0.16)
    window = np.hanning(256)
    spectrum = np.mean([np.abs(np.fft.fft2(f * np.outer(window, window))) ** 2 for f in fields], axis=0)
    k = 2.0 * math.pi * np.fft.fftfreq(256, 0.5)
    number = np.hypot(k[:, None], k[None, :])
    on = (number > 1.0) & (number < 4.0)
    slope = np.polyfit(np.log(number[on]), np.log(spectrum[on]), 1)[0]
    assert slope == pytest.approx(-3.0, abs=0.1)


def test_same_seed_same_floor() -> None:
    """Bit for bit; another seed makes another; rocks do not change the roughness."""
    one, same, other, bare = (
        seabed.make(SeabedSettings(extent=40.0, seed=seed, rocks=rocks), 20.0)
        for seed, rocks in ((1, 0.05), (1, 0.05), (2, 0.05), (1, 0.0))
    )
    np.testing.assert_array_equal(one.depths, same.depths)
    assert np.abs(one.depths - other.depths).max() > 0.1
    sand = one.strength == 1.0
    assert 0.5 < sand.mean() < 1.0
    np.testing.assert_array_equal(one.depths[sand], bare.depths[sand])


def test_pipeline_and_ripples() -> None:
    """A pipe rises by its diameter along its line, elsewhere the floor is level; ripples have their height."""
    flat = {"roughness": 0.0, "rocks": 0.0, "extent": 40.0, "spacing": 0.1}
    pipe = PipelineSettings(north=3.0, east=0.0, heading_deg=30.0, diameter=0.6)
    floor = seabed.make(SeabedSettings(**flat, pipeline=pipe), 20.0)
    for t in (-8.0, 0.0, 5.0):
        n, e = 3.0 + t * math.cos(math.pi / 6.0), t * math.sin(math.pi / 6.0)
        assert floor.depth(n, e) == pytest.approx(19.4, abs=0.05)  # points stand 0.1 m apart
        assert floor.depth(n + 0.5, e - 0.87) == pytest.approx(20.0)  # 1 m to port
    rippled = seabed.make(SeabedSettings(**flat, ripple_height=0.2, ripple_length=2.0, ripple_direction_deg=90.0), 20.0)
    assert np.ptp(rippled.depths) == pytest.approx(0.2, rel=1e-3)
    np.testing.assert_allclose(rippled.depths[0], rippled.depths[-1])


def test_debris_lies_on_the_floor_as_boxes() -> None:
    """As many as asked for (Poisson), of their length and a third of it; the floor below stays, and so do rocks."""
    settings = {"extent": 200.0, "spacing": 0.1, "roughness": 0.0, "rocks": 0.0}
    bare = seabed.make(SeabedSettings(**settings), 20.0)
    assert np.ptp(bare.depths) == 0.0
    floor = seabed.make(SeabedSettings(**settings, debris=0.01, debris_length=1.2), 20.0)
    boxes, count = ndimage.label(floor.strength == seabed.DEBRIS_ECHO)
    # 400 boxes, sd 20; of them some 400^2 / 2 * 2 m2 / 40000 m2 = 4 pairs touch.
    assert count == pytest.approx(396, abs=4 * 20)
    areas = np.bincount(boxes.ravel())[1:] * 0.01
    # Of a log-normal length, the mean of its square: 1.2^2 exp(2 * 0.4^2) / 3, sd of a mean of 400 some 4 %.
    assert areas.mean() == pytest.approx(1.2**2 * math.exp(2.0 * 0.4**2) / 3.0, rel=0.16)
    single = max(range(1, count + 1), key=lambda k: -abs(areas[k - 1] - np.median(areas)))
    n, e = np.nonzero(boxes == single)
    spread = np.sqrt(np.linalg.eigvalsh(np.cov(0.1 * np.array([n, e]))) * 12.0)  # sides of an even box
    assert spread[1] / spread[0] == pytest.approx(3.0, rel=0.3)
    assert 20.0 - floor.depths[n[0], e[0]] == pytest.approx(0.25 * spread[1], rel=0.15)
    assert (floor.depths[floor.strength == 1.0] == 20.0).all()
    rough = {"extent": 60.0, "rocks": 0.05}
    one, other = (seabed.make(SeabedSettings(**rough, debris=density), 20.0) for density in (0.0, 0.02))
    same = other.strength != seabed.DEBRIS_ECHO
    np.testing.assert_array_equal(one.depths[same], other.depths[same])


def test_a_vehicle_that_sinks_touches_the_floor_that_the_sonar_sees() -> None:
    """Pushed down over roughness and ripples: contacts are where the fine floor is, to what coarse cells miss."""
    made = SeabedSettings(
        extent=200.0, spacing=0.2, roughness=0.5, rocks=0.0, longest=30.0, ripple_height=0.3, ripple_length=8.0, seed=4
    )
    settings = WorldSettings(terrain=made, sea_floor=20.0)
    floor = settings.floor
    assert isinstance(floor, GriddedFloor)
    coarse = floor.coarse(MOST_POINTS)
    assert coarse.depths.shape[0] < floor.depths.shape[0] / 3
    world = World(scene({"auv": "remus100"}, {}, settings, 100.0), Uniform((0.0, 0.0, 0.0)), settings.water_density)
    for north, east, heading in ((13.0, -22.0, 0.4), (-51.0, 40.0, 2.0)):
        world.reset()
        world.place("auv", np.array([north, east, floor.depth(north, east) - 1.2]), heading, 0.0, [0.0] * 5)
        body = world.model.body("auv/hull").id
        while not world.contacts("auv"):
            world.data.xfrc_applied[body, 2] = -30.0
            world.advance(1)
            assert world.time < 20.0
        assert {contact.other for contact in world.contacts("auv")} == {"sea_floor"}
        assert len(world.data.contact.pos)
        for point in world.data.contact.pos:
            n, e, down = point[0], -point[1], -point[2]
            places = [(n + a, e + b) for a in np.arange(-0.8, 0.9, 0.2) for b in np.arange(-0.8, 0.9, 0.2)]
            missed = max(abs(floor.depth(*place) - coarse.depth(*place)) for place in places)
            assert missed < 0.2
            # Besides: a cell's two triangles for the bilinear surface, and how far a contact goes in within a step.
            assert down == pytest.approx(floor.depth(n, e), abs=missed + 0.02)


def test_coarse_floor_lies_on_the_fine_one() -> None:
    """What MuJoCo touches are points of the floor itself, edge to edge."""
    floor = seabed.make(SeabedSettings(extent=100.0, spacing=0.25), 20.0)
    coarse = floor.coarse(51)
    assert coarse.depths.shape == (51, 51)
    for i, j in ((0, 0), (50, 50), (7, 31)):
        n, e = coarse.corner.north + i * coarse.corner.to_north, coarse.corner.east + j * coarse.corner.to_east
        assert coarse.depths[i, j] == pytest.approx(floor.depth(n, e), abs=1e-9)


def test_what_cannot_be_is_refused() -> None:
    """A floor out of the water, and one of too many points, each with what would be right."""
    with pytest.raises(InputError, match="generated floor rises to"):
        seabed.make(SeabedSettings(extent=40.0, roughness=8.0), 5.0)
    with pytest.raises(ValueError, match=r"give a spacing of 1\.2 m or more"):
        SeabedSettings(extent=5000.0, spacing=0.1)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"rocks": 1.0, "extent": 1000.0, "spacing": 0.5}, r"rocks: .* at most 200000: give 0\.2 or less"),
        ({"longest": 0.4, "spacing": 0.25}, r"longest: 0\.4 m is too short .* give 0\.5 m or more"),
        ({"ripple_height": 0.1, "ripple_length": 0.4}, r"ripple_length: 0\.4 m is too short"),
        ({"pipeline": PipelineSettings(north=129.0)}, "pipeline: it passes the generated floor of 256 m"),
        ({"pipeline": PipelineSettings(north=182.0, heading_deg=135.0)}, None),
        ({"pipeline": PipelineSettings(north=260.0, heading_deg=135.0)}, "pipeline"),
        ({"pipeline": PipelineSettings(north=129.0), "center": (2.0, 0.0)}, None),
        ({"ripple_length": 0.4}, None),
        ({"roughness": 0.0, "longest": 0.4}, None),
    ],
)
def test_what_no_grid_can_show_is_refused(settings: dict, says: str | None) -> None:
    """Waves shorter than two points, a pipeline beside the floor, too many rocks; what is absent may be short."""
    if says is None:
        SeabedSettings(**settings)
        return
    with pytest.raises(ValueError, match=says):
        SeabedSettings(**settings)
