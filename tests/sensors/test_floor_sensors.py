"""Altimeter, GPS and inertial unit: geometry in closed form, statistics of their errors, what they lose and when."""

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation
from scipy.stats import binom
from surroundings import Around

from auvsim.base.frames import euler_to_quaternion
from auvsim.base.randomness import stream
from auvsim.physics.truth import Truth
from auvsim.sensors.altimeter import Altimeter, AltimeterSettings
from auvsim.sensors.floor_rays import slant_range
from auvsim.sensors.gps import Gps, GpsSettings
from auvsim.sensors.imu import Imu, ImuSettings
from auvsim.water.seabed import SeabedSettings
from auvsim.water.terrain import SlopedFloor, build_terrain
from auvsim.water.terrain_grid import GriddedFloor

SLOPE = SlopedFloor(20.0, 0.2, -0.1)
EXACT: dict[str, Any] = {"noise": 0.0, "scale_error": 0.0, "dropout_probability": 0.0}


def truth(time=7.0, position=(3.0, -4.0, 12.0), attitude=(0.1, -0.2, 2.3), nu=(1.4, -0.1, 0.05, 0.0, 0.0, 0.0)):
    return Truth(
        time=time, position=np.array(position), quaternion=euler_to_quaternion(*attitude),
        attitude=np.array(attitude), nu=np.array(nu), current=np.zeros(3), actuators=np.zeros(5),
    )  # fmt: skip


def altimeter(trial=0, **settings):
    return Altimeter(AltimeterSettings(**settings), stream(5, trial, "auv/altimeter"))


def test_a_ray_meets_a_plane_where_geometry_says() -> None:
    """Place and direction lopsided; the plane 20 + 0.2 n - 0.1 e - d = 0 in closed form."""
    place, direction = np.array((3.0, -4.0, 12.0)), np.array((0.3, -0.5, 0.8)) / math.sqrt(0.98)
    below = 20.0 + 0.6 + 0.4 - 12.0
    exact = below / (direction @ (-0.2, 0.1, 1.0))
    assert slant_range(SLOPE, place, direction) == pytest.approx(exact, abs=2e-3)
    assert slant_range(SLOPE, place, np.array((1.0, 0.0, 0.0))) == math.inf
    assert slant_range(SLOPE, place + np.array((0.0, 0.0, 30.0)), direction) == math.inf  # under the floor


def test_a_ray_ends_on_a_rough_floor() -> None:
    """Where a ray over a generated floor settles, its end is on it to the millimetres of the search."""
    floor = build_terrain(SeabedSettings(extent=40.0, spacing=0.25), 20.0)
    assert isinstance(floor, GriddedFloor)
    rng, found = np.random.default_rng(2), 0
    for _ in range(200):
        place = np.array((*rng.uniform(-10.0, 10.0, 2), 14.0))
        direction = Rotation.from_euler("ZY", rng.uniform(-0.5, 0.5, 2)).apply((0.0, 0.0, 1.0))
        distance = slant_range(floor, place, direction)
        if distance < math.inf:
            found += 1
            end = place + distance * direction
            assert floor.depth(end[0], end[1]) == pytest.approx(end[2], abs=2e-3)
    assert found >= 190


def test_a_narrow_altimeter_measures_along_the_hulls_axis() -> None:
    axis = Rotation.from_euler("ZYX", (2.3, -0.2, 0.1)).apply((0.0, 0.0, 1.0))
    exact = (20.0 + 0.6 + 0.4 - 12.0) / (axis @ (-0.2, 0.1, 1.0))
    reading = altimeter(beam_deg=0.0, **EXACT).measure(truth(), Around(terrain=SLOPE))
    assert reading is not None
    assert reading.value[0] == pytest.approx(exact, abs=2e-3)


