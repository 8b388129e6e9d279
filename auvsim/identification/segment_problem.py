"""Records cut into segments, the sum of squares of their unknowns, and the way down it.

Unknowns are the free parameters, the nuisances of each record and the first state of each segment. First states are
eliminated segment by segment, so that the work grows linearly with the records.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Literal, NamedTuple, Protocol

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification import compiled
from auvsim.identification.constraints import bounded_step, has_inertia, limits, prior_information
from auvsim.identification.fit import Indices, Mask, Nuisances, free_indices
from auvsim.identification.records import Record
from auvsim.identification.states import substeps
from estimators.core.types import Array
from estimators.planar.model import PARAMETER_NAMES, PlanarParameters

Loss = Literal["squares", "huber", "cauchy"]
LOSSES: tuple[Loss, ...] = ("squares", "huber", "cauchy")
# Deviations about the smoothed state at which a segment's first state is held, so that one that a short segment does
# not show stays where a vehicle can be; hundreds of times wider than what is measured.
FIRST = np.array([100.0, 100.0, 1.0, 1.0, 1.0, 1.0])
_DAMPING = 1e-3  # first share of the diagonal; collinear combinations have eigenvalues of 1e-4 and less


@dataclass(frozen=True, kw_only=True, slots=True)
class SegmentOptions:
    """How segments are cut and weighed."""

    length: float = 5.0  # of a segment [s]; infinite: each record is one
    nuisances: Nuisances = field(default_factory=Nuisances)
    loss: Loss = "squares"
    threshold: float = 2.5  # of a robust loss, in deviations
    signs: bool = False  # keeps the parameters of constraints.SIGNS on their side of zero
    prior: float | None = None  # weak prior: the start, with this relative deviation
    prior_on: tuple[str, ...] | None = None  # parameters with a prior; None: all
    max_iterations: int = 50
    tolerance: float = 1e-4  # stops where a step would lower half the sum of squares by less: a deviation's hundredth


class Vector(Protocol):
    """Parameters of any model that can be written out in the order of its names."""

    def vector(self) -> Array:
        """All values."""
        ...


class Equations(NamedTuple):
    """A model whose motion is fitted."""

    names: tuple[str, ...]  # of its parameters
    loops: Callable[[], ModuleType]  # `segment_loops` behind its accelerations
    admissible: Callable[[Array], bool]  # whether a vehicle can have these parameters


PLANAR = Equations(
    PARAMETER_NAMES,
    compiled.segments,
    lambda p: has_inertia(PlanarParameters(**dict(zip(PARAMETER_NAMES, p.tolist(), strict=True)))),
)


class _Cut(NamedTuple):
    """A record in segments, as the compiled loops take it."""

    record: Record
    inputs: Array
    measured: Array
    weights: Array  # (8,)
    bounds: Indices  # (s + 1,)
    held: Array  # (s, 6) first states about which they are held


class Point(NamedTuple):
    """Unknowns and what the data say of them there."""

    values: Array  # (k,) free parameters
    nuisances: Array  # (records, 6)
    starts: list[Array]  # of each record (s, 6)
    cost: float
    normal_equations: list[tuple[Array, Array]]  # matrices and gradients of each record
    residuals: list[Array]  # of each record (n, 8)


class Problem:
    """Records cut into segments of one length, and the sum of squares of their unknowns.

    Args:
        records: What was measured.
        start: Where parameters start, and those that stay.
        free: Names of the free ones.
        options: How it is weighed.
        length: Of a segment [s].
        states: Of each record, (n, 12), round which first states lie.
        equations: Of the model.
        prior: Information (k, k) of a prior on the free parameters about the start; None: that of the options.
        first: Deviations (6,) about the smoothed states at which first states are held.
    """

    def __init__(
        self,
        records: Sequence[Record],
        start: Vector,
        free: Sequence[str],
        options: SegmentOptions,
        length: float,
        states: Sequence[Array],
        equations: Equations = PLANAR,
        prior: Array | None = None,
        first: Array = FIRST,
    ) -> None:
        self.free, self.options, self.start = tuple(free), options, start
        self.indices = free_indices(free, equations.names)
        self.low, self.high = limits(free, options.signs)
        self._loops, self._admissible = equations.loops(), equations.admissible
        self._vector = start.vector()
        self.cuts = [_cut(record, length, x) for record, x in zip(records, states, strict=True)]
        deviations = options.nuisances.vector()
        self.active = np.array([active_nuisances(record, deviations) for record in records])  # (records, 6)
        self._expected = np.zeros((len(records), 6))
        for r, record in enumerate(records):
            if record.current is not None:
                self._expected[r, :2] = record.current
        self._trust = np.where(self.active, 1.0 / np.where(deviations > 0.0, deviations, 1.0) ** 2, 0.0)
        own = prior_information(self._vector[self.indices], free, options.prior, options.prior_on)
        self._prior = np.diag(own) if prior is None else prior
        self._held = 1.0 / first**2
        self.nuisances = np.where(self.active, np.array([x[-1, 6:] for x in states]), self._expected)
        self.nuisances[:, 2:] = 0.0

    def at(self, values: Array, nuisances: Array, starts: list[Array]) -> Point:
        """Cost, matrices and gradients at some unknowns; the cost is infinite where a motion is not finite."""
        p = self._vector.copy()
        p[self.indices] = values
        loss = LOSSES.index(self.options.loss)
        aside = values - self._vector[self.indices]
        cost = 0.5 * float(aside @ self._prior @ aside)
        cost += 0.5 * float(np.sum(self._trust * (nuisances - self._expected) ** 2))
        normal_equations, residuals = [], []
        if not self._admissible(p):
            cost = np.inf
        for cut, own, first in zip(self.cuts, nuisances, starts, strict=True):
            e = np.full(cut.measured.shape, np.nan)
            step = cut.record.step
            part, H, g = self._loops.normal_equations(
                first, cut.bounds, cut.inputs, cut.measured, cut.weights, p, self.indices, own, step, substeps(step),
                loss, self.options.threshold, e,
            )  # fmt: skip
            away = cut.held - first
            cost += part + 0.5 * float(np.sum(away**2 * self._held))
            H[:, range(6), range(6)] += self._held
            g[:, :6] += away * self._held
            normal_equations.append((H, g))
            residuals.append(e)
        return Point(values, nuisances, starts, cost, normal_equations, residuals)

    def reduced(self, point: Point, damping: float) -> tuple[Array, Array, list[Array]]:
        """Equations (T, T) and (T,) of parameters, then active nuisances; back-substitution of the first states.

        Raises:
            InputError: The first state of a segment cannot be eliminated.
        """
        k = len(self.free)
        size = k + int(self.active.sum())
        total, gradient, back_substitution = np.zeros((size, size)), np.zeros(size), []
        total[:k, :k] += self._prior
        gradient[:k] += self._prior @ (self._vector[self.indices] - point.values)
        for r, (H, g) in enumerate(point.normal_equations):
            part, descent, matrix, solved = self._loops.eliminate(H, g, damping)
            if not solved:
                raise InputError(f"record {self.cuts[r].record.name}: a segment does not show its first state")
            places, here = self._places(r)
            total[np.ix_(places, places)] += part[np.ix_(here, here)]
            gradient[places] += descent[here]
            own = places[k:]
            total[own, own] += self._trust[r, self.active[r]]
            gradient[own] += (self._trust[r] * (self._expected[r] - point.nuisances[r]))[self.active[r]]
            back_substitution.append(matrix)
        return total, gradient, back_substitution

    def moved(self, point: Point, step: Array, back_substitution: list[Array]) -> Point:
        """The unknowns after a step (T,) of parameters and nuisances."""
        k = len(self.free)
        nuisances, starts = point.nuisances.copy(), []
        for r, matrix in enumerate(back_substitution):
            places, here = self._places(r)
            nuisances[r, self.active[r]] += step[places[k:]]
            starts.append(point.starts[r] + matrix[:, :, -1] - matrix[:, :, here] @ step[places])
        return self.at(point.values + step[:k], nuisances, starts)

    def _places(self, r: int) -> tuple[Indices, Indices]:
        """Places of a record's unknowns among all, and among those of its own equations."""
        k = len(self.free)
        before = k + int(self.active[:r].sum())
        own = int(self.active[r].sum())
        here = np.concatenate([np.arange(k), k + np.flatnonzero(self.active[r])])
        return np.concatenate([np.arange(k), np.arange(before, before + own)]), here


