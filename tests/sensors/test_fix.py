"""Positions from elsewhere: noise, bias, and where there are none."""

from types import SimpleNamespace

import numpy as np
import pytest

from auvsim.base.randomness import stream
from auvsim.sensors.fix import Fix, FixSettings


def readings(count, depth=5.0, trial=0, **settings):
    sensor = Fix(FixSettings(**settings), stream(1, trial, "auv/fix"), name="gps")
    truth = SimpleNamespace(time=3.0, position=np.array((40.0, -7.0, depth)))
    found = [sensor.measure(truth, SimpleNamespace()) for _ in range(count)]
    return sensor, [r for r in found if r is not None]


def test_it_is_the_position_with_noise():
    """2000 of each axis: the sd is good to 1.6 %."""
    _, found = readings(2000, noise=2.0)
    off = np.array([r.value for r in found]) - (40.0, -7.0)
    assert off.std(axis=0) == pytest.approx((2.0, 2.0), rel=4 * 0.016)
    assert off.mean(axis=0) == pytest.approx((0.0, 0.0), abs=4 * 2.0 / 2000**0.5)
    assert abs(np.corrcoef(off.T)[0, 1]) < 0.1
    assert [r.sequence for r in found] == list(range(2000))


def test_its_bias_is_of_a_trial():
    biases = np.array([readings(0, trial=k, bias=3.0)[0].bias for k in range(300)])
    assert biases.std() == pytest.approx(3.0, rel=4 / 1200**0.5)
    sensor, (reading,) = readings(1, bias=3.0, noise=1e-9)
    assert reading.value - (40.0, -7.0) == pytest.approx(sensor.bias, abs=1e-8)


def test_gps_ends_below_the_surface_and_a_loss_takes_the_same_draws():
    assert readings(5, depth=0.6, deepest=0.5)[1] == []
    whole, gapped = readings(300)[1], readings(300, dropout_probability=0.4)[1]
    assert 150 < len(gapped) < 210
    values = {r.value.tobytes() for r in whole}
    assert all(r.value.tobytes() in values for r in gapped)