def test_a_wide_one_hears_the_nearest_echo_first() -> None:
    """Over a plane it lies between that square to the plane, 12.6 deg off the axis, and the axis' own."""
    level = truth(attitude=(0.0, 0.0, 0.0))
    narrow, wide = (altimeter(beam_deg=b, **EXACT).measure(level, Around(terrain=SLOPE)) for b in (0.0, 40.0))
    below, slope = 9.0, math.hypot(0.2, 0.1)
    assert narrow is not None
    assert wide is not None
    assert narrow.value[0] == pytest.approx(below, abs=2e-3)
    perpendicular = below / math.hypot(1.0, slope)
    assert perpendicular <= wide.value[0] < perpendicular + 0.5 * (below - perpendicular)


def test_errors_of_an_altimeter() -> None:
    """2000 readings: noise to 4 of its 1.6 %; the scale of 300 trials to 4 of 4 %; losses inside their interval."""
    level, world = truth(attitude=(0.0, 0.0, 0.0)), Around(terrain=SLOPE)
    one = altimeter(noise=0.05, scale_error=0.0, dropout_probability=0.2)
    heard = [r.value[0] for r in (one.measure(level, world) for _ in range(2000)) if r is not None]
    low, high = binom.ppf([1e-5, 1 - 1e-5], 2000, 0.8)
    assert low <= len(heard) <= high
    assert np.std(heard) == pytest.approx(0.05, rel=4 * 0.018)
    scales = [altimeter(trial, scale_error=0.02).scale for trial in range(300)]
    assert np.std(scales) == pytest.approx(0.02, rel=4 * 0.041)
    out = altimeter(**EXACT, maximum_range=8.0)
    assert out.measure(level, world) is None


def gps(trial=0, **settings):
    return Gps(GpsSettings(**settings), stream(5, trial, "auv/gps"))


def test_gps_waits_for_its_first_fix_and_is_silent_under_water() -> None:
    """Dry from 0 s: fixes from 30 s on; under water none; surfaced again from 2 s on."""
    receiver, world, heard = gps(), Around(), []
    for time in range(120):
        depth = 5.0 if 60 <= time < 90 else 0.2
        reading = receiver.measure(truth(float(time), (3.0, -4.0, depth), (0.0, 0.0, 0.3)), world)
        heard += [time] if reading is not None else []
    assert heard == [*range(30, 60), *range(92, 120)]


def test_an_antenna_is_where_it_is_on_the_hull() -> None:
    """0.5 m above the origin and 2 m aft: pitched up by 0.2 rad it is 0.09 m deep at a depth of 0.18 m."""

    def heard(pitch: float) -> bool:
        receiver = gps(first_fix=0.0, antenna=(-2.0, 0.0, -0.5))
        return receiver.measure(truth(0.0, (0.0, 0.0, 0.18), (0.0, pitch, 1.0)), Around()) is not None

    assert heard(0.0)
    assert not heard(0.2)


def test_errors_of_gps_are_white_and_slow() -> None:
    """Over trials the first reading errs by both parts; from one second to the next only the white part is new."""
    at = truth(0.0, (3.0, -4.0, 0.1), (0.0, 0.0, 0.3))
    settings: dict[str, Any] = {"first_fix": 0.0, "noise": 0.5, "wander": 3.0, "wander_time": 50.0}
    pairs = []
    for trial in range(400):
        receiver = gps(trial, **settings)
        two = [receiver.measure(at, Around()) for _ in range(2)]
        pairs.append([r.value - (3.0, -4.0) for r in two if r is not None])
    first, second = np.array(pairs).transpose(1, 0, 2)
    assert first.std(axis=0) == pytest.approx([math.hypot(0.5, 3.0)] * 2, rel=4 * 0.036)
    moved = math.sqrt(2.0 * 0.25 + 2.0 * 9.0 * (1.0 - math.exp(-1.0 / 50.0)))
    assert (second - first).std(axis=0) == pytest.approx([moved] * 2, rel=4 * 0.036)


