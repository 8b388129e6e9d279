"""The Doppler log: geometry against an independent rotation, errors against their settings, what it loses and when."""

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2
from surroundings import Around

from auvsim.base.frames import euler_to_quaternion
from auvsim.base.randomness import stream
from auvsim.base.reading import Reading
from auvsim.physics.truth import Truth
from auvsim.sensors.dvl import Dvl, DvlSettings, beams, three_beams
from auvsim.water.currents import CurrentField, build_current
from auvsim.water.settings import ShearPoint, ShearSettings, UniformSettings
from auvsim.water.terrain import FlatFloor, SlopedFloor

EXACT: dict[str, Any] = {
    "bottom_noise": (0.0, 0.0, 0.0),
    "water_noise": (0.0, 0.0, 0.0),
    "scale_error": 0.0,
    "bias": 0.0,
    "misalignment_deg": 0.0,
    "dropout_probability": 0.0,
}
COUNT = 20_000
ATTITUDE, NU = (0.1, -0.2, 2.3), (1.4, -0.1, 0.05, 0.0, 0.0, 0.1)
WATER = UniformSettings(speed=0.4, direction_deg=70.0, down=0.02)


def field(settings: Any = WATER) -> CurrentField:
    """The current of some settings."""
    return build_current(settings, stream(0, 0, "current"), 100.0)


def truth(depth: float = 10.0, current: CurrentField | None = None, attitude: tuple = ATTITUDE) -> Truth:
    """A vehicle that pitches, rolls and turns at a depth."""
    position = np.array([3.0, -4.0, depth])
    return Truth(
        time=7.0,
        position=position,
        quaternion=euler_to_quaternion(*attitude),
        attitude=np.array(attitude),
        nu=np.array(NU),
        current=(current or field()).evaluate(7.0, position).velocity,
        actuators=np.array((0.0, 0.0, 0.0, 0.0, 100.0)),
    )


class Pinging(Dvl):
    """A Doppler log that knows where it is."""

    def __init__(self, settings: DvlSettings, generator: np.random.Generator, around: Around) -> None:
        super().__init__(settings, generator)
        self.around = around

    def measure(self, truth: Truth, world: Any = None) -> Reading:
        """A ping."""
        return super().measure(truth, self.around)


def log(trial: int = 0, *, floor: float = 40.0, current: CurrentField | None = None, **settings: Any) -> Pinging:
    """A Doppler log of a trial, over its floor in its water."""
    return Pinging(
        DvlSettings(**settings), stream(5, trial, "remus100/dvl"), Around(current or field(), FlatFloor(floor))
    )


def through_water(current: np.ndarray) -> np.ndarray:
    """Velocity through the water in the body's axes, by scipy's rotation."""
    return np.array(NU[:3]) - Rotation.from_euler("ZYX", ATTITUDE[::-1]).inv().apply(np.array(current))


def test_an_exact_log_measures_both_velocities() -> None:
    """Over ground as the truth has it, through the water by an independent rotation of the current."""
    reading = log(**EXACT).measure(truth())
    np.testing.assert_array_equal(reading.value[:3], NU[:3])
    np.testing.assert_allclose(reading.value[3:], through_water(truth().current), atol=1e-15)  # rounding
    assert (reading.sensor, reading.stamp, reading.received, reading.sequence) == ("dvl", 7.0, 7.0, 0)


def test_noise_is_white_on_each_axis_about_constant_errors() -> None:
    """Means and variances inside their intervals; no axis knows another or its own past."""
    dvl = log(dropout_probability=0.0)
    exact = log(**EXACT).measure(truth()).value
    values = np.array([dvl.measure(truth()).value for _ in range(COUNT)])
    turn = Rotation.from_euler("Z", dvl.misalignment).inv()
    mean = np.concatenate([dvl.scale * turn.apply(part) for part in (exact[:3], exact[3:])]) + dvl.biases
    sigma = np.array([0.01, 0.01, 0.004, 0.02, 0.02, 0.008])
    unit = (values - mean) / sigma
    low, high = chi2.ppf([1e-5, 1 - 1e-5], COUNT)  # each axis falsely refused once in 50 000
    squares = np.square(unit).sum(axis=0)
    assert ((low < squares) & (squares < high)).all()
    assert (np.abs(unit.mean(axis=0)) < 4.3 / math.sqrt(COUNT)).all()  # 4.3 deviations of a mean
    correlation = np.corrcoef(unit.T) - np.eye(6)
    assert np.abs(correlation).max() < 4.6 / math.sqrt(COUNT)  # 15 pairs
    past = (unit[1:] * unit[:-1]).mean(axis=0)
    assert (np.abs(past) < 4.3 / math.sqrt(COUNT)).all()


