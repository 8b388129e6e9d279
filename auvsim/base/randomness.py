"""Independent random streams, one per noise source, and cheap floats drawn from them.

Each noise source owns one stream, named `vehicle/sensor`. Adding a source, or losing a reading, changes no other
stream; changing the size of a noise changes no draw, because draws are standard and scaled afterwards.

A stream can be walked on: its normals, mixed with those of another trial, are standard normals again, near the first
ones where the angle between the two is small.
"""

import math
from collections.abc import Sequence
from typing import Any, cast
from zlib import crc32

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from auvsim.base.errors import InputError

LARGEST = 2**63  # seeds and trials are below, as are the integers of a log
BELOW_ONE = math.nextafter(1.0, 0.0)

Walk = Sequence[tuple[int, float]]  # steps: trial whose streams are mixed in, and the angle of the mixture [rad]


def stream(seed: int, trial: int, name: str, walk: Walk | None = None) -> Generator:
    """The generator of one named noise source in one trial.

    Args:
        seed: Seed of the campaign, a whole number >= 0.
        trial: Index of the trial, >= 0.
        name: Name of the source, for example `remus100/compass`.
        walk: Steps away from the trial, each x = cos(angle) x + sin(angle) n of the normals n of another trial under
            the same name; none: numpy's own generator. A walk without steps is the same in distribution, not in draws.

    Raises:
        InputError: If the seed or the trial is negative, or more than a log can hold.
    """
    if not (0 <= seed < LARGEST and 0 <= trial < LARGEST):
        raise InputError(f"seed {seed}, trial {trial}: both must be whole numbers >= 0 and below 2^63")
    if walk is None:
        return Generator(PCG64(SeedSequence(seed, spawn_key=(trial, crc32(name.encode())))))
    weights = [1.0]
    for _, angle in walk:
        weights = [math.cos(angle) * weight for weight in weights] + [math.sin(angle)]
    streams = [stream(seed, number, name) for number in (trial, *(number for number, _ in walk))]
    return cast(Generator, Walked(streams, weights))


class Walked:
    """A generator whose every draw is made of one sequence of standard normals, mixed from those of several streams.

    It has what simulations use of `numpy.random.Generator`, in the same distributions. Near sequences of normals give
    near draws, so that what a run makes of them can be walked on.

    Args:
        streams: Independent ones.
        weights: Of each; their squares sum up to 1.
    """

    def __init__(self, streams: Sequence[Generator], weights: Sequence[float]) -> None:
        self._parts = list(zip(streams, weights, strict=True))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"a walked stream has no '{name}'; a part that draws so cannot be walked on")

    def standard_normal(self, size: Any = None, dtype: Any = np.float64) -> Any:
        """Draws of N(0, 1)."""
        drawn = sum(weight * stream.standard_normal(size) for stream, weight in self._parts)
        return drawn if size is None else np.asarray(drawn, dtype=dtype)

    def normal(self, loc: Any = 0.0, scale: Any = 1.0, size: Any = None) -> Any:
        """Draws of a normal distribution."""
        return loc + scale * self.standard_normal(size)

    def random(self, size: Any = None) -> Any:
        """Draws of U[0, 1): the shares of a normal distribution below draws of it."""
        from scipy.special import ndtr

        shares = np.minimum(ndtr(self.standard_normal(size)), BELOW_ONE)
        return float(shares) if size is None else shares

    def uniform(self, low: Any = 0.0, high: Any = 1.0, size: Any = None) -> Any:
        """Draws of U[low, high)."""
        return low + (high - low) * self.random(size)

    def standard_exponential(self, size: Any = None, dtype: Any = np.float64) -> Any:
        """Draws of the exponential distribution of mean 1."""
        drawn = -np.log1p(-self.random(size))
        return float(drawn) if size is None else np.asarray(drawn, dtype=dtype)

    def integers(self, low: int, high: int | None = None, size: Any = None) -> Any:
        """Whole numbers from `low` (or 0) to below `high` (or `low`)."""
        low, high = (0, low) if high is None else (low, high)
        drawn = low + np.floor((high - low) * self.random(size)).astype(np.int64)
        return int(drawn) if size is None else drawn

    def choice(self, a: Any, size: Any = None) -> Any:
        """Members of a sequence, with replacement."""
        return np.asarray(a)[self.integers(len(a), size=size)]

    def spawn(self, n_children: int) -> list["Walked"]:
        """Independent children, mixed from those of its streams."""
        families = [stream.spawn(n_children) for stream, _ in self._parts]
        weights = [weight for _, weight in self._parts]
        return [Walked(children, weights) for children in zip(*families, strict=True)]


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
