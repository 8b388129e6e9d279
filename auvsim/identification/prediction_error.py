"""Prediction error: the parameters under which a filter's own innovations are most likely, noise of the process too.

Where noise of the process moves the vehicle, a model that runs freely is wrong about where it is, and fits its
parameters to that. A filter is corrected by every measurement; what it then still gets wrong is the model (Ljung 1999,
7; Astrom 1980). Current and biases are states of the filter, so only parameters and densities are searched, by Fisher
scoring with derivatives of innovations by differences of compiled filter runs.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from auvsim.base.errors import InputError, unknown_name
from auvsim.identification import compiled
from auvsim.identification.constraints import bounded_step, has_inertia, limits, prior_information
from auvsim.identification.fit import (
    DEFAULT_FREE,
    Fit,
    Mask,
    Nuisances,
    check,
    free_indices,
    invert,
    residual_summary,
    with_values,
)
from auvsim.identification.least_squares import first_values
from auvsim.identification.records import Record
from auvsim.identification.states import first_belief, smoothed, substeps
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters

NOISES = ("north", "east", "heading", "surge", "sway", "yaw_rate")
_FLOOR, _CEILING = math.log(1e-14), math.log(1e2)  # of the densities
_PROBE = 1e-5  # differences change an acceleration by this much [m/s^2, rad/s^2], and logarithms of densities by
_PROBE_LOG = 1e-4
_STRIDE = 2.0  # longest step of a density's logarithm: one that falls to nothing at once leaves no gradient behind


@dataclass(frozen=True, kw_only=True, slots=True)
class PredictionErrorOptions:
    """Settings of the filter, and which of its noises are fitted."""

    noise: tuple[str, ...] = ("surge", "sway", "yaw_rate")  # densities that are fitted, of NOISES
    densities: tuple[float, ...] = (0.0, 0.0, 0.0, 1e-4, 1e-4, 1e-5)  # where they start (6,), units as Fit.noise
    current: float = 0.0  # random walk of the current [m^2/s^3]
    nuisances: Nuisances = field(default_factory=Nuisances)
    signs: bool = False  # as in SegmentOptions
    prior: float | None = None  # as in SegmentOptions
    prior_on: tuple[str, ...] | None = None  # as in SegmentOptions
    # Longest step of the filter's midpoint rule [s]: in steps of 0.1 s its error of (0.1 lambda)^2 / 6, 0.3 % at a yaw
    # that decays with lambda = 1.3 1/s, would go into the parameters.
    max_substep: float = 0.05
    max_iterations: int = 40
    tolerance: float = 1e-4  # stops where a step would raise the log likelihood by less


class _Point(NamedTuple):
    unknowns: Array  # (k + d,) free parameters, logarithms of densities
    cost: float
    innovations: list[tuple[Array, Array]]  # of each record, and their variances (n, 8)


class Likelihood:
    """Negative log likelihood of records, as a function of free parameters and logarithms of densities."""

    def __init__(
        self,
        records: Sequence[Record],
        start: PlanarParameters,
        free: Sequence[str],
        options: PredictionErrorOptions,
    ) -> None:
        self.records, self.start, self.free, self.options = tuple(records), start, tuple(free), options
        self.indices = free_indices(free)
        self.noisy = np.array([NOISES.index(name) for name in options.noise], dtype=int)
        self._vector = start.vector()
        self._loops = compiled.filters()
        deviations = options.nuisances.vector()
        self._beliefs = [first_belief(record, start, deviations) for record in records]
        self._data = [
            (np.ascontiguousarray(record.inputs, dtype=float), np.ascontiguousarray(record.measured, dtype=float))
            for record in records
        ]
        self.probes = np.concatenate([self._parameter_probes(deviations), np.full(len(self.noisy), _PROBE_LOG)])
        low, high = limits(free, options.signs)
        self.low = np.concatenate([low, np.full(len(self.noisy), _FLOOR)])
        self.high = np.concatenate([high, np.full(len(self.noisy), _CEILING)])
        self.trust = np.zeros(len(self.low))  # of the weak prior
        self.centre = np.zeros(len(self.low))
        self.centre[: len(free)] = self._vector[self.indices]
        self.trust[: len(free)] = prior_information(self.centre[: len(free)], free, options.prior, options.prior_on)

    def split(self, unknowns: Array) -> tuple[PlanarParameters, Array]:
        """Parameters and densities (12,) of the filter's states."""
        k = len(self.free)
        q = np.zeros(12)
        q[:6], q[6:8] = self.options.densities, self.options.current
        q[self.noisy] = np.exp(unknowns[k:])
        return with_values(self.start, self.free, unknowns[:k]), q

    def at(self, unknowns: Array) -> _Point:
        """Cost and innovations; the cost is infinite where the filter fails or the inertia is not positive."""
        parameters, q = self.split(unknowns)
        cost = 0.5 * float(self.trust @ (unknowns - self.centre) ** 2)
        innovations = []
        if not has_inertia(parameters):
            return _Point(unknowns, math.inf, innovations)
        for record, (inputs, measured), (mean, covariance) in zip(self.records, self._data, self._beliefs, strict=True):
            e, s = np.empty_like(measured), np.empty_like(measured)
            cost += self._loops.track(
                mean.copy(), covariance.copy(), inputs, measured, record.deviations**2, parameters.vector(), q,
                record.step, substeps(record.step, self.options.max_substep), e, s,
            )  # fmt: skip
            innovations.append((e, s))
        return _Point(unknowns, cost, innovations)

    def information(self, point: _Point) -> tuple[Array, Array]:
        """Fisher's information (t, t) and the gradient (t,) of the cost at a point."""
        e, s = _flat(point)
        size = len(point.unknowns)
        de, ds = np.empty((size, e.size)), np.empty((size, e.size))
        for j, probe in enumerate(self.probes):
            aside = np.zeros(size)
            aside[j] = probe
            (e_up, s_up), (e_down, s_down) = (
                _flat(self.at(point.unknowns + aside)),
                _flat(self.at(point.unknowns - aside)),
            )
            de[j], ds[j] = (e_up - e_down) / (2.0 * probe), (s_up - s_down) / (2.0 * probe)
        gradient = de @ (e / s) + 0.5 * (ds @ (1.0 / s - e**2 / s**2)) + self.trust * (point.unknowns - self.centre)
        return (de / s) @ de.T + 0.5 * (ds / s**2) @ ds.T + np.diag(self.trust), gradient

    def report(self, point: _Point, information: Array, iterations: int, converged: bool) -> Fit:
        """The fit at a point; costs of the start are those with its densities."""
        k = len(self.free)
        parameters, q = self.split(point.unknowns)
        covariance = invert(information)
        rms, white = residual_summary([e / np.sqrt(s) for e, s in point.innovations])
        own, deviations = self._last_nuisances(parameters, q)
        noise_deviations = np.full(6, np.nan)
        noise_deviations[self.noisy] = np.sqrt(np.diag(covariance)[k:])
        before = np.concatenate([self.centre[:k], point.unknowns[k:]])
        return Fit(
            method="prediction error",
            start=self.start,
            parameters=parameters,
            free=self.free,
            covariance=covariance[:k, :k],
            nuisances=own,
            nuisance_deviations=deviations,
            residual_rms=rms,
            whiteness=white,
            cost=point.cost,
            start_cost=self.at(before).cost,
            samples=int(sum(np.isfinite(e).sum() for e, _ in point.innovations)),
            iterations=iterations,
            converged=converged,
            message="converged" if converged else f"stopped after {iterations} iterations before it had converged",
            noise=q[:6],
            noise_deviations=noise_deviations,
        )

    def _last_nuisances(self, parameters: PlanarParameters, q: Array) -> tuple[Array, Array]:
        """Current and biases (records, 6) after all of a record, and their deviations."""
        means, deviations = [], []
        for record, (inputs, measured), (mean, covariance) in zip(self.records, self._data, self._beliefs, strict=True):
            x, P = self._loops.trace(
                mean.copy(), covariance.copy(), inputs, measured, record.deviations**2, parameters.vector(), q,
                record.step, substeps(record.step, self.options.max_substep),
            )  # fmt: skip
            means.append(x[-1, 6:])
            deviations.append(np.sqrt(np.maximum(np.diag(P[-1])[6:], 0.0)))
        return np.array(means), np.array(deviations)

    def _parameter_probes(self, deviations: Array) -> Array:
        """Differences (k,) of the parameters that change the accelerations on these records by _PROBE in the mean."""
        squares, count = np.zeros(len(self.indices)), 0
        for record, (inputs, _) in zip(self.records, self._data, strict=True):
            way = smoothed(record, self.start, deviations)
            _, terms = compiled.segments().regressors(way, inputs, self._vector, self.indices)
            squares += np.sum(terms**2, axis=(0, 1))
            count += len(way)
        rms = np.sqrt(squares / count)
        return np.where(rms > 0.0, _PROBE / np.where(rms > 0.0, rms, 1.0), _PROBE)


