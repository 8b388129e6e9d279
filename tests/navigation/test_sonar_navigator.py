"""The navigator of surveys: what a mean of readings weighs, GPS whose slow error is a state, what it leaves out."""

import gc
import math
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from auvsim.acoustics.usbl import UsblSettings
from auvsim.base.frames import wrap
from auvsim.base.reading import Reading
from auvsim.navigation import registry
from auvsim.navigation.navigator import NavigatorSetup
from auvsim.navigation.settings import SonarSettings
from auvsim.sensors.altimeter import AltimeterSettings
from auvsim.sensors.compass import CompassSettings
from auvsim.sensors.dvl import DvlSettings
from auvsim.sensors.gps import GpsSettings
from auvsim.sensors.gyro import GyroSettings
from auvsim.sensors.imaging_sonar import ImagingSonarSettings
from auvsim.vehicles import library

GPS = GpsSettings(noise=0.6, wander=1.7, wander_time=90.0)
SENSORS: dict[str, Any] = {
    "compass": CompassSettings(heading_noise_deg=2.0),
    "gyro": GyroSettings(enabled=True),
    "dvl": DvlSettings(enabled=True),
    "gps": GPS,
    "altimeter": AltimeterSettings(),
    "sonar": ImagingSonarSettings(beams=32, bins=40, nose=1.3),
}
NONE: Any = None


def setup() -> NavigatorSetup:
    """Of a vehicle with these sensors."""
    return NavigatorSetup(
        vehicle="auv", settings=SonarSettings(match=False), parameters=None,
        actuation=library.vehicle("remus100").actuation, period=0.5, rates={}, usbl=UsblSettings(), sensors=SENSORS,
        dock=None,
    )  # fmt: skip


@pytest.fixture(scope="module")
def navigator() -> Any:
    return registry.build(setup())


def test_a_navigator_and_its_frames_go_with_the_run() -> None:
    """Nothing of it refers back to it: half a gigabyte of frames would wait for the garbage collector."""
    made: Any = registry.build(setup())
    made.update(0.5, [compass(0.5)], (), NONE)
    parts = [weakref.ref(part) for part in (made, made._estimator, made._estimator.filter)]
    gc.disable()
    try:
        del made
        assert [part() for part in parts] == [None] * 3
    finally:
        gc.enable()


def compass(time: float, heading: float = 0.4) -> Reading:
    """A compass reading on an even keel."""
    return Reading("compass", time, time, np.array((heading, 0.0, 0.0)), round(10.0 * time))


def gps(time: float, north: float, east: float) -> Reading:
    """A fix."""
    return Reading("gps", time, time, np.array((north, east)), round(10.0 * time))


def dvl(time: float, ahead: float, water: float = math.nan) -> Reading:
    """Bottom track ahead, water track as given."""
    return Reading("dvl", time, time, np.array((ahead, 0.0, 0.0, water, water, water)), round(10.0 * time))


def located(navigator: Any, fixes: int) -> Any:
    """The estimate after so many fixes a second apart, at rest."""
    navigator.reset()
    for k in range(1, 2 * fixes + 1):
        time = 0.5 * k
        found = [compass(time), dvl(time, 0.0), Reading("gyro", time, time, np.zeros(3), k)]
        estimate = navigator.update(time, found + ([gps(time, 12.0, -7.0)] if k % 2 == 0 else []), (), NONE)
    return estimate


def test_many_fixes_leave_the_slow_error_of_gps(navigator: Any) -> None:
    """The first has both errors; 30 leave what the best mean of a Gauss-Markov process and white noise leaves."""
    first, many = located(navigator, 1), located(navigator, 30)
    for axis in range(2):
        assert first.covariance[axis, axis] == pytest.approx(0.6**2 + 1.7**2, rel=1e-3)
        # Best of all weights: the smallest variance of a mean of 30 samples of the process and white noise.
        apart = np.abs(np.subtract.outer(np.arange(30.0), np.arange(30.0)))
        C = 1.7**2 * np.exp(-apart / 90.0) + 0.6**2 * np.eye(30)
        least = 1.0 / np.linalg.solve(C, np.ones(30)).sum()
        assert many.covariance[axis, axis] == pytest.approx(least, rel=0.03)  # the vehicle's own velocity is not known
    k = list(navigator.states).index("gps_north")
    assert first.covariance[0, k] == pytest.approx(-(1.7**2), rel=1e-3)
    np.testing.assert_allclose(many.position[:2], (12.0, -7.0), atol=0.01)
    assert all(o.accepted for o in many.outcomes if o.kind == "gps")


def test_a_mean_of_readings_weighs_by_their_number(navigator: Any) -> None:
    """Five readings of 2 deg in a period: the first heading known to 2 / root 5, beside the compass' constant error."""
    navigator.reset()
    navigator.update(0.5, [compass(0.1 * k) for k in range(1, 6)], (), NONE)
    still = [Reading("gyro", 0.1 * k, 0.1 * k, np.zeros(3), k) for k in range(6, 11)]
    several = [compass(0.1 * k) for k in range(6, 11)]
    estimate = navigator.update(1.0, [gps(0.8, 0.0, 0.0), *still, *several], (), NONE)
    assert estimate.initialised
    k = list(navigator.states).index("compass_bias")
    H = np.zeros(len(navigator.states))
    H[2] = H[k] = 1.0  # what the compass shows
    assert math.sqrt(H @ estimate.covariance @ H) == pytest.approx(math.radians(2.0) / math.sqrt(5.0), rel=0.2)