def test_exact_increments_are_the_true_motion() -> None:
    """A turn, dive and roll with a changing velocity: readings summed by an independent integration give its end."""
    exact: dict[str, Any] = dict.fromkeys(ImuSettings.model_fields, 0.0) | {"enabled": True, "rate": 10.0}
    unit, dt = Imu(ImuSettings(**exact), stream(1, 0, "imu")), 0.1

    def at(k: int) -> Truth:
        t = k * dt
        return truth(t, attitude=(0.2 * math.sin(t), 0.1 * t - 0.2, 0.6 + 0.3 * t), nu=(
            1.5 + 0.2 * t, 0.1 * math.sin(2.0 * t), -0.2 * t, 0.0, 0.0, 0.0
        ))  # fmt: skip

    assert unit.measure(at(0), Around()) is None
    turned = Rotation.from_euler("ZYX", at(0).attitude[::-1])
    velocity = turned.apply(at(0).nu[:3])
    for k in range(1, 31):
        reading = unit.measure(at(k), Around())
        assert reading is not None
        rates, forces = reading.value[:3], reading.value[3:]
        middle = turned * Rotation.from_rotvec(0.5 * dt * rates)
        velocity = velocity + dt * (middle.apply(forces) + np.array((0.0, 0.0, 9.80665)))
        turned = turned * Rotation.from_rotvec(dt * rates)
    end = Rotation.from_euler("ZYX", at(30).attitude[::-1])
    assert (turned.inv() * end).magnitude() < 1e-12
    np.testing.assert_allclose(velocity, end.apply(at(30).nu[:3]), atol=1e-12)


def test_at_rest_it_feels_its_weight() -> None:
    """Pitched up by 0.3 rad: the specific force is -g along the vertical, g sin(pitch) ahead."""
    exact: dict[str, Any] = dict.fromkeys(ImuSettings.model_fields, 0.0) | {"enabled": True, "rate": 10.0}
    unit = Imu(ImuSettings(**exact), stream(1, 0, "imu"))
    for time in (0.0, 0.1):
        reading = unit.measure(truth(time, attitude=(0.0, 0.3, 1.0), nu=(0.0,) * 6), Around())
    assert reading is not None
    force = 9.80665 * np.array((math.sin(0.3), 0.0, -math.cos(0.3)))
    np.testing.assert_allclose(reading.value, (0.0, 0.0, 0.0, *force), atol=1e-12)


def test_errors_of_an_inertial_unit() -> None:
    """Over 300 trials of 20 s: scale, bias at the start, and the walk of the bias, each sd to 4 of its 4 %."""
    settings = ImuSettings(
        gyro_noise_density_deg=0.0, gyro_bias_deg=0.4, gyro_bias_walk_deg=0.3, noise_density=0.02, bias=0.0,
        bias_walk=0.0, scale_error=0.05,
    )  # fmt: skip
    starts, walked, scales, white = [], [], [], []
    for trial in range(300):
        unit = Imu(settings, stream(3, trial, "imu"))
        starts.append(unit.bias[2])
        scales.append(unit.scale[5])
        values = [unit.measure(truth(0.1 * k, attitude=(0.0, 0.0, 0.0)), Around()) for k in range(21)]
        walked.append(unit.bias[2] - starts[-1])
        white += [r.value[5] + 9.80665 * unit.scale[5] for r in values if r is not None]
    assert np.std(starts) == pytest.approx(math.radians(0.4), rel=4 * 0.041)
    assert np.std(walked) == pytest.approx(math.radians(0.3) * math.sqrt(2.1), rel=4 * 0.041)
    assert np.std(scales) == pytest.approx(0.05, rel=4 * 0.041)
    assert np.std(white) == pytest.approx(0.02 * math.sqrt(10.0), rel=4 * 0.01)


@pytest.mark.parametrize(
    ("made", "data", "text"),
    [
        (AltimeterSettings, {"maximum_range": 0.2}, "must be more than minimum_range, 0.3 m"),
        (AltimeterSettings, {"beam_deg": 90.0}, "less than or equal to 60"),
        (GpsSettings, {"noise": 0.0}, "greater than 0"),
        (ImuSettings, {"scale_error": 0.5}, "less than or equal to 0.1"),
    ],
)
def test_bad_settings_of_floor_sensors_are_refused(made: Any, data: dict, text: str) -> None:
    with pytest.raises(ValidationError, match=text):
        made(**data)