def fit_prediction_error(
    records: Sequence[Record],
    start: PlanarParameters,
    free: Sequence[str] = DEFAULT_FREE,
    options: PredictionErrorOptions | None = None,
    *,
    guess: PlanarParameters | None = None,
) -> Fit:
    """Fits free parameters and densities of the process noise by the likelihood of a filter's innovations.

    The covariance is the inverse of Fisher's information.

    Args:
        records: What was measured.
        start: What is not free, the middle of the prior, and what the fit is compared with.
        free: Names of the free ones.
        options: Settings of the filter.
        guess: Where to begin, such as a fit of segments; where the start or least squares are likelier, it is there.

    Raises:
        InputError: Records, names or options that cannot be used, or a start with which the filter fails.
    """
    options = options or PredictionErrorOptions()
    check(records, start)
    for name in options.noise:
        if name not in NOISES:
            raise unknown_name("noise of the process", name, list(NOISES))
    if len(options.densities) != len(NOISES) or not all(0.0 <= q < math.inf for q in options.densities):
        raise InputError(f"densities {options.densities} of the process noise must be {len(NOISES)} numbers >= 0")
    likelihood = Likelihood(records, start, free, options)
    return likelihood.report(*_maximise(likelihood, _begin(likelihood, guess)))


def _begin(likelihood: Likelihood, guess: PlanarParameters | None) -> _Point:
    """The likeliest of the start, the guess, and what least squares make of smoothed states.

    Raises:
        InputError: The filter fails with either.
    """
    options, start = likelihood.options, likelihood.start
    logs = np.log(np.maximum(np.array(options.densities)[likelihood.noisy], 1e-12))
    ways = [smoothed(record, start, options.nuisances.vector()) for record in likelihood.records]
    candidates = (
        *(given.vector()[likelihood.indices] for given in (start, guess) if given is not None),
        first_values(likelihood.records, ways, start, likelihood.free),
    )
    points = [
        likelihood.at(np.clip(np.concatenate([values, logs]), likelihood.low, likelihood.high)) for values in candidates
    ]
    best = min(points, key=lambda point: point.cost)
    if not math.isfinite(best.cost):
        raise InputError(f"the filter fails on {likelihood.records[0].name} from the start; fit segments first")
    return best


