"""Random streams: the recipe, their independence, and blocks that do not change the sequence."""

import numpy as np
import pytest
from numpy.random import PCG64, Generator, SeedSequence

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