def test_constant_errors_vary_from_trial_to_trial_as_set() -> None:
    """Scale 0.2 %, mounting 0.3 deg, biases 2 mm/s, each with its spread over trials."""
    trials = [log(trial) for trial in range(1000)]
    for unit in (
        np.array([dvl.scale - 1.0 for dvl in trials]) / 0.002,
        np.degrees([dvl.misalignment for dvl in trials]) / 0.3,
        np.array([dvl.biases for dvl in trials]).ravel() / 0.002,
    ):
        low, high = chi2.ppf([1e-5, 1 - 1e-5], unit.size)
        assert low < np.square(unit).sum() < high


def test_misalignment_turns_what_is_measured_the_other_way() -> None:
    """A transducer turned to starboard sees a vehicle that goes straight ahead go to port."""
    dvl = log(**{**EXACT, "misalignment_deg": 5.0})
    value = dvl.measure(truth()).value
    for exact, measured in ((np.array(NU[:2]), value[:2]), (through_water(truth().current)[:2], value[3:5])):
        angle = math.atan2(measured[1], measured[0]) - math.atan2(exact[1], exact[0])
        assert angle == pytest.approx(-dvl.misalignment, abs=1e-12)  # rounding
        assert np.hypot(*measured) == pytest.approx(np.hypot(*exact), rel=1e-12)


def test_water_track_is_relative_to_the_layer_below() -> None:
    """In a sheared current it is the water in the layer's middle, not that round the vehicle, that counts."""
    points = (ShearPoint(depth=0.0, speed=0.5), ShearPoint(depth=20.0, speed=0.1))
    shear = field(ShearSettings(profile="linear", points=points))
    value = log(current=shear, **EXACT, water_layer=(4.0, 8.0)).measure(truth(current=shear)).value
    below = np.array([0.5 - 0.02 * 16.0, 0.0, 0.0])  # 10 m deep, layer 6 m below
    np.testing.assert_allclose(value[3:], through_water(below), atol=1e-15)


@pytest.mark.parametrize(
    ("altitude", "bottom", "water"),
    [
        (0.4, False, False),
        (0.6, True, False),
        (9.9, True, False),
        (10.1, True, True),
        (64.0, True, True),
        (66.0, False, True),
    ],
)
def test_limits_of_altitude(altitude: float, bottom: bool, water: bool) -> None:
    """Bottom from 0.5 to 65 m, hull level; water while the layer's far edge, 8 m, is within 80 % of the altitude."""
    value = log(floor=100.0, **EXACT).measure(truth(100.0 - altitude, attitude=(0.0, 0.0, 2.3))).value
    assert np.isfinite(value).tolist() == [bottom] * 3 + [water] * 3


@pytest.mark.parametrize(("roll", "bottom"), [(0.1, True), (0.25, True), (0.3, False), (-0.3, False)])
def test_tilt_lengthens_the_beams_of_one_side(roll: float, bottom: bool) -> None:
    """At 55 of 65 m: a beam 30 deg off the axis has 55 cos 30 / c m, c its downward part by scipy; two are too many."""
    turn = Rotation.from_euler("ZYX", (2.3, 0.0, roll))
    downward = turn.apply(beams(math.radians(30.0)))[:, 2]
    assert (55.0 * math.cos(math.radians(30.0)) / downward <= 65.0).sum() == (4 if bottom else 2)
    value = log(floor=100.0, **EXACT).measure(truth(45.0, attitude=(roll, 0.0, 2.3))).value
    assert np.isfinite(value[:3]).all() == bottom


