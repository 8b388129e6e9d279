"""Random streams: the recipe, their independence, and blocks that do not change the sequence."""

import math

import numpy as np
import pytest
from numpy.random import PCG64, Generator, SeedSequence
from scipy.stats import kstest, norm

from auvsim.base.errors import InputError
from auvsim.base.randomness import Noise, stream


def crc32(data: bytes) -> int:
    """The IEEE 802.3 checksum bit by bit, independent of zlib."""
    checksum = 0xFFFFFFFF
    for byte in data:
        checksum ^= byte
        for _ in range(8):
            checksum = (checksum >> 1) ^ (0xEDB88320 if checksum & 1 else 0)
    return checksum ^ 0xFFFFFFFF


def test_stream_follows_the_documented_recipe():
    sequence = SeedSequence(7, spawn_key=(3, crc32(b"remus100/compass")))
    expected = Generator(PCG64(sequence)).standard_normal(5)
    assert np.array_equal(stream(7, 3, "remus100/compass").standard_normal(5), expected)


@pytest.mark.parametrize("other", [(8, 3, "remus100/compass"), (7, 4, "remus100/compass"), (7, 3, "remus100/depth")])
def test_streams_are_uncorrelated(other):
    count = 10_000
    first = stream(7, 3, "remus100/compass").standard_normal(count)
    second = stream(*other).standard_normal(count)
    # The sample correlation of independent streams has sd 1/sqrt(n); 4.5 sd are exceeded once in 150 000.
    assert abs(np.mean(first * second)) < 4.5 / np.sqrt(count)


@pytest.mark.parametrize(("seed", "trial"), [(-1, 0), (0, -1)])
def test_negative_seed_or_trial_is_refused(seed, trial):
    with pytest.raises(InputError, match=f"seed {seed}, trial {trial}"):
        stream(seed, trial, "dock")


@pytest.mark.parametrize("draw", ["normals", "uniforms"])
def test_blocks_leave_the_sequence_as_the_generator_gives_it(draw):
    generator = stream(1, 0, "a")
    whole = generator.standard_normal(40) if draw == "normals" else generator.random(40)
    taken = []
    noise = Noise(stream(1, 0, "a"), block=5)
    for count in (3, 3, 1, 7, 0, 12, 14):  # across block borders, and more than a block at once
        part = getattr(noise, draw)(count)
        assert len(part) == count
        taken += part
    assert taken == whole.tolist()
    assert all(type(value) is float for value in taken)


def test_a_walked_stream_is_the_mixture_of_its_streams():
    a, b = 0.3, 1.1  # [rad]
    n0, n1, n2 = (stream(7, trial, "x").standard_normal(50) for trial in (3, 8, 5))
    expected = math.cos(b) * (math.cos(a) * n0 + math.sin(a) * n1) + math.sin(b) * n2
    assert stream(7, 3, "x", [(8, a), (5, b)]).standard_normal(50) == pytest.approx(expected, abs=1e-14)
    assert np.array_equal(stream(7, 3, "x", []).standard_normal(50), n0)
    assert np.array_equal(stream(7, 3, "x", [(8, 0.0)]).standard_normal(50), n0)


def test_draws_of_a_walk_come_from_one_sequence_however_they_are_asked_for():
    walk = [(8, 0.3), (5, 1.1)]
    normals = stream(7, 3, "x", walk).standard_normal(30)
    taken = stream(7, 3, "x", walk)
    assert taken.standard_normal((2, 3)).ravel() == pytest.approx(normals[:6], abs=1e-15)
    assert taken.random(4) == pytest.approx(norm.cdf(normals[6:10]), abs=1e-15)
    assert taken.uniform(2.0, 5.0) == pytest.approx(2.0 + 3.0 * norm.cdf(normals[10]), abs=1e-14)
    assert taken.normal(1.0, 2.0) == pytest.approx(1.0 + 2.0 * normals[11], abs=1e-14)
    assert taken.integers(7) == math.floor(7 * norm.cdf(normals[12]))
    assert taken.choice([-1.0, 1.0], 5).tolist() == np.where(normals[13:18] < 0.0, -1.0, 1.0).tolist()
    assert taken.standard_exponential() == pytest.approx(-math.log(norm.sf(normals[18])), abs=1e-12)


def test_a_walk_keeps_every_distribution():
    walked = stream(7, 3, "x", [(8, 0.3), (5, 1.1), (2, 0.2)])
    # Kolmogorov and Smirnov's p-value falls below 1e-4 once in ten thousand seeds.
    assert kstest(walked.standard_normal(4000), "norm").pvalue > 1e-4
    assert kstest(walked.random(4000), "uniform").pvalue > 1e-4
    assert kstest(walked.standard_exponential(4000), "expon").pvalue > 1e-4
    counts = np.bincount(walked.integers(2, 6, 4000), minlength=6)
    assert counts[:2].tolist() == [0, 0]
    assert np.all(abs(counts[2:] - 1000) < 4.5 * math.sqrt(750))  # 4.5 sd of a binomial


def test_children_of_a_walk_are_walked_and_independent():
    first, second = stream(7, 3, "x", [(8, 0.3)]).spawn(2)
    children = [stream(7, trial, "x").spawn(2) for trial in (3, 8)]
    expected = [
        math.cos(0.3) * a.standard_normal(9) + math.sin(0.3) * b.standard_normal(9)
        for a, b in zip(*children, strict=True)
    ]
    assert first.standard_normal(9) == pytest.approx(expected[0], abs=1e-15)
    assert second.standard_normal(9) == pytest.approx(expected[1], abs=1e-15)


def test_what_cannot_be_walked_on_is_refused_by_name():
    with pytest.raises(AttributeError, match="no 'poisson'"):
        stream(7, 3, "x", []).poisson(3.0)
