"""The gyro: white noise and a walking bias, as densities."""

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import chi2
from surroundings import WATER

from auvsim.base.frames import euler_to_quaternion
from auvsim.base.randomness import stream
from auvsim.physics.truth import Truth
from auvsim.sensors.gyro import Gyro, GyroSettings

RATES = (0.02, -0.03, 0.1)


def truth() -> Truth:
    """A vehicle that turns about all axes."""
    return Truth(
        time=3.0,
        position=np.zeros(3),
        quaternion=euler_to_quaternion(0.1, 0.2, 0.3),
        attitude=np.array([0.1, 0.2, 0.3]),
        nu=np.array([1.5, 0.0, 0.0, *RATES]),
        current=np.zeros(3),
        actuators=np.array((0.0, 0.0, 0.0, 0.0, 100.0)),
    )


def gyro(trial: int = 0, **settings: Any) -> Gyro:
    """A gyro of a trial."""
    return Gyro(GyroSettings(**settings), stream(5, trial, "remus100/gyro"))


def readings(instance: Gyro, count: int) -> np.ndarray:
    """Errors (count, 3) of as many readings [rad/s]."""
    return np.array([instance.measure(truth(), WATER).value for _ in range(count)]) - RATES


def assert_variance(samples: np.ndarray, sigma: float) -> None:
    """Sum of squares of independent normals of mean zero inside its central 1 - 2e-5 interval."""
    low, high = chi2.ppf([1e-5, 1 - 1e-5], samples.size)
    assert low < np.square(samples / sigma).sum() < high


def test_an_exact_gyro_measures_the_rates() -> None:
    """p, q, r of the body."""
    reading = gyro(noise_density_deg=0.0, bias_deg=0.0, bias_walk_deg=0.0).measure(truth(), WATER)
    assert reading.value.tolist() == list(RATES)
    assert (reading.sensor, reading.stamp, reading.received, reading.sequence) == ("gyro", 3.0, 3.0, 0)


@pytest.mark.parametrize("rate", [10.0, 100.0])
def test_noise_is_a_density(rate: float) -> None:
    """A reading's deviation grows with the root of the rate, the heading integrated over a second's does not."""
    errors = readings(gyro(bias_deg=0.0, bias_walk_deg=0.0, rate=rate), 20_000)
    assert_variance(errors, math.radians(0.005) * math.sqrt(rate))
    angles = errors.reshape(-1, round(rate), 3).sum(axis=1) / rate
    assert_variance(angles, math.radians(0.005))
    past = (errors[1:] * errors[:-1]).mean(axis=0) / errors.var(axis=0)
    assert (np.abs(past) < 4.3 / math.sqrt(len(errors))).all()  # deviation 1 / sqrt(n) if white


def test_bias_at_the_start_varies_from_trial_to_trial() -> None:
    """0.005 deg/s about each axis."""
    biases = np.array([gyro(trial).bias for trial in range(1000)])
    assert_variance(biases, math.radians(0.005))


@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_bias_walks(rate: float) -> None:
    """After a time it has moved by its density times the root of that time, however often it was read."""
    settings = {"noise_density_deg": 0.0, "bias_deg": 0.0, "bias_walk_deg": 0.01, "rate": rate}
    errors = np.array([readings(gyro(trial, **settings), 40) for trial in range(300)])
    assert_variance(errors[:, -1], math.radians(0.01) * math.sqrt(40.0 / rate))
    assert_variance(np.diff(errors, axis=1), math.radians(0.01) / math.sqrt(rate))


def test_replays_and_keeps_its_draws_apart() -> None:
    """The same stream gives the same readings; the size of one noise changes no other draw."""
    first, again = readings(gyro(), 200), readings(gyro(), 200)
    np.testing.assert_array_equal(first, again)
    quiet = readings(gyro(noise_density_deg=0.0), 200)
    white = readings(gyro(bias_deg=0.0, bias_walk_deg=0.0), 200)
    np.testing.assert_allclose(quiet + white, first, atol=1e-15)  # rounding of rates of 0.1


def test_bad_settings_are_refused() -> None:
    """No negative deviations, no unknown keys."""
    for data in ({"bias_deg": -1.0}, {"noise": 0.1}, {"rate": 0.0}):
        with pytest.raises(ValidationError):
            GyroSettings(**data)
