"""Records made ready for motion models: sensors' lags taken out, a grid no finer than the motion, smoothed states."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from auvsim.identification.fit import NO_NUISANCES, Nuisances
from auvsim.identification.judgement import part
from auvsim.identification.motion import lags
from auvsim.identification.motion.lags import Lags
from auvsim.identification.records import MEASURED, Record
from auvsim.identification.states import STEADY, smoothed
from estimators.core.types import Array

COARSEST = 0.25  # step of the grid [s]: a small vehicle's yaw takes about a second
QUICK = 0.5  # the same where speed counts more [s]
WIND, THRUSTERS = slice(2, 4), slice(4, 6)  # of the inputs
WATER = [MEASURED.index(name) for name in ("surge", "sway")]
GROUND = [MEASURED.index(name) for name in ("north", "east", "ground_surge", "ground_sway")]


@dataclass(frozen=True, kw_only=True, slots=True)
class Motion:
    """A record on its grid, and the motion that its sensors show without any model of the vehicle."""

    record: Record  # inputs (n, 6) as `terms` has them; sensors' lags taken out
    states: Array  # (n, 12) smoothed; see `states`

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return self.record.duration


def nuisances(records: Sequence[Record]) -> Nuisances:
    """Constant errors that may be believed of these records.

    A current shows only as a difference of speeds through the water and over ground; without the former the model is
    one of the motion over ground. What is measured of the vehicle's own sensors alone has no constant errors that a
    prediction could know.
    """
    both = all(
        np.isfinite(record.measured[:, WATER]).any() and np.isfinite(record.measured[:, GROUND]).any()
        for record in records
    )
    return replace(NO_NUISANCES, current=1.0) if both else NO_NUISANCES


def prepare(records: Sequence[Record], *, coarsest: float = COARSEST, known: Lags | None = None) -> list[Motion]:
    """Records as motions, all with the same lags taken out.

    Args:
        records: As they were read.
        coarsest: Longest step of the grid [s].
        known: Lags; None: those that the records show.
    """
    known = lags.find(records) if known is None else known
    own = nuisances(records).vector()
    found = []
    for record in records:
        ready = _coarser(_with_all_inputs(lags.without(record, known)), coarsest)
        found.append(Motion(record=ready, states=smoothed(ready, STEADY, own)))
    return found


def slices(motion: Motion, first: int, stop: int) -> Motion:
    """Samples `first` to `stop` of a motion."""
    return Motion(record=part(motion.record, first, stop), states=motion.states[first:stop])


def _with_all_inputs(record: Record) -> Record:
    still = np.zeros((len(record.times), 2))
    others = [still if values is None else values for values in (record.wind, record.thrusters)]
    return replace(record, inputs=np.column_stack([record.inputs[:, :2], *others]))


def _coarser(record: Record, coarsest: float) -> Record:
    """The same with means over a whole number of samples; inputs ahead of each time, measurements about it."""
    width = math.floor(coarsest / record.step + 1e-6)
    if width < 2:
        return record
    count = (len(record.times) - 1) // width
    inputs = record.inputs[: count * width].reshape(count, width, -1).mean(axis=1)
    places = width * np.arange(count)[:, None] + np.arange(width) - (width - 1) // 2
    inside = (places >= 0) & (places < len(record.times))
    values = record.measured[np.clip(places, 0, len(record.times) - 1)]
    there = np.isfinite(values) & inside[..., None]
    total = there.sum(axis=1)
    some = np.maximum(total, 1)
    measured = np.where(total > 0, np.where(there, values, 0.0).sum(axis=1) / some, np.nan)
    # A mean of samples that do not lie evenly about the time is moved there by the local slope.
    times = (there * places[..., None]).sum(axis=1) / some
    for c in range(measured.shape[1]):
        seen = np.flatnonzero(total[:, c])
        if len(seen) > 2:
            slope = np.gradient(measured[seen, c], times[seen, c])
            measured[seen, c] += slope * (width * seen - times[seen, c])
    dense = np.array([np.median(total[total[:, c] > 0, c]) if (total[:, c] > 0).any() else 1.0 for c in range(8)])
    return replace(
        record,
        times=record.times[: count * width : width],
        inputs=inputs,
        measured=measured,
        deviations=record.deviations / np.sqrt(np.maximum(dense, 1.0)),
        wind=None if record.wind is None else inputs[:, WIND],
        thrusters=None if record.thrusters is None else inputs[:, THRUSTERS],
    )
