"""Ordinary least squares of changes of velocity: a start from nothing, in one linear step."""

from collections.abc import Sequence

import numpy as np

from auvsim.base.errors import InputError
from auvsim.identification import compiled
from auvsim.identification.fit import (
    DEFAULT_FREE,
    MASSES,
    Fit,
    Indices,
    Nuisances,
    check,
    free_indices,
    invert,
    with_values,
)
from auvsim.identification.records import MEASURED, Record
from auvsim.identification.states import smoothed
from estimators.core.types import Array
from estimators.planar.model import PlanarParameters

# Quadratic in what is hardly seen: with errors in the smoothed sway least squares give them wild values of either sign.
_WILD = ("X_dd", "Y_vv", "Y_rr", "N_vv", "N_rr")


def fit_least_squares(
    records: Sequence[Record],
    start: PlanarParameters,
    free: Sequence[str] = DEFAULT_FREE,
    *,
    window: float = 1.0,
    nuisances: Nuisances | None = None,
) -> Fit:
    """Fits the change of surge, sway and yaw rate over each window to the integral of the model's accelerations.

    The velocities are those of a smoother, so nothing is differentiated; their errors stand in the regressors too and
    draw the parameters towards zero. Its covariance takes the equations' residuals as white, which they are not: this
    is a start, not a result.

    Args:
        records: What was measured.
        start: The masses, and what is not free.
        free: Parameters in which the accelerations are linear.
        window: Over which changes are taken [s].
        nuisances: Prior deviations of the current and of biases.

    Raises:
        InputError: Records or names that cannot be used; a mass is free.
    """
    check(records, start)
    indices = free_indices(free)
    if massive := [name for name in free if name in MASSES]:
        raise InputError(f"accelerations are not linear in {', '.join(massive)}; least squares needs them fixed")
    deviations = (nuisances or Nuisances()).vector()
    ways = [smoothed(record, start, deviations) for record in records]
    values, covariance, changes, terms = regress(records, ways, start, indices, window)
    before = start.vector()[indices]
    scale = 1.0 / np.sqrt(np.mean((changes - terms @ values) ** 2, axis=0) + np.finfo(float).tiny)
    cost, start_cost = (0.5 * float(np.sum((scale * (changes - terms @ v)) ** 2)) for v in (values, before))
    return Fit(
        method="least squares",
        start=start,
        parameters=with_values(start, free, values),
        free=tuple(free),
        covariance=covariance,
        nuisances=np.array([way[-1, 6:] for way in ways]),
        nuisance_deviations=np.full((len(records), 6), np.nan),
        residual_rms=np.full(len(MEASURED), np.nan),
        whiteness=(None,) * len(MEASURED),
        cost=cost,
        start_cost=start_cost,
        samples=changes.size,
        iterations=1,
        converged=True,
        message="a start: errors of the smoothed velocities bias it",
    )


def regress(
    records: Sequence[Record], ways: Sequence[Array], start: PlanarParameters, indices: Indices, window: float = 1.0
) -> tuple[Array, Array, Array, Array]:
    """The linear step alone: values (k,), covariance (k, k), changes (w, 3) and the terms (w, 3, k) they are made of.

    Args:
        records: What was measured.
        ways: Smoothed states (n, 12) along each.
        start: What is not free.
        indices: Places of the free ones, no masses.
        window: Over which changes are taken [s].
    """
    blocks = [_equations(record, way, start, indices, window) for record, way in zip(records, ways, strict=True)]
    changes = np.concatenate([change for change, _ in blocks])
    terms = np.concatenate([term for _, term in blocks])
    before = start.vector()[indices]
    aside, covariance = _solved(changes - terms @ before, terms)
    return before + aside, covariance, changes, terms


def first_values(
    records: Sequence[Record], ways: Sequence[Array], start: PlanarParameters, free: Sequence[str]
) -> Array:
    """Free parameters (k,) from which a fit may go down: zero where least squares mislead, masses as in the start.

    Args:
        records: What was measured.
        ways: Smoothed states (n, 12) along each.
        start: The masses, and what is not free.
        free: Names of the free ones.
    """
    values = dict(zip(free, start.vector()[free_indices(free)].tolist(), strict=True))
    if wild := [name for name in free if name in _WILD]:
        *_, terms = regress(records, ways, start, free_indices(wild))
        values |= {name: 0.0 for name, seen in zip(wild, np.any(terms, axis=(0, 1)).tolist(), strict=True) if seen}
    if linear := [name for name in free if name not in (*MASSES, *_WILD)]:
        calm = with_values(start, free, np.array(list(values.values())))
        found, *_ = regress(records, ways, calm, free_indices(linear))
        values |= dict(zip(linear, found.tolist(), strict=True))
    return np.array(list(values.values()))


def _equations(
    record: Record, way: Array, start: PlanarParameters, indices: Indices, window: float
) -> tuple[Array, Array]:
    """Changes of the velocities over windows (w, 3), without what is known, and the free terms' integrals (w, 3, k)."""
    p = start.vector()
    p[indices] = 0.0
    loops = compiled.segments()
    inputs = np.ascontiguousarray(record.inputs[:-1], dtype=float)
    base, terms = loops.regressors(way[:-1], inputs, p, indices)
    base_after, terms_after = loops.regressors(way[1:], inputs, p, indices)
    size = min(max(1, round(window / record.step)), len(inputs))
    edges = np.arange(0, len(inputs) + 1, size)
    half = 0.5 * record.step
    known = np.add.reduceat(half * (base + base_after), edges[:-1])
    summed = np.add.reduceat(half * (terms + terms_after), edges[:-1])
    if edges[-1] < len(inputs):  # reduceat's last sum runs to the end, a window's does not
        known[-1] = half * (base + base_after)[edges[-2] : edges[-1]].sum(axis=0)
        summed[-1] = half * (terms + terms_after)[edges[-2] : edges[-1]].sum(axis=0)
    return way[edges[1:], 3:6] - way[edges[:-1], 3:6] - known, summed


def _solved(changes: Array, terms: Array) -> tuple[Array, Array]:
    """Weighted least squares of the three equations, each weighed by its own residuals; values and covariance.

    The values are the smallest there are: zero in what the terms do not show.
    """
    k = terms.shape[2]
    scale = 1.0 / (np.std(changes, axis=0) + np.finfo(float).tiny)
    values = np.zeros(k)
    for _ in range(3):
        A, b = (scale[:, None] * terms).reshape(-1, k), (scale * changes).ravel()
        columns = np.linalg.norm(A, axis=0)
        columns[columns == 0.0] = 1.0
        values = np.linalg.lstsq(A / columns, b, rcond=1e-10)[0] / columns
        scale = 1.0 / (np.sqrt(np.mean((changes - terms @ values) ** 2, axis=0)) + np.finfo(float).tiny)
    A = (scale[:, None] * terms).reshape(-1, k)
    return values, invert(A.T @ A)