def profile(
    records: Sequence[Record], fit: Fit, name: str, options: PredictionErrorOptions | None = None
) -> Callable[[float], float]:
    """The lowest cost as a function of one free parameter, all else fitted anew; each call begins where the last ended.

    Args:
        records: Those that were fitted.
        fit: What `fit_prediction_error` gave.
        name: The parameter.
        options: Those of the fit.
    """
    likelihood = Likelihood(records, fit.start, fit.free, options or PredictionErrorOptions())
    fixed = np.arange(len(likelihood.low)) == fit.free.index(name)
    assert fit.noise is not None
    best = np.concatenate([fit.values, np.log(np.maximum(fit.noise[likelihood.noisy], math.exp(_FLOOR)))])
    point = likelihood.at(best)

    def lowest(value: float) -> float:
        nonlocal point
        point = _maximise(likelihood, likelihood.at(np.where(fixed, value, point.unknowns)), fixed)[0]
        return point.cost

    return lowest


def _maximise(likelihood: Likelihood, point: _Point, fixed: Mask | None = None) -> tuple[_Point, Array, int, bool]:
    """Fisher scoring, damped as by Levenberg and Marquardt; the point, its information, iterations, convergence."""
    options, low, high = likelihood.options, likelihood.low, likelihood.high
    if fixed is not None:
        low, high = np.where(fixed, point.unknowns, low), np.where(fixed, point.unknowns, high)
    reach = np.where(np.arange(len(low)) < len(likelihood.free), np.inf, _STRIDE)
    damping, growth = 1e-4, 2.0
    H, g = likelihood.information(point)
    for iteration in range(1, options.max_iterations + 1):
        down, up = np.maximum(low - point.unknowns, -reach), np.minimum(high - point.unknowns, reach)
        step = bounded_step(H, -g, damping, down, up)
        gain = -0.5 * float(g @ step)
        trial = likelihood.at(np.clip(point.unknowns + step, low, high))
        last = gain < options.tolerance and damping <= 1e-3
        if trial.cost < point.cost:
            damping, growth = max(0.1 * damping, 1e-9) if point.cost - trial.cost > 0.5 * gain else damping, 2.0
            point = trial
            H, g = likelihood.information(point)
        elif damping > 1e10:
            return point, H, iteration, last
        else:
            damping, growth = growth * damping, 2.0 * growth
        if last:
            return point, H, iteration, True
    return point, H, options.max_iterations, False


def _flat(point: _Point) -> tuple[Array, Array]:
    """Innovations and their variances that there are, of all records."""
    e = np.concatenate([e[np.isfinite(e)] for e, _ in point.innovations])
    return e, np.concatenate([s[np.isfinite(s)] for _, s in point.innovations])
