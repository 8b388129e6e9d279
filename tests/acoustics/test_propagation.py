"""Levels of sound against published values, and the probability of a packet by simulation of its bits."""

import math

import numpy as np
import pytest

from auvsim.acoustics import propagation as p


@pytest.mark.parametrize(("kilohertz", "loss"), [(1.0, 0.069), (10.0, 1.19), (25.0, 6.105), (50.0, 17.5)])
def test_absorption_is_thorps(kilohertz, loss):
    """Values of the formula by hand, three digits."""
    assert p.absorption(1e3 * kilohertz) == pytest.approx(loss, rel=0.005)


def test_transmission_loss_is_spreading_and_absorption():
    assert p.transmission_loss(1000.0, 25e3, 2.0) == pytest.approx(60.0 + p.absorption(25e3))
    ten, hundred = (p.transmission_loss(r, 1e3, 1.5) - p.absorption(1e3) * r / 1e3 for r in (10.0, 100.0))
    assert hundred - ten == pytest.approx(15.0)
    assert p.transmission_loss(0.0, 25e3) == p.transmission_loss(1.0, 25e3)


def test_noise_falls_by_18_decibels_a_decade_and_rises_with_wind():
    """Stojanovic (2007): some 18 dB a decade, from where shipping is no more heard to where heat takes over."""
    assert p.noise_density(5e3, wind=5.0) - p.noise_density(50e3, wind=5.0) == pytest.approx(18.0, abs=2.0)
    assert p.noise_density(10e3, wind=15.0) > p.noise_density(10e3, wind=5.0) + 10.0
    assert p.noise_density(300e3, wind=0.0, shipping=0.0) == pytest.approx(-15.0 + 20.0 * math.log10(300.0), abs=1.0)


def test_packet_success_is_that_of_bits_drawn_from_their_matched_filters():
    """Binary FSK without phase: a bit is wrong where the filter of the other tone has the larger envelope."""
    rng, count, bits = np.random.default_rng(5), 40_000, 12
    snr, bandwidth, rate, gain = -2.0, 4000.0, 1000.0, 1.5
    energy = 10.0 ** ((snr + gain) / 10.0) * bandwidth / rate
    noise = rng.standard_normal((4, count, bits)) * math.sqrt(0.5)
    own = np.hypot(noise[0] + math.sqrt(energy), noise[1])
    other = np.hypot(noise[2], noise[3])
    whole = (own > other).all(axis=1).mean()
    expected = p.packet_success(snr, bits, bandwidth, rate, gain)
    assert 0.2 < expected < 0.8
    assert whole == pytest.approx(expected, abs=4.0 * math.sqrt(0.25 / count))  # four standard deviations
