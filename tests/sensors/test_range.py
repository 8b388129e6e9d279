"""The range sensor: geometry against an independent rotation, errors against their settings, what is not heard."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2
from surroundings import WATER

from auvsim.base.frames import euler_to_quaternion
from auvsim.base.randomness import stream
from auvsim.physics.truth import Truth
from auvsim.sensors.range import Range, RangeSettings

BEACON, TRANSPONDER = (40.0, -30.0, 25.0), (0.6, -0.2, 0.1)
ATTITUDE, PLACE = (0.1, -0.2, 2.3), (-7.0, 11.0, 13.0)
EXACT: dict[str, Any] = {"noise": 0.0, "scale_error": 0.0, "bias": 0.0, "dropout_probability": 0.0}
COUNT = 20_000


def truth(time: float = 3.0) -> Truth:
    """A vehicle that pitches, rolls and heads somewhere."""
    return Truth(
        time=time, position=np.array(PLACE), quaternion=euler_to_quaternion(*ATTITUDE), attitude=np.array(ATTITUDE),
        nu=np.zeros(6), current=np.zeros(3), actuators=np.zeros(5),
    )  # fmt: skip


def ranger(trial: int = 0, **settings: Any) -> Range:
    """A sensor of a trial, under a name of its own."""
    made = RangeSettings(beacon=BEACON, transponder=TRANSPONDER, **settings)
    return Range(made, stream(5, trial, "auv/ranger"), name="ranger")


def distance() -> float:
    """From the transponder to the beacon, by scipy's rotation [m]."""
    turned = Rotation.from_euler("ZYX", ATTITUDE[::-1]).apply(TRANSPONDER)
    return math.dist(np.array(PLACE) + turned, BEACON)


def test_an_exact_sensor_measures_the_distance_from_the_transponder() -> None:
    """And says whose reading it is."""
    reading = ranger(**EXACT).measure(truth(), WATER)
    assert reading is not None
    assert reading.value == pytest.approx([distance()], abs=1e-12)
    assert (reading.sensor, reading.stamp, reading.received, reading.sequence) == ("ranger", 3.0, 3.0, 0)


def test_errors_are_those_of_the_settings() -> None:
    """White noise about a scale and a bias of the trial: mean and variance in their central 1 - 2e-5 intervals."""
    made = ranger(noise=0.3, scale_error=0.01, bias=0.5, dropout_probability=0.0)
    values = np.array([reading.value[0] for _ in range(COUNT) if (reading := made.measure(truth(), WATER))])
    errors = values - made.scale * distance() - made.bias
    assert abs(errors.mean()) < 4.3 * 0.3 / math.sqrt(COUNT)
    low, high = chi2.ppf([1e-5, 1 - 1e-5], COUNT)
    assert low < np.sum(errors**2) / 0.3**2 < high
    many = [ranger(trial, scale_error=0.01, bias=0.5) for trial in range(1000)]
    for found, sd in (([each.scale - 1.0 for each in many], 0.01), ([each.bias for each in many], 0.5)):
        low, high = chi2.ppf([1e-5, 1 - 1e-5], 1000)
        assert low < np.sum(np.square(found)) / sd**2 < high


def test_a_loss_changes_no_other_reading() -> None:
    """A share of readings is lost; those that are heard are as if none were, and are counted on."""
    whole, holed = ranger(dropout_probability=0.0), ranger(dropout_probability=0.3)
    lost, sequence = 0, 0
    for tick in range(2000):
        first, second = (made.measure(truth(float(tick)), WATER) for made in (whole, holed))
        assert first is not None
        if second is None:
            lost += 1
            continue
        assert second.value.tobytes() == first.value.tobytes()
        assert second.sequence == sequence
        sequence += 1
    low, high = binom.ppf([1e-5, 1 - 1e-5], 2000, 0.3)
    assert low <= lost <= high


def test_beyond_its_reach_nothing_is_heard() -> None:
    """From just beyond the maximum on."""
    assert ranger(**EXACT, maximum=distance() - 1e-6).measure(truth(), WATER) is None
    assert ranger(**EXACT, maximum=distance() + 1e-6).measure(truth(), WATER) is not None