def test_a_slope_takes_one_beam_and_its_noise_is_that_of_three() -> None:
    """Down a slope to the north-east one beam is too long; noise of least squares of the other three, by 20000 pings.

    The least squares are of three beams drawn one by one here, each with the noise that makes the settings' noise of
    all four.
    """
    noise, tilt = (0.01, 0.01, 0.01 * math.tan(math.radians(30.0)) / math.sqrt(2.0)), math.radians(30.0)
    dvl = log(**{**EXACT, "bottom_noise": noise}, maximum_altitude=12.0)
    dvl.around = Around(field(), SlopedFloor(20.0, 0.3, 0.1))
    level = truth(10.0, attitude=(0.0, 0.0, 0.0))
    values = np.array([dvl.measure(level).value[:3] for _ in range(COUNT)]) - NU[:3]
    below = 20.0 + 0.3 * 3.0 + 0.1 * -4.0 - 10.0
    lengths = np.array([below / (math.cos(tilt) - 0.3 * b[0] - 0.1 * b[1]) for b in beams(tilt)])
    seen = math.cos(tilt) * lengths <= 12.0
    assert sorted(seen) == [False, True, True, True]
    rest = beams(tilt)[seen]
    of_beam = 0.01 * math.sin(tilt) * math.sqrt(2.0)
    drawn = np.random.default_rng(3).normal(0.0, of_beam, (COUNT, 3)) @ np.linalg.pinv(rest).T
    np.testing.assert_allclose(np.cov(values.T), np.cov(drawn.T), rtol=0.1, atol=4e-6)
    assert values[:, 0].std() > 1.2 * noise[0]  # worse than of all four


def test_three_beams_err_as_their_least_squares() -> None:
    """Against the covariance of three beams, by whichever is lost; unit deviations are those of all four."""
    four = beams(0.6)
    units = np.sqrt(np.diagonal(np.linalg.inv(four.T @ four)))
    for lost in range(4):
        rest = np.delete(four, lost, axis=0)
        made = units[:, None] * three_beams(four, lost)
        np.testing.assert_allclose(made @ made.T, np.linalg.inv(rest.T @ rest), atol=1e-12)


def test_bottom_is_lost_more_often_high_above_it() -> None:
    """A share of 0.8 at the maximum, by the fourth power: 0.8 * 0.8^4 at 52 of 65 m, inside its binomial interval."""
    dvl = log(floor=100.0, **EXACT, dropout_at_maximum=0.8)
    lost = sum(math.isnan(dvl.measure(truth(48.0, attitude=(0.0, 0.0, 2.3))).value[0]) for _ in range(3000))
    low, high = binom.ppf([1e-5, 1 - 1e-5], 3000, 0.8 * 0.8**4)
    assert low <= lost <= high


def test_dropouts_come_as_often_as_set_on_each_track() -> None:
    """Each track whole or lost, by itself: counts inside their binomial intervals."""
    dvl = log(dropout_probability=0.2)
    lost = np.isnan([dvl.measure(truth()).value for _ in range(5000)])
    assert (lost[:, :3] == lost[:, :1]).all()
    assert (lost[:, 3:] == lost[:, 3:4]).all()
    for count, share in ((lost[:, 0].sum(), 0.2), (lost[:, 3].sum(), 0.2), ((lost[:, 0] & lost[:, 3]).sum(), 0.04)):
        low, high = binom.ppf([1e-5, 1 - 1e-5], 5000, share)
        assert low <= count <= high


def test_a_lost_reading_changes_no_other() -> None:
    """The same draws a reading, lost or not: what arrives is the same to the last bit."""
    whole, holed = log(dropout_probability=0.0), log(dropout_probability=0.5)
    for index in range(700):  # more than one block of draws
        first, second = whole.measure(truth()), holed.measure(truth())
        assert first.sequence == second.sequence == index
        kept = np.isfinite(second.value)
        np.testing.assert_array_equal(first.value[kept], second.value[kept])


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ({"bottom_noise": (0.1, -0.1, 0.1)}, "must be >= 0"),
        ({"maximum_altitude": 0.4}, "must be more than minimum_altitude, 0.5 m"),
        ({"water_layer": (8.0, 2.0)}, "near < far"),
        ({"dropout_probability": 1.1}, "less than or equal to 1"),
        ({"rate": 0.0}, "greater than 0"),
    ],
)
def test_bad_settings_are_refused(data: dict, text: str) -> None:
    """One line each."""
    with pytest.raises(ValidationError, match=text):
        DvlSettings(**data)
