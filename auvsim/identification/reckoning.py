"""Positions against dead reckoning: which fixes no motion explains."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from estimators.core.types import Array

WINDOW = 9  # fixes judged together: a steady current and speed over them are good enough for errors of metres
_SWEEPS = 20  # reweighted least squares come to the least absolute sum within these


def outliers(signals: Mapping[str, tuple[Array, Array]], deviation: float) -> NDArray[np.bool_]:
    """Which positions (n,) lie farther than six deviations from where their neighbours and the motion put them.

    In each window position is that of dead reckoning, turned and stretched, plus a steady drift, by least absolute
    errors. Without a heading nothing is judged.

    Args:
        signals: Times [s] and values of `north` and `east` (at the same times), `heading`, and of velocities if any.
        deviation: Of a position in each axis [m].
    """
    times, north = signals["north"]
    n = len(times)
    if n < WINDOW or "heading" not in signals or len(signals["east"][0]) != n:
        return np.zeros(n, dtype=bool)
    places = north + 1j * signals["east"][1]
    way = reckoned(signals, times)
    first = np.clip(np.arange(n) - WINDOW // 2, 0, n - WINDOW)
    members = first[:, None] + np.arange(WINDOW)
    middle = times[:, None]
    ones = np.ones(members.shape, dtype=complex)
    columns = np.stack([ones, times[members] - middle + 0j, way[members] - way[:, None]], axis=-1)
    residuals = _least_absolute(columns, places[members])
    own = np.abs(residuals[np.arange(n), np.arange(n) - first])
    usual = np.median(np.abs(residuals), axis=1)
    return own > 6.0 * np.maximum(deviation, usual)


def reckoned(signals: Mapping[str, tuple[Array, Array]], times: Array) -> NDArray[np.complex128]:
    """Dead reckoning (n,) at `times`, north + i east [m], from zero; along the heading at 1 m/s without velocities."""
    clock, heading = signals["heading"]
    over, water = ("ground_surge", "ground_sway"), ("surge", "sway")
    forward, starboard = over if over[0] in signals else water
    ahead = np.interp(clock, *signals[forward]) if forward in signals else np.ones(len(clock))
    aside = np.interp(clock, *signals[starboard]) if starboard in signals else np.zeros(len(clock))
    velocity = (ahead + 1j * aside) * np.exp(1j * heading)
    way = cumulative_trapezoid(velocity, clock, initial=0.0)
    return np.interp(times, clock, way.real) + 1j * np.interp(times, clock, way.imag)


def _least_absolute(columns: NDArray[np.complex128], places: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Residuals (n, w) of complex fits of columns (n, w, k) to places (n, w), each by least absolute errors."""
    scale = np.abs(columns).max(axis=1, keepdims=True)
    columns = columns / np.where(scale > 0.0, scale, 1.0)
    ridge = 1e-6 * np.eye(columns.shape[-1])  # on a straight course the drift and the way are one
    weights = np.ones(places.shape)
    residuals = places
    for _ in range(_SWEEPS):
        weighted = columns.conj() * weights[..., None]
        normal = np.einsum("nwk,nwl->nkl", weighted, columns) + ridge * weights.sum(axis=1)[:, None, None]
        solution = np.linalg.solve(normal, np.einsum("nwk,nw->nk", weighted, places)[..., None])
        residuals = places - (columns @ solution)[..., 0]
        weights = 1.0 / np.maximum(np.abs(residuals), 1e-3)
    return residuals
