"""Open-loop predictions of motions from many starts, horizon by horizon."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from auvsim.identification.fit import Indices
from auvsim.identification.motion import engine
from auvsim.identification.motion.data import Motion
from auvsim.identification.states import substeps
from estimators.core.types import Array
from estimators.planar.terms import vector

HORIZONS = (10.0, 30.0, 60.0, 120.0)  # [s]
EVERY = 10.0  # from one start to the next [s]
LEAD = 5.0  # before the first: the smoother's states settle within it [s]
_NONE: Indices = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, kw_only=True, slots=True)
class Rollouts:
    """Predictions of one motion; NaN where a model ran away."""

    begin: Indices  # (s,) samples at which they begin
    horizons: tuple[float, ...]  # [s]
    states: Array  # (s, m, 6) predicted
    measured: Array  # (s, m, 6) smoothed without hydrodynamics
    distance: Array  # (s, m) run through the water by the smoothed speed [m]
    sensitivity: Array  # (s, m, 6, k) by the coefficients that were asked for
    covariance: Array  # (s, m, 4, 6, 6) of unit noise in surge, sway, yaw, and of the first state

    @property
    def errors(self) -> Array:
        """Measured less predicted (s, m, 6), the heading's within half a turn."""
        off = self.measured - self.states
        off[..., 2] = np.angle(np.exp(1j * off[..., 2]))
        return off

    @property
    def shares(self) -> Array:
        """Position errors relative to the distance run (s, m): 10 where it ran away, NaN past the motion's end."""
        off = np.hypot(self.errors[..., 0], self.errors[..., 1]) / np.maximum(self.distance, 1e-6)
        return np.where(np.isfinite(self.distance), np.where(np.isfinite(off), np.minimum(off, 10.0), 10.0), np.nan)


def horizons(motions: Sequence[Motion], wanted: Sequence[float] = HORIZONS) -> tuple[float, ...]:
    """Those horizons for which a motion is long enough; half the longest one if none is."""
    longest = max(motion.duration for motion in motions) - LEAD
    fitting = tuple(horizon for horizon in wanted if horizon <= longest)
    return fitting or (math.floor(0.5 * longest),)


def roll(
    parameters: Array,
    motion: Motion,
    wanted: Sequence[float],
    *,
    sensitive: Indices = _NONE,
    spread: bool = False,
    every: float = EVERY,
) -> Rollouts:
    """Predicts a motion from every few seconds of it, by the smoothed state there and the record's inputs alone.

    Args:
        parameters: In the order of `terms.PARAMETERS`.
        motion: Which is predicted.
        wanted: Horizons [s]; those past the motion's end are left out, prediction by prediction, as NaN.
        sensitive: Places of the coefficients whose sensitivities are wanted.
        spread: Whether they and covariances are wanted.
        every: From one start to the next [s].
    """
    record = motion.record
    step, count = record.step, len(record.times)
    marks = np.array([max(1, round(horizon / step)) for horizon in wanted])
    lead, pace = round(LEAD / step), max(1, round(every / step))
    begin = np.arange(lead, max(lead + 1, count - marks[0]), pace)
    speed = np.hypot(motion.states[:, 3], motion.states[:, 4])
    run = np.concatenate([[0.0], np.cumsum(0.5 * step * (speed[1:] + speed[:-1]))])
    m = len(marks)
    k = len(sensitive) if spread else 0
    states, measured = np.full((len(begin), m, 6), np.nan), np.full((len(begin), m, 6), np.nan)
    distance = np.full((len(begin), m), np.nan)
    sensitivity, covariance = np.zeros((len(begin), m, 6, k)), np.zeros((len(begin), m, 4, 6, 6))
    reachable = np.array([int(np.sum(at + marks < count)) for at in begin])
    for number in np.unique(reachable[reachable > 0]):
        here = reachable == number
        first = motion.states[begin[here]]
        x, _, S, P = engine.loops().predict(
            np.ascontiguousarray(first[:, :6]), begin[here], marks[:number], np.ascontiguousarray(record.inputs),
            parameters, np.asarray(sensitive, dtype=np.int64), np.ascontiguousarray(first[:, 6:8]), step,
            substeps(step), spread,
        )  # fmt: skip
        states[here, :number], sensitivity[here, :number], covariance[here, :number] = x, S, P
        ends = begin[here][:, None] + marks[:number]
        measured[here, :number] = motion.states[ends, :6]
        distance[here, :number] = run[ends] - run[begin[here]][:, None]
    return Rollouts(
        begin=begin, horizons=tuple(wanted), states=states, measured=measured, distance=distance,
        sensitivity=sensitivity, covariance=covariance,
    )  # fmt: skip


def persistence(motion: Motion, wanted: Sequence[float], every: float = EVERY) -> Rollouts:
    """What `roll` would predict if each velocity stayed as it is: a model is worth nothing that does no better."""
    still = vector({})
    return roll(still, motion, wanted, every=every)


def rms(shares: Sequence[Array]) -> Array:
    """Root mean square (m,) of shares (s, m) of several motions; NaN where none reaches a horizon."""
    together = np.concatenate(list(shares))
    there = np.isfinite(together)
    counts = there.sum(axis=0)
    squares = np.where(there, together, 0.0) ** 2
    return np.where(counts > 0, np.sqrt(squares.sum(axis=0) / np.maximum(counts, 1)), np.nan)
