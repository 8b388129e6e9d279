"""Independent random streams, one per noise source, and cheap floats drawn from them.

Each noise source owns one stream, named `vehicle/sensor`. Adding a source, or losing a reading, changes no other
stream; changing the size of a noise changes no draw, because draws are standard and scaled afterwards.
"""

from zlib import crc32

from numpy.random import PCG64, Generator, SeedSequence

from auvsim.base.errors import InputError

LARGEST = 2**63  # seeds and trials are below, as are the integers of a log


def stream(seed: int, trial: int, name: str) -> Generator:
    """The generator of one named noise source in one trial.

    Args:
        seed: Seed of the campaign, a whole number >= 0.
        trial: Index of the trial, >= 0.
        name: Name of the source, for example `remus100/compass`.

    Raises:
        InputError: If the seed or the trial is negative, or more than a log can hold.
    """
    if not (0 <= seed < LARGEST and 0 <= trial < LARGEST):
        raise InputError(f"seed {seed}, trial {trial}: both must be whole numbers >= 0 and below 2^63")
    return Generator(PCG64(SeedSequence(seed, spawn_key=(trial, crc32(name.encode())))))


class Noise:
    """Standard normals and uniforms as plain floats, drawn in blocks because single draws cost ten times as much.

    The n-th normal and the n-th uniform depend only on the generator, the block size and how the two were asked for
    before: a source that takes the same numbers for every reading replays bit for bit.
    """

    __slots__ = ("_block", "_generator", "_next_normal", "_next_uniform", "_normals", "_uniforms")

    def __init__(self, generator: Generator, block: int = 512) -> None:
        self._generator = generator
        self._block = block
        self._normals: list[float] = []
        self._uniforms: list[float] = []
        self._next_normal = 0
        self._next_uniform = 0

    def normals(self, count: int) -> list[float]:
        """The next `count` draws of N(0, 1)."""
        start = self._next_normal
        end = start + count
        if end > len(self._normals):
            fresh = self._generator.standard_normal(max(self._block, count))
            self._normals = self._normals[start:] + fresh.tolist()
            start, end = 0, count
        self._next_normal = end
        return self._normals[start:end]

    def uniforms(self, count: int) -> list[float]:
        """The next `count` draws of U[0, 1)."""
        start = self._next_uniform
        end = start + count
        if end > len(self._uniforms):
            fresh = self._generator.random(max(self._block, count))
            self._uniforms = self._uniforms[start:] + fresh.tolist()
            start, end = 0, count
        self._next_uniform = end
        return self._uniforms[start:end]
