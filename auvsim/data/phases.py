"""Phases of a mission along the time of a log."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog


def phase_at(log: VehicleLog, times: Array) -> NDArray[np.int64]:
    """Index of the mission's phase at each time; -1 before the first."""
    return latest(log, "phase", times, -1)


def latest(log: VehicleLog, name: str, times: Array, before: int) -> NDArray[np.int64]:
    """The last value of a variable of the mission at or before each time; `before` where there is none yet."""
    values = np.concatenate([[before], log["mission"][name].astype(int)])
    return values[np.searchsorted(log["mission"]["time"], times, side="right")]


def phase_stretches(phases: NDArray[Any]) -> Iterator[tuple[int, int, int]]:
    """Phase, first index and index of the next stretch's first (the last index at the end) of each run of phases."""
    if not len(phases):
        return
    starts = np.concatenate([[0], np.flatnonzero(np.diff(phases)) + 1, [len(phases) - 1]])
    for start, stop in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        if stop > start:
            yield int(phases[start]), start, stop


def interpolate(times: Array, known: Array, values: Array) -> Array:
    """Columns of values (n, ...) at other times, linearly; NaN without values."""
    if not len(known):
        return np.full((len(times), *values.shape[1:]), np.nan)
    if values.ndim == 1:
        return np.interp(times, known, values)
    return np.stack([np.interp(times, known, column) for column in values.T], axis=-1)
