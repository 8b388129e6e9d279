"""On-board sensors and the USBL: statistics against their settings, geometry against an independent rotation."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2, kstest
from surroundings import WATER

from auvsim.acoustics.motion import interpolate
from auvsim.acoustics.usbl import StructurePose, Usbl, UsblSettings
from auvsim.base.frames import euler_to_quaternion
from auvsim.base.randomness import stream
from auvsim.physics.truth import Truth
from auvsim.sensors.compass import Compass, CompassSettings
from auvsim.sensors.depth import Depth, DepthSettings
from auvsim.sensors.feedback import Feedback, FeedbackSettings
from estimators.docking.usbl import UsblModel

COUNT = 20_000
DEG = math.pi / 180.0
EXACT: dict[str, Any] = {
    "noise_scale": 0.0,
    "outlier_probability": 0.0,
    "dock_heading_bias_deg": 0.0,
    "dock_tilt_bias_deg": 0.0,
    "dock_depth_noise": 0.0,
    "dock_depth_bias": 0.0,
}
DOCK = StructurePose(depth=20.0, heading=0.7)


def truth(time=0.0, position=(0.0, 0.0, 10.0), attitude=(0.1, -0.2, 0.3), nu=(0.0,) * 6, fins=(0.1, -0.1), shaft=150.0):
    return Truth(
        time=time,
        position=np.array(position),
        quaternion=euler_to_quaternion(*attitude),
        attitude=np.array(attitude),
        nu=np.array(nu),
        current=np.zeros(3),
        actuators=np.array((*fins, shaft)),
    )


def source(trial=0, seed=11, name="remus100/sensor"):
    return stream(seed, trial, name)


def assert_sd(samples, sd, mean=0.0):
    """Mean and variance of normal samples inside their central 1 - 2e-5 intervals."""
    samples = np.asarray(samples) - mean
    count = len(samples)
    low, high = chi2.ppf([1e-5, 1 - 1e-5], count)
    assert low < np.sum(samples**2) / sd**2 < high
    assert abs(samples.mean()) < 4.3 * sd / math.sqrt(count)  # 4.3 sd: 2e-5


def assert_white(samples):
    samples = np.asarray(samples) - np.mean(samples)
    correlation = np.mean(samples[1:] * samples[:-1]) / np.mean(samples**2)
    assert abs(correlation) < 4.3 / math.sqrt(len(samples))  # sd 1/sqrt(n) if white


def test_compass_noise_is_white_about_a_constant_bias():
    compass = Compass(CompassSettings(), source())
    values = np.array([compass.measure(truth(), WATER).value for _ in range(COUNT)])
    assert_sd(values[:, 0], 1.0 * DEG, mean=0.3 + compass.heading_bias)
    assert_sd(values[:, 1], 0.5 * DEG, mean=-0.2)  # pitch stands second
    assert_sd(values[:, 2], 0.5 * DEG, mean=0.1)
    for column in values.T:
        assert_white(column)
    correlation = np.asarray(np.corrcoef(values.T))[np.triu_indices(3, 1)]
    assert np.all(np.abs(correlation) < 4.3 / math.sqrt(COUNT))  # sd 1/sqrt(n) if independent


def test_biases_vary_from_trial_to_trial_as_set():
    assert_sd([Compass(CompassSettings(), source(trial)).heading_bias for trial in range(1000)], 0.5 * DEG)
    assert_sd([Depth(DepthSettings(), source(trial)).bias for trial in range(1000)], 0.1)


def test_compass_heading_is_wrapped():
    compass = Compass(CompassSettings(), source())
    headings = [compass.measure(truth(attitude=(0.0, 0.0, math.pi)), WATER).value[0] for _ in range(200)]
    assert all(-math.pi < heading <= math.pi for heading in headings)
    assert min(headings) < -3.0 < 3.0 < max(headings)  # noise of 1 deg about +-180 deg shows on both sides


def test_depth_noise_is_white_about_a_constant_bias():
    depth = Depth(DepthSettings(), source())
    values = [float(depth.measure(truth(), WATER).value[0]) for _ in range(COUNT)]
    assert_sd(values, 0.05, mean=10.0 + depth.bias)
    assert_white(values)


def test_feedback_is_exact_by_default():
    reading = Feedback(FeedbackSettings(), source()).measure(truth(fins=(0.1, -0.2, 0.3, 0.0)), WATER)
    assert reading.value.tolist() == [0.1, -0.2, 0.3, 0.0, 150.0]


def test_feedback_noise():
    feedback = Feedback(FeedbackSettings(fin_noise_deg=0.2, shaft_noise_rpm=3.0), source())
    values = np.array([feedback.measure(truth(), WATER).value for _ in range(COUNT)])
    assert_sd(values[:, 0], 0.2 * DEG, mean=0.1)
    assert_sd(values[:, 1], 0.2 * DEG, mean=-0.1)
    assert_sd(values[:, 2], 3.0 * 2 * math.pi / 60, mean=150.0)


def test_feedback_rounds_to_the_encoder_step():
    feedback = Feedback(FeedbackSettings(fin_resolution_deg=1.0, shaft_resolution_rpm=60.0), source())
    value = feedback.measure(truth(fins=(2.4 * DEG, -2.6 * DEG), shaft=2 * math.pi * 3.4), WATER).value
    assert value == pytest.approx([2.0 * DEG, -3.0 * DEG, 2 * math.pi * 3.0], rel=1e-12)


@pytest.mark.parametrize(
    ("sensor", "settings"), [(Compass, CompassSettings), (Depth, DepthSettings), (Feedback, FeedbackSettings)]
)
def test_readings_carry_name_stamp_and_sequence_and_replay(sensor, settings):
    runs = []
    for _ in range(2):
        instance = sensor(settings(), source())
        runs.append([instance.measure(truth(time=0.1 * tick), WATER) for tick in range(700)])  # more than one block
    for index, (first, again) in enumerate(zip(*runs, strict=True)):
        assert first.sensor == sensor.kind
        assert first.stamp == first.received == 0.1 * index
        assert first.sequence == index
        assert np.array_equal(first.value, again.value)


def test_the_size_of_one_noise_changes_no_other_draw():
    loud, quiet = (Compass(CompassSettings(heading_noise_deg=sd, heading_bias_deg=0.0), source()) for sd in (5.0, 0.0))
    for _ in range(100):
        first, second = loud.measure(truth(), WATER).value, quiet.measure(truth(), WATER).value
        assert first[0] != second[0]
        assert np.array_equal(first[1:], second[1:])


def test_usbl_geometry_leads_back_to_the_vehicle():
    dock = StructurePose(depth=18.0, heading=2.0, pitch=0.05, roll=-0.08)
    settings = UsblSettings(**EXACT, transceiver=(0.3, -0.2, -1.0), transponder=(0.5, 0.1, -0.1))
    state: dict[str, Any] = {"position": (-35.0, 12.0, 14.0), "attitude": (0.2, -0.3, 1.9)}
    pings = Usbl(settings, source(), dock).poll(truth(0.0, **state), truth(50.0, **state))
    assert len(pings) >= 8  # 50 s at intervals below 6 s
    x_y_z, heading, pitch, roll, depth = np.split(pings[0].reading.value, [3, 4, 5, 6])
    assert [heading[0], pitch[0], roll[0], depth[0]] == pytest.approx([2.0, 0.05, -0.08, 18.0], abs=1e-15)
    to_ned = Rotation.from_euler("ZYX", [heading[0], pitch[0], roll[0]])
    vehicle = Rotation.from_euler("ZYX", state["attitude"][::-1])
    position = np.array([0, 0, depth[0]]) + to_ned.apply(np.array(settings.transceiver) + x_y_z)
    position -= vehicle.apply(settings.transponder)
    assert position == pytest.approx(state["position"], abs=1e-12)  # rounding of 50 m
    assert pings[0].slant_range == pytest.approx(np.linalg.norm(x_y_z), rel=1e-12)


def test_usbl_sees_ahead_of_an_east_facing_dock_what_lies_east_of_it():
    settings = UsblSettings(**EXACT, transceiver=(0, 0, 0), transponder=(0, 0, 0))
    state: dict[str, Any] = {"position": (0.0, 10.0, 20.0), "attitude": (0.0, 0.0, 0.0)}
    usbl = Usbl(settings, source(), StructurePose(depth=20.0, heading=math.pi / 2))
    value = usbl.poll(truth(0.0, **state), truth(6.0, **state))[0].reading.value
    assert value[:3] == pytest.approx([10.0, 0.0, 0.0], abs=1e-12)


def test_interpolation_follows_a_turning_circle():
    speed, rate, width = 1.5, 0.2, 0.1

    def circle(time):
        heading = 3.1 + rate * time  # passes +-180 deg on the way
        radius = speed / rate
        position = (radius * math.sin(heading), -radius * math.cos(heading), 5.0 + 0.1 * time)
        wrapped = math.remainder(heading, 2 * math.pi)
        return truth(time, position, (0.0, 0.0, wrapped), (speed, 0.0, 0.1, 0.0, 0.0, rate))

    for time in (0.013, 0.05, 0.1, 0.25):
        start = width * math.floor(time / width - 1e-9)
        position, turn = interpolate(circle(start), circle(start + width), time)
        expected = circle(time)
        # The cubic's error is width^4 / 384 times the fourth derivative, speed * rate^3: 3e-9 m.
        assert position == pytest.approx(expected.position, abs=4e-9)
        heading = math.atan2(turn[1, 0], turn[0, 0])
        assert heading == pytest.approx(float(expected.attitude[2]), abs=1e-12)  # linear is exact at a steady rate


def test_usbl_noise_table():
    settings = UsblSettings()
    table = {12.0: 0.0067, 40.0: 0.0678, 100.0: 0.3390, 200.0: 0.4807, 3.0: 0.0067, 0.0: 0.0067, 900.0: 0.4807}
    for slant_range, sigma in table.items():
        assert settings.sigma(slant_range) == pytest.approx(sigma, rel=1e-12)
    middle = settings.sigma(math.sqrt(40.0 * 100.0))
    assert middle == pytest.approx(math.sqrt(0.0678 * 0.3390), rel=1e-12)  # geometric means: log-log
    assert UsblSettings(noise=((50.0, 0.1),), noise_scale=3.0).sigma(7.0) == pytest.approx(0.3)
    # The estimators' own model of the sensor has the same table and interpolation by default.
    assert [UsblModel().deviation(r) for r in (3.0, 50.0, 150.0, 900.0)] == pytest.approx(
        [settings.sigma(r) for r in (3.0, 50.0, 150.0, 900.0)], rel=1e-12
    )


def static_pings(settings, position=(-60.0, 0.0, 20.0), until=50_000.0, trial=0, dock=DOCK):
    first, last = (truth(time, position, (0.0, 0.0, 0.0)) for time in (0.0, until))
    return Usbl(settings, source(trial), dock).poll(first, last)


@pytest.mark.parametrize("distance", [40.0, 150.0])
def test_usbl_noise_is_isotropic_and_white(distance):
    position = (-distance, 0.0, 20.0)
    pings = static_pings(UsblSettings(outlier_probability=0.0, transceiver=(0, 0, 0)), position)
    exact = static_pings(UsblSettings(**EXACT, transceiver=(0, 0, 0)), position)
    errors = np.array([p.reading.value[:3] - e.reading.value[:3] for p, e in zip(pings, exact, strict=True)])
    sigma = UsblSettings().sigma(pings[0].slant_range)
    for axis in range(3):
        assert_sd(errors[:, axis], sigma)
        assert_white(errors[:, axis])
    correlation = np.asarray(np.corrcoef(errors.T))[np.triu_indices(3, 1)]
    assert np.all(np.abs(correlation) < 4.3 / math.sqrt(len(errors)))


def test_usbl_outliers():
    exact = np.array([ping.reading.value[:3] for ping in static_pings(UsblSettings(**EXACT))])
    pings = static_pings(UsblSettings(noise_scale=0.0))
    errors = np.array([ping.reading.value[:3] for ping in pings]) - exact
    flags = np.array([ping.outlier for ping in pings])
    low, high = binom.ppf([1e-5, 1 - 1e-5], len(pings), 0.02)
    assert low <= flags.sum() <= high
    assert np.all(errors[~flags] == 0.0)
    assert np.all(np.linalg.norm(errors[flags], axis=1) >= 10.0 - 1e-9)  # rounding of 60 m
    pings = static_pings(UsblSettings(noise_scale=0.0, outlier_probability=1.0))
    errors = np.array([ping.reading.value[:3] for ping in pings]) - exact
    sizes = np.linalg.norm(errors, axis=1)
    assert kstest(sizes, "uniform", args=(10.0, 20.0)).pvalue > 1e-5  # falsely refused once in 100 000
    for axis in range(3):  # each coordinate of a uniform direction is uniform (Archimedes)
        assert kstest(errors[:, axis] / sizes, "uniform", args=(-1.0, 2.0)).pvalue > 1e-5


def test_noise_settings_change_neither_times_nor_other_draws():
    loud = static_pings(UsblSettings(noise_scale=5.0), until=5000.0)
    quiet = static_pings(UsblSettings(outlier_probability=0.0, maximum_range=10.0), until=5000.0)
    assert all(ping.lost for ping in quiet)
    assert not any(ping.lost for ping in loud)
    for first, second in zip(loud, quiet, strict=True):
        assert first.reading.stamp == second.reading.stamp
        assert np.array_equal(first.reading.value[3:], second.reading.value[3:])
        assert first.reading.sequence == second.reading.sequence


def test_ping_times():
    stamps = np.array([ping.reading.stamp for ping in static_pings(UsblSettings())])
    intervals = np.diff(stamps)
    assert kstest(intervals, "uniform", args=(4.0, 2.0)).pvalue > 1e-5  # falsely refused once in 100 000
    phases = [static_pings(UsblSettings(), until=5.0, trial=trial)[0].reading.stamp for trial in range(500)]
    assert kstest(phases, "uniform", args=(0.0, 5.0)).pvalue > 1e-5
    assert max(phases) > 4.88  # 500 draws all stay below with probability 5e-6


def test_polling_by_ticks_gives_the_pings_of_one_long_poll():
    usbl = Usbl(UsblSettings(), source(), DOCK)
    ticks = [truth(0.1 * tick, (-60.0, 0.0, 20.0), (0.0, 0.0, 0.0)) for tick in range(2001)]
    by_tick = []
    for previous, now in pairwise(ticks):
        pings = usbl.poll(previous, now)
        assert all(previous.time < ping.reading.stamp <= now.time for ping in pings)
        assert all(math.isnan(ping.reading.received) for ping in pings)
        by_tick += pings
    whole = static_pings(UsblSettings(), until=200.0)
    assert [p.reading.sequence for p in by_tick] == list(range(len(whole)))
    for first, second in zip(by_tick, whole, strict=True):
        assert first.reading.stamp == second.reading.stamp
        assert first.reading.value == pytest.approx(second.reading.value, abs=1e-12)  # rounding of the cubic


def test_pinging_faster_when_near():
    settings = UsblSettings(near_range=60.0, near_interval=2.0)
    near = np.diff([p.reading.stamp for p in static_pings(settings, (-30.0, 0.0, 20.0), until=5000.0)])
    far = np.diff([p.reading.stamp for p in static_pings(settings, (-90.0, 0.0, 20.0), until=5000.0)])
    assert kstest(near, "uniform", args=(1.6, 0.8)).pvalue > 1e-5  # 2 s +- 1 s * 2/5
    assert kstest(far, "uniform", args=(4.0, 2.0)).pvalue > 1e-5


def test_a_missed_poll_is_refused():
    usbl = Usbl(UsblSettings(), source(), DOCK)
    with pytest.raises(ValueError, match="never polled"):
        usbl.poll(truth(10.0), truth(10.1))


def test_dock_errors_are_constant_in_a_trial_and_vary_between_trials():
    dock = StructurePose(depth=20.0, heading=0.7, pitch=0.02, roll=-0.03)
    values = np.array([ping.reading.value for ping in static_pings(UsblSettings(), dock=dock)])
    assert np.all(values[:, 3:6] == values[0, 3:6])
    trials = [static_pings(UsblSettings(dock_depth_noise=0.0), until=5.0, trial=t, dock=dock)[0] for t in range(800)]
    firsts = np.array([ping.reading.value for ping in trials])
    for column, mean in zip((3, 4, 5), (0.7, 0.02, -0.03), strict=True):
        assert_sd(firsts[:, column], 0.3 * DEG, mean=mean)
    assert_sd(firsts[:, 6], 0.05, mean=20.0)
    depths = np.array([p.reading.value[6] for p in static_pings(UsblSettings(dock_depth_bias=0.0))])
    assert_sd(depths, 0.02, mean=20.0)


@pytest.mark.parametrize(
    ("settings", "data", "text"),
    [
        (CompassSettings, {"heading_noise_deg": -1.0}, "greater than or equal to 0"),
        (CompassSettings, {"rate": 0.0}, "greater than 0"),
        (DepthSettings, {"bias": -0.1}, "greater than or equal to 0"),
        (FeedbackSettings, {"noise": 0.1}, "noise"),
        (UsblSettings, {"jitter": 5.0}, "less than the interval"),
        (UsblSettings, {"near_range": 60.0}, "give both or neither"),
        (UsblSettings, {"noise": [[40.0, 0.1], [12.0, 0.01]]}, "must increase"),
        (UsblSettings, {"noise": [[40.0, 0.0]]}, "noise_scale"),
        (UsblSettings, {"outlier_probability": 1.5}, "less than or equal to 1"),
        (UsblSettings, {"outlier_minimum": 40.0}, "at least outlier_minimum"),
    ],
)
def test_bad_settings_are_refused(settings, data, text):
    with pytest.raises(ValidationError, match=text):
        settings(**data)