def minimise(problem: Problem, point: Point, tolerance: float, fixed: Mask | None = None) -> tuple[Point, int, bool]:
    """Levenberg and Marquardt's way down, on unknowns in units of their own curvature, damped as by Nielsen (1999).

    Args:
        problem: Whose cost it is.
        point: Where to begin.
        tolerance: As that of `SegmentOptions`.
        fixed: Which free parameters (k,) stay nevertheless; none if None.

    Returns:
        The lowest point, the iterations, and whether no step would lower the cost any more.
    """
    damping, growth = _DAMPING, 2.0
    low, high = problem.low, problem.high
    if fixed is not None:
        low, high = np.where(fixed, point.values, low), np.where(fixed, point.values, high)
    if not np.isfinite(point.cost):
        return point, 0, False
    for iteration in range(1, problem.options.max_iterations + 1):
        H, g, back_substitution = problem.reduced(point, damping)
        step = bounded_step(H, g, damping, low - point.values, high - point.values)
        pairs = zip(point.normal_equations, back_substitution, strict=True)
        eliminated = sum(np.sum(g[:, :6] * matrix[:, :, -1]) for (_, g), matrix in pairs)
        gain = 0.5 * float(g @ step + eliminated)
        trial = problem.moved(point, step, back_substitution)
        last = gain < tolerance and damping <= 1e-3
        if not trial.cost < point.cost:
            if last or damping > 1e12:
                return point, iteration, last
            damping, growth = damping * growth, 2.0 * growth
            continue
        if last:
            return trial, iteration, True
        ratio = (point.cost - trial.cost) / gain
        least = 0.1 if abs(ratio - 1.0) < 0.1 else 1.0 / 3.0  # faster where the sum of squares is all but quadratic
        damping, growth = max(damping * max(least, 1.0 - (2.0 * ratio - 1.0) ** 3), 1e-9), 2.0
        point = trial
    return point, problem.options.max_iterations, False


def _cut(record: Record, length: float, states: Array) -> _Cut:
    samples = len(record.times)
    size = samples if np.isinf(length) else min(samples, max(2, round(length / record.step)))
    bounds = np.arange(0, samples, size)
    if samples - bounds[-1] < max(2, size // 2):  # the rest goes to the last whole one
        bounds = bounds[:-1] if len(bounds) > 1 else bounds
    there = np.isfinite(record.measured).any(axis=0)
    weights = np.where(there, 1.0 / np.where(there, record.deviations, 1.0), 0.0)
    return _Cut(
        record,
        np.ascontiguousarray(record.inputs, dtype=float),
        np.ascontiguousarray(record.measured, dtype=float),
        weights,
        np.append(bounds, samples),
        states[bounds, :6].copy(),
    )


def active_nuisances(record: Record, deviations: Array) -> Mask:
    """Which nuisances (6,) a record has: those with a prior deviation that touch a channel that was measured."""
    north, east, heading, surge, sway, rate, over_u, over_v = (
        bool(np.isfinite(values).any()) for values in record.measured.T
    )
    log, ground = surge or sway or over_u or over_v, north or east or over_u or over_v
    current = ground and record.current is None
    return np.array([current, current, rate, heading, log, log]) & (deviations > 0.0)
