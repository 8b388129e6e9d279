"""Where in its distribution each value of each trial lies, spread evenly over the trials instead of drawn by each."""

import math
import warnings
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Literal

from scipy.stats import qmc

from auvsim.base.frames import Array
from auvsim.base.randomness import stream

Sampling = Literal["independent", "latin_hypercube", "sobol"]
CHUNK = 1024  # points of a Sobol sequence that are made at a time, a power of two


def quantiles(kind: Sampling, seed: int, trial: int, keys: Sequence[str], strata: int) -> Mapping[str, float]:
    """The quantile of each distribution in one trial; nothing where each trial draws on its own.

    A Latin hypercube (McKay, Beckman & Conover 1979) has, for each key, one trial in each of `strata` equal parts of
    the distribution, in an order of the key's own, so that pinning one key changes no other. A Sobol sequence,
    scrambled by Owen's method, fills all keys together evenly at any number of trials, best at powers of two.

    Args:
        kind: Of design.
        seed: Of the campaign.
        trial: Number of the trial.
        keys: Of all distributions of the campaign, sorted.
        strata: Trials of one hypercube; the next ones are another.
    """
    if kind == "latin_hypercube":
        block, index = divmod(trial, strata)
        return {key: float(_hypercube(seed, block, key, strata)[index]) for key in keys}
    if kind == "sobol" and keys:
        chunk, index = divmod(trial, CHUNK)
        return dict(zip(keys, _sobol(seed, chunk, len(keys))[index].tolist(), strict=True))
    return {}


@lru_cache(maxsize=256)
def _hypercube(seed: int, block: int, key: str, strata: int) -> Array:
    """(strata,) quantiles of one key."""
    generator = stream(seed, block, f"latin_hypercube/{key}")
    return (generator.permutation(strata) + generator.random(strata)) / strata


@lru_cache(maxsize=4)
def _sobol(seed: int, chunk: int, dimensions: int) -> Array:
    """(CHUNK, dimensions) points."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that later chunks are no power of two of points
        sequence = qmc.Sobol(dimensions, scramble=True, rng=stream(seed, 0, "sobol"))
        if chunk:  # by nothing it cannot go
            sequence.fast_forward(chunk * CHUNK)
        return sequence.random(CHUNK)


def blocks(trials: int, size: int | None) -> list[range]:
    """The trials in consecutive blocks of a size, the last one perhaps shorter; in one if None."""
    size = size or trials
    return [range(size * k, min(size * (k + 1), trials)) for k in range(math.ceil(trials / size))]
