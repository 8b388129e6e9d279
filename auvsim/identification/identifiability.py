"""Which parameters, and which combinations of them, the data can tell; and intervals where curvature is not enough."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from auvsim.base.errors import InputError, unknown_name
from auvsim.identification import prediction_error, segments
from auvsim.identification.fit import Fit
from auvsim.identification.prediction_error import PredictionErrorOptions
from auvsim.identification.records import Record
from auvsim.identification.segments import SegmentOptions
from estimators.core.consistency import chi_square
from estimators.core.types import Array

WEAK = 0.5  # relative deviation beyond which a parameter, or a combination, is not known
TIED = 0.95  # correlation beyond which two parameters go together
_NAMED = 0.3  # share of a combination from which on a parameter is named in it
_FARTHEST = 100.0  # an interval's end beyond so many times the parameter is open


@dataclass(frozen=True, kw_only=True, slots=True)
class Combination:
    """A direction among the relative parameters, and how well it is known."""

    weights: Array  # (k,) of unit length, in the order of the free parameters
    deviation: float  # relative standard deviation along it
    text: str  # for example "0.71 Y_uv + 0.70 Y_ur"
    named: tuple[str, ...]  # the parameters in it


@dataclass(frozen=True, kw_only=True, slots=True)
class Identifiability:
    """What a fit's covariance says of its parameters; relative to their sizes."""

    names: tuple[str, ...]  # from the best known to the worst
    relative: Array  # (k,) their relative standard deviations, in that order
    combinations: tuple[Combination, ...]  # all k, from the best known to the worst
    tied: tuple[tuple[str, str, float], ...]  # pairs that go together, and their correlation

    @property
    def weak(self) -> tuple[str, ...]:
        """Parameters that the data do not tell by themselves."""
        return tuple(name for name, r in zip(self.names, self.relative, strict=True) if not r <= WEAK)

    @property
    def blind(self) -> tuple[Combination, ...]:
        """Combinations that the data cannot tell apart from nothing."""
        return tuple(c for c in self.combinations if not c.deviation <= WEAK)

    @property
    def identifiable(self) -> bool:
        """Whether every combination is told."""
        return not self.blind


def sizes(fit: Fit) -> Array:
    """What free parameters (k,) are compared to: the larger of start and fit; one where both are zero."""
    start = np.array([getattr(fit.start, name) for name in fit.free])
    size = np.maximum(np.abs(start), np.abs(fit.values))
    return np.where(size > 0.0, size, 1.0)


def assess(fit: Fit) -> Identifiability:
    """Ranks parameters and combinations by their relative deviations.

    The relative covariance is decomposed into its axes; a parameter that no data show is an axis of its own, known to
    no accuracy at all.
    """
    size = sizes(fit)
    seen = np.isfinite(np.diag(fit.covariance))
    k = len(fit.free)
    relative = np.where(seen, fit.deviations / size, np.inf)
    part = (fit.covariance / np.outer(size, size))[np.ix_(seen, seen)]
    values, vectors = np.linalg.eigh(part) if seen.any() else (np.empty(0), np.empty((0, 0)))
    axes = []
    for value, vector in zip(values, vectors.T, strict=True):
        weights = np.zeros(k)
        weights[seen] = vector * np.sign(vector[np.argmax(np.abs(vector))])
        axes.append(_combination(fit.free, weights, math.sqrt(max(float(value), 0.0))))
    axes += [_combination(fit.free, np.eye(k)[j], math.inf) for j in np.flatnonzero(~seen)]
    order = np.argsort(relative)
    with np.errstate(invalid="ignore"):
        correlation = np.where(np.outer(seen, seen), fit.correlation, 0.0)
    tied = [
        (fit.free[i], fit.free[j], float(correlation[i, j]))
        for i in range(k)
        for j in range(i + 1, k)
        if abs(correlation[i, j]) > TIED
    ]
    return Identifiability(
        names=tuple(fit.free[j] for j in order),
        relative=relative[order],
        combinations=tuple(axes),
        tied=tuple(sorted(tied, key=lambda pair: -abs(pair[2]))),
    )


def likelihood_interval(
    records: Sequence[Record],
    fit: Fit,
    name: str,
    options: SegmentOptions | PredictionErrorOptions | None = None,
    probability: float = 0.95,
) -> tuple[float, float]:
    """Interval of a parameter by the ratio of likelihoods: where the best fit with it fixed becomes too unlikely.

    Asymmetric where the curvature at the optimum says too little; infinite on a side that is open.

    Args:
        records: Those that were fitted.
        fit: By segments or prediction error.
        name: A free parameter.
        options: Those of the fit; its method's defaults if None.
        probability: Of the interval.

    Raises:
        InputError: The parameter was not free, or the fit is of another method than the options.
    """
    if name not in fit.free:
        raise unknown_name("free parameter of the fit", name, list(fit.free))
    if fit.method == "segments" and not isinstance(options, PredictionErrorOptions):
        profile = segments.profile(records, fit, name, options)
    elif fit.method == "prediction error" and not isinstance(options, SegmentOptions):
        profile = prediction_error.profile(records, fit, name, options)
    else:
        raise InputError(f"no likelihood intervals of a fit by {fit.method} with {type(options).__name__}")
    j = fit.free.index(name)
    reach = math.sqrt(chi_square(probability, 1))
    size = float(sizes(fit)[j])
    step = min(float(fit.deviations[j]) * reach, 2.0 * size)
    low, high = (_crossing(profile, float(fit.values[j]), side * step, reach, _FARTHEST * size) for side in (-1, 1))
    return low, high


def _crossing(profile: Callable[[float], float], best: float, step: float, reach: float, farthest: float) -> float:
    """Where the root of twice the loss of log likelihood reaches `reach`: it is nearly linear, so a few secants do."""
    lowest = profile(best)

    def root(distance: float) -> float:
        return math.sqrt(max(2.0 * (profile(best + distance) - lowest), 0.0)) - reach

    inside, value_inside = 0.0, -reach
    outside = step
    while not (value := root(outside)) > 0.0:
        inside, value_inside = outside, value
        outside *= 2.0
        if abs(outside) > farthest:
            return math.copysign(math.inf, step)
    for _ in range(20):
        share = value_inside / (value_inside - value) if math.isfinite(value) else 0.5
        middle = inside + min(max(share, 0.1), 0.9) * (outside - inside)
        at = root(middle)
        if abs(at) < 0.01:
            return best + middle
        if at > 0.0:
            outside, value = middle, at
        else:
            inside, value_inside = middle, at
    return best + inside


def _combination(free: Sequence[str], weights: Array, deviation: float) -> Combination:
    order = [j for j in np.argsort(-np.abs(weights)) if abs(weights[j]) >= _NAMED]
    text = " ".join(f"{'-' if weights[j] < 0.0 else '+'} {abs(weights[j]):.2f} {free[j]}" for j in order)
    named = tuple(str(free[int(j)]) for j in order)
    return Combination(weights=weights, deviation=deviation, text=text.removeprefix("+ "), named=named)
