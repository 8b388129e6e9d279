"""Fit of segments: Gauss-Newton, damped, on parameters and nuisances, each segment from a first state of its own.

Model errors and noise of the process cannot grow over a whole record, and from a wrong start no segment runs away: what
is fitted is the motion over some seconds (multiple shooting without continuity).
"""

from collections.abc import Callable, Sequence

import numpy as np

from auvsim.errors import InputError
from auvsim.identification.fit import DEFAULT_FREE, MASSES, Fit, check, invert, residual_summary, with_values
from auvsim.identification.least_squares import regress
from auvsim.identification.records import Record
from auvsim.identification.segment_problem import LOSSES, Point, Problem, SegmentOptions, minimise
from auvsim.identification.states import smoothed
from estimators.planar_model import PlanarParameters
from estimators.types import Array

_ROUGH = 1.0  # `tolerance` of the shorter segments that come first


def fit_segments(
    records: Sequence[Record],
    start: PlanarParameters,
    free: Sequence[str] = DEFAULT_FREE,
    options: SegmentOptions | None = None,
) -> Fit:
    """Fits the free parameters to all records at once, from the start or from least squares, whichever is nearer.

    The covariance is that of Gauss and Newton, for the deviations that the records believe.

    Raises:
        InputError: Records, names or options that cannot be used.
    """
    options = options or SegmentOptions()
    check(records, start)
    _check_options(options)
    deviations = options.nuisances.vector()
    states = [smoothed(record, start, deviations) for record in records]
    lengths = [*(length for length in options.schedule if length < options.length), options.length]
    problem = Problem(records, start, free, options, lengths[0], states)
    point = _begin(problem, states)
    iterations, converged = 0, False
    for length in lengths:
        if length != lengths[0]:
            problem = Problem(records, start, free, options, length, states)
            point = problem.at(point.values, point.nuisances, [cut.held for cut in problem.cuts])
        tolerance = options.tolerance if length == options.length else max(_ROUGH, options.tolerance)
        point, used, converged = minimise(problem, point, tolerance)
        iterations += used
    return _report(problem, point, iterations, converged)


def _begin(problem: Problem, states: Sequence[Array]) -> Point:
    """The better of the start and of what least squares make of the smoothed states."""
    held = [cut.held for cut in problem.cuts]
    own = problem.start.vector()[problem.indices]
    point = problem.at(np.clip(own, problem.low, problem.high), problem.nuisances, held)
    if any(name in MASSES for name in problem.free):
        return point
    records = [cut.record for cut in problem.cuts]
    values, *_ = regress(records, states, problem.start, problem.indices)
    other = problem.at(np.clip(values, problem.low, problem.high), problem.nuisances, held)
    return other if other.cost < point.cost else point


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
    if not (options.length > 0.0 and all(0.0 < length < np.inf for length in options.schedule)):
        raise InputError(f"segments of {options.length} s after {options.schedule} s; lengths must be positive")
    if options.prior is not None and not options.prior > 0.0:
        raise InputError(f"a weak prior of relative deviation {options.prior}; it must be positive, or None")


def _report(problem: Problem, point: Point, iterations: int, converged: bool) -> Fit:
    k = len(problem.free)
    information, _, _ = problem.reduced(point, 0.0)
    covariance = invert(information)
    own = np.zeros_like(point.nuisances)
    own[problem.active] = np.sqrt(np.diag(covariance)[k:])
    first = problem.at(problem.start.vector()[problem.indices], point.nuisances, [cut.held for cut in problem.cuts])
    first, _, _ = minimise(problem, first, problem.options.tolerance, np.ones(k, dtype=bool))
    rms, white = residual_summary(point.residuals)
    limit = "" if converged else f"stopped after {iterations} iterations before it had converged"
    return Fit(
        method="segments",
        start=problem.start,
        parameters=with_values(problem.start, problem.free, point.values),
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