def test_a_late_frame_is_laid_by_the_altitude_of_its_time(navigator: Any) -> None:
    """Going down by 0.4 m/s over a floor at 20 m: 3 s ago the altitude was 1.2 m more."""
    navigator.reset()
    for k in range(1, 61):
        time = 0.2 * k
        depth = Reading("depth", time, time, np.array((5.0 + 0.4 * time,)), k)
        echo = Reading("altimeter", time, time, np.array((15.0 - 0.4 * time,)), k)
        navigator.update(time, [compass(time), depth, echo], (), NONE)
    now, late = (Reading("sonar", stamp, 12.0, np.zeros(2), 9) for stamp in (12.0, 9.0))
    assert navigator._altitude_of(late) - navigator._altitude_of(now) == pytest.approx(1.2, abs=0.05)


def test_an_estimate_holds_no_more_than_itself(navigator: Any) -> None:
    """A log that keeps it would else keep the covariance of all frames' poses with it, megabytes a tick."""
    estimate = located(navigator, 2)
    for part in (estimate.covariance, estimate.mean):
        assert part.base is None


def test_a_water_track_is_no_refused_measurement(navigator: Any) -> None:
    """The filter has no current that it could tell of."""
    located(navigator, 2)
    estimate = navigator.update(2.5, [compass(2.5), dvl(2.5, 0.0, 0.1)], (), NONE)
    assert estimate.refused == 0
    assert sorted((o.kind, o.accepted) for o in estimate.outcomes) == [("compass", True), ("dvl_bottom", True)]


def test_frames_are_of_the_place_of_the_transducer(navigator: Any) -> None:
    """Their cells lie as far ahead of the vehicle's origin as the sonar."""
    grid = navigator.grid
    assert grid.centres[0, 0, 0] == pytest.approx(1.3 + 0.5 * grid.cell)


def test_the_heading_turns_as_the_gyro_says_within_an_update(navigator: Any) -> None:
    """A swing that begins and ends between two updates, without a compass: a rate known at updates only shows none."""
    located(navigator, 20)
    before = navigator.update(20.5, [compass(20.5)], (), NONE).heading
    stamps = 20.5 + 0.05 * np.arange(1, 11)
    rates = 0.4 * np.sin(np.pi * (stamps - 20.5) / 0.5) ** 2
    swing = [
        Reading("gyro", t, t, np.array((0.0, 0.0, r)), k) for k, (t, r) in enumerate(zip(stamps, rates, strict=True))
    ]
    after = navigator.update(21.0, swing, (), NONE).heading
    # The integral is 0.1 rad; the bias at the start, 1e-3 rad/s, may turn it by as much again in half a second.
    assert after - before == pytest.approx(0.1, abs=2e-3)


def test_a_rate_that_no_compass_sees_is_the_gyros_bias(navigator: Any) -> None:
    """The heading stays, and the bias is found as the gyro shows it: 4e-3 rad/s by 60 s of a compass of 2 deg."""
    located(navigator, 20)
    for k in range(1, 121):
        time = 20.0 + 0.5 * k
        found = navigator.update(
            time, [compass(time), Reading("gyro", time, time, np.array((0.0, 0.0, 4e-3)), k)], (), NONE
        )
    # A line through 120 headings of 0.035 rad has a slope known to 1.8e-4 rad/s; four of that, as its walk adds to it.
    assert found.value("gyro_bias") == pytest.approx(4e-3, abs=8e-4)
    assert found.heading == pytest.approx(0.4, abs=0.03)


def test_the_filter_begins_with_what_the_settings_say(navigator: Any) -> None:
    """Echoes nearer by 0.4 m from other sides, of which frames are laid 0.24 m farther; the gyro's noise."""
    found = located(navigator, 1)
    own, filter_ = SonarSettings(), navigator._estimator.filter
    k = found.names.index("echoes_nearer")
    assert (navigator._frames.nearer, found.mean[k]) == (pytest.approx(0.24), pytest.approx(own.nearer - 0.24))
    assert found.covariance[k, k] == pytest.approx(own.nearer_error**2)
    assert filter_._nearer == k
    assert filter_.process.input_noise == pytest.approx([math.radians(GyroSettings().noise_density_deg) ** 2])


@pytest.mark.parametrize("gyro", [True, False])
def test_a_turn_is_followed_with_a_gyro_and_without(gyro: bool) -> None:
    """A steady turn of 3 deg/s for 40 s, by exact readings: without a gyro the compass tells, with one no lag is left.

    Without, the yaw rate is found from headings of 2 deg noise, and is known to less than a tenth of it.
    """
    sensors = {name: own for name, own in SENSORS.items() if gyro or name != "gyro"}
    made: Any = registry.build(replace(setup(), sensors=sensors))
    rate, found = math.radians(3.0), NONE
    for k in range(81):
        time = 0.5 * k
        readings = [compass(time, wrap(rate * time)), dvl(time, 0.0), gps(time, 0.0, 0.0)]
        if gyro:
            readings.append(Reading("gyro", time, time, np.array((0.0, 0.0, rate)), k))
        found = made.update(time, readings, (), NONE)
    assert wrap(found.heading - 40.0 * rate) == pytest.approx(0.0, abs=math.radians(0.2 if gyro else 1.0))
    assert found.value("yaw_rate") == pytest.approx(rate, rel=0.1)
