"""Fit of segments: Gauss-Newton, damped, on parameters and nuisances, each segment from a first state of its own.

Model errors and noise of the process cannot grow over a whole record, and from a wrong start no segment runs away: what
is fitted is the motion over some seconds (multiple shooting without continuity).
"""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification.fit import DEFAULT_FREE, Fit, check, invert, residual_summary, with_values
from auvsim.identification.least_squares import first_values
from auvsim.identification.records import Record
from auvsim.identification.segment_problem import LOSSES, Point, Problem, SegmentOptions, minimise
from auvsim.identification.states import smoothed
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters

_UNLIKELY = 5.0  # deviations of chi-square beyond which the lowest point from the start may not be the lowest of all
_LONGER = 4.0  # times longer segments have other false bottoms: they fail from one start in 50, and not from the same
_FROM_WHOLE = 20.0  # segments from which a fit of whole records may start [s]


def fit_segments(
    records: Sequence[Record],
    start: PlanarParameters,
    free: Sequence[str] = DEFAULT_FREE,
    options: SegmentOptions | None = None,
) -> Fit:
    """Fits the free parameters to all records at once.

    It goes down from the start. Where that does not converge, or ends higher than the sensors' noise explains, it goes
    down from least squares too, then from a fit of other segments, and keeps the lowest end. The covariance is that of
    Gauss and Newton, for the deviations that the records assume.

    Raises:
        InputError: Records, names or options that cannot be used.
    """
    options = options or SegmentOptions()
    check(records, start)
    _check_options(options)
    states = [smoothed(record, start, options.nuisances.vector()) for record in records]
    problem = Problem(records, start, free, options, options.length, states)
    point, iterations, converged = _lowest(problem, start, states)
    if not np.isfinite(point.cost):
        raise InputError(f"record {records[0].name}: the model runs away from the start; give it shorter segments")
    return _report(problem, start, point, iterations, converged)


def _lowest(problem: Problem, start: PlanarParameters, states: Sequence[Array]) -> tuple[Point, int, bool]:
    """The lowest end from several starts, all their iterations, and whether it converged.

    No more are tried once noise explains an end, or two starts have come to the same.
    """
    point, iterations, converged = _down(problem, problem.start.vector()[problem.indices])
    others = _other_starts(problem, start, states)
    while not converged or _unlikely(point):
        values, before = next(others, (None, 0))
        if values is None:
            break
        other, used, ended = _down(problem, values)
        iterations += before + used
        same = converged and ended and abs(other.cost - point.cost) < problem.options.tolerance
        if other.cost < point.cost + (problem.options.tolerance if ended else 0.0):
            point, converged = other, ended
        if same:
            break
    return point, iterations, converged


def _other_starts(problem: Problem, start: PlanarParameters, states: Sequence[Array]) -> Iterator[tuple[Array, int]]:
    """Values (k,) of the free parameters from which to go down, and the iterations that they took."""
    options, records = problem.options, [cut.record for cut in problem.cuts]
    values = first_values(records, states, start, problem.free)
    yield values, 0
    length = _LONGER * options.length if math.isfinite(options.length) else _FROM_WHOLE
    point, used, _ = _down(Problem(records, start, problem.free, options, length, states), values)
    yield point.values, used


def _down(problem: Problem, values: Array) -> tuple[Point, int, bool]:
    """Down from values (k,) of the free parameters; see `minimise`."""
    held = [cut.held for cut in problem.cuts]
    first = problem.at(np.clip(values, problem.low, problem.high), problem.nuisances, held)
    return minimise(problem, first, problem.options.tolerance)


def _unlikely(point: Point) -> bool:
    """Whether the sum of squares is more than noise of the assumed size would leave in any but one of a million."""
    samples = sum(int(np.isfinite(e).sum()) for e in point.residuals)
    return 2.0 * point.cost > samples + _UNLIKELY * math.sqrt(2.0 * samples)


def profile(
    records: Sequence[Record], fit: Fit, name: str, options: SegmentOptions | None = None
) -> Callable[[float], float]:
    """The lowest cost as a function of one free parameter, all else fitted anew; each call begins where the last ended.

    Args:
        records: Those that were fitted.
        fit: What `fit_segments` gave.
        name: The parameter.
        options: Those of the fit.
    """
    options = options or SegmentOptions()
    deviations = options.nuisances.vector()
    states = [smoothed(record, fit.start, deviations) for record in records]
    problem = Problem(records, fit.start, fit.free, options, options.length, states)
    j = fit.free.index(name)
    fixed = np.arange(len(fit.free)) == j
    point = problem.at(fit.values, fit.nuisances, [cut.held for cut in problem.cuts])

    def lowest(value: float) -> float:
        nonlocal point
        values = np.where(fixed, value, point.values)
        point, _, _ = minimise(problem, problem.at(values, point.nuisances, point.starts), options.tolerance, fixed)
        return point.cost

    return lowest


def _check_options(options: SegmentOptions) -> None:
    if options.loss not in LOSSES:
        raise InputError(f"no loss '{options.loss}'; there are {', '.join(LOSSES)}")
    if not options.length > 0.0:
        raise InputError(f"segments of {options.length} s; their length must be positive")
    if options.prior is not None and not options.prior > 0.0:
        raise InputError(f"a weak prior of relative deviation {options.prior}; it must be positive, or None")


def _report(problem: Problem, start: PlanarParameters, point: Point, iterations: int, converged: bool) -> Fit:
    k = len(problem.free)
    information, _, _ = problem.reduced(point, 0.0)
    covariance = invert(information)
    own = np.zeros_like(point.nuisances)
    own[problem.active] = np.sqrt(np.diag(covariance)[k:])
    first = problem.at(problem.start.vector()[problem.indices], point.nuisances, point.starts)
    # From the fit's first states one step is all but the lowest, and where it is not the start is far off in any case.
    first, _, _ = minimise(problem, first, max(problem.options.tolerance, first.cost), np.ones(k, dtype=bool))
    rms, white = residual_summary(point.residuals)
    limit = "" if converged else f"stopped after {iterations} iterations before it had converged"
    return Fit(
        method="segments",
        start=start,
        parameters=with_values(start, problem.free, point.values),
        free=problem.free,
        covariance=covariance[:k, :k],
        nuisances=point.nuisances,
        nuisance_deviations=own,
        residual_rms=rms,
        whiteness=white,
        cost=point.cost,
        start_cost=first.cost,
        samples=int(sum(np.isfinite(e).sum() for e in point.residuals)),
        iterations=iterations,
        converged=converged,
        message=limit or "converged",
    )
