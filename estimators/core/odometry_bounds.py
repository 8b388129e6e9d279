"""Cramér-Rao bounds of vehicles on odometry, by ranges and bearings in a current, for thousands of stations at once.

The model is that of `core.models.odometry`, linearised along the truth, so that the bound is a Kalman filter's
covariance (Tichavsky, Muravchik, Nehorai 1998). A measurement counts from when it has arrived, and where it was made.
`core.bounds` has the same for any process and any sensors, slower.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.core import loops
from estimators.core.compiling import compiled
from estimators.core.errors import ParameterError
from estimators.core.models.odometry import Displacement, N, OdometryNoise, move, show_bearing, show_range, spread
from estimators.core.types import Array

DEFICIENT = 1e-6  # singular value over the largest below which a direction counts as unobservable


class Told(NamedTuple):
    """Errors of places that are told, along each axis, which last from a source's sight to its next."""

    sources: NDArray[np.int64]  # (k,) number of who tells; -1: its place is known
    kept: Array  # (k,) share that is left of the error at the same source's sight before; not used at its first
    added: Array  # (k,) variance of what is new in it [m^2]


class Sights(NamedTuple):
    """When something is measured and how well, in the order of stamps; the first may be at the start."""

    times: Array  # (k,) stamps [s]
    displacements: Array  # (k, 6) since the sight before, or the start, rows as `Displacement`
    range_variance: Array  # (k,) or (s, k) [m^2]; inf: no range
    bearing_variance: Array  # (k,) or (s, k) [rad^2]; inf: no bearing
    arrivals: Array  # (d, k) [s], of d draws of what is lost (inf) and late, none overtaking another
    by_compass: Array | None = None  # (k,) whether a bearing is by the vehicle's compass; None: all are
    told: Told | None = None  # errors of the places of what is ranged to; None: these are known


def at_once(
    times: Array, displacements: Array, *, range_deviation: float = math.inf, bearing_deviation: float = math.inf
) -> Sights:
    """Sights that are all heard without delay."""
    every = np.ones(len(times))
    return Sights(times, displacements, every * range_deviation**2, every * bearing_deviation**2, times[None])


def bounds(
    prior: Array, sights: Sights, relative: Array, outputs: NDArray[np.int64], walks: Array | None = None
) -> Array:
    """Bounds of the covariance (s, o, 9, 9) at the sights `outputs` (o,), averaged over the draws of losses.

    Args:
        prior: Covariance (9, 9) at the start; zero for what is known.
        sights: What is measured when.
        relative: (s, m, k, 3) at each station from what is ranged to the vehicle, north and east, and how deep below
            the vehicle that is [m]; of m truths each, over which information is averaged.
        outputs: Places among the sights, ascending.
        walks: Densities (9,) of random walks of the states [unit^2/s].

    Raises:
        ParameterError: Sizes do not fit, stamps do not ascend, or one measurement overtakes another.
    """
    k = len(sights.times)
    relative = np.ascontiguousarray(relative, dtype=float)
    if relative.ndim != 4 or relative.shape[2:] != (k, 3) or sights.displacements.shape != (k, 6):
        raise ParameterError(
            f"relative places {relative.shape} and displacements {sights.displacements.shape} of {k} sights must be "
            f"(stations, truths, {k}, 3) and ({k}, 6)"
        )
    last = np.array([_last_heard(sights.times, arrivals, outputs) for arrivals in sights.arrivals])
    q = np.zeros(N) if walks is None else np.array(walks, dtype=float)
    states = np.flatnonzero((np.diagonal(prior) + q > 0.0) | (np.arange(N) < 4))
    told = sights.told or Told(np.full(k, -1), np.zeros(k), np.zeros(k))
    n, size = len(states), len(states) + 2 * (1 + int(told.sources.max(initial=-1)))
    start, densities = np.zeros((size, size)), np.zeros(size)
    start[:n, :n], densities[:n] = prior[np.ix_(states, states)], q[states]
    shape = (len(relative), k)
    found = _bounds(
        start, states, np.ascontiguousarray(sights.displacements), relative,
        np.ascontiguousarray(np.broadcast_to(sights.range_variance, shape)),
        np.ascontiguousarray(np.broadcast_to(sights.bearing_variance, shape)),
        np.ones(k, dtype=bool) if sights.by_compass is None else np.array(sights.by_compass, dtype=bool),
        np.isfinite(sights.arrivals), last, np.array(outputs, dtype=np.int64), densities,
        np.array(told.sources, dtype=np.int64), np.array(told.kept, dtype=float), np.array(told.added, dtype=float),
    )  # fmt: skip
    full = np.zeros((*found.shape[:2], N, N))
    full[:, :, states[:, None], states] = found[..., :n, :n]
    return full


def _last_heard(times: Array, arrivals: Array, outputs: NDArray[np.int64]) -> NDArray[np.int64]:
    """The last sight (o,) that has arrived at each output; -1 if none has."""
    heard = np.flatnonzero(np.isfinite(arrivals))
    late = arrivals[heard]
    if (np.diff(times) < 0.0).any() or (np.diff(late) < 0.0).any() or (late < times[heard]).any():
        raise ParameterError("stamps and arrivals of sights must ascend, and none arrive before its stamp")
    count = np.searchsorted(late, times[outputs] + 1e-9, side="right")
    return np.where(count > 0, np.append(heard, -1)[count - 1], -1)


@compiled
def _bounds(
    prior, states, displacements, relative, range_variance, bearing_variance, by_compass, heard, last, outputs, q,
    sources, kept, added,
):  # fmt: skip
    """Bounds (s, o, n, n) of `states` and then of the errors, north and east, of what each source tells."""
    stations, truths, k = relative.shape[0], relative.shape[1], relative.shape[2]
    draws, n, own = heard.shape[0], prior.shape[0], len(states)
    found = np.zeros((stations, len(outputs), n, n))
    F9, x, following, H9, work = np.eye(9), np.zeros(9), np.zeros(9), np.zeros((1, 9)), np.empty((n, n))
    Fs = np.zeros((k, n, n))
    for i in range(k):
        d = (displacements[i, 0], displacements[i, 1], displacements[i, 2])
        move(x, d, following, F9)
        Fs[i] = np.eye(n)
        for a in range(own):
            for b in range(own):
                Fs[i, a, b] = F9[states[a], states[b]]
    mean, zero, H, R = np.zeros(n), np.zeros(1), np.empty((1, n)), np.empty((1, 1))
    for s in range(stations):
        for draw in range(draws):
            P, o = prior.copy(), 0
            while o < len(outputs) and last[draw, o] < 0:
                _predicted(P.copy(), Fs, displacements, q, 0, outputs[o] + 1, work, found[s, o])
                o += 1
            for i in range(k):
                _step(P, Fs[i], displacements[i], q, work)
                error = own + 2 * sources[i]
                if sources[i] >= 0:
                    for c in range(error, error + 2):
                        P[c, :] *= kept[i]
                        P[:, c] *= kept[i]
                        P[c, c] += added[i]
                if heard[draw, i]:
                    for truth in range(truths):
                        x[0], x[1] = relative[s, truth, i, 0], relative[s, truth, i, 1]
                        if range_variance[s, i] < math.inf:
                            show_range(x, 0.0, 0.0, relative[s, truth, i, 2], H9)
                            _of_states(H9, states, sources[i], H)
                            R[0, 0] = range_variance[s, i] * truths
                            P = loops.correct(mean, P, H, zero, R, math.inf)[1]
                        if bearing_variance[s, i] < math.inf:
                            show_bearing(x, 0.0, 0.0, H9)
                            if not by_compass[i]:
                                H9[0, 8] = 0.0
                            _of_states(H9, states, sources[i], H)
                            R[0, 0] = bearing_variance[s, i] * truths
                            P = loops.correct(mean, P, H, zero, R, math.inf)[1]
                while o < len(outputs) and last[draw, o] == i:
                    _predicted(P.copy(), Fs, displacements, q, i + 1, outputs[o] + 1, work, found[s, o])
                    o += 1
    return found / draws


@compiled
def _of_states(H9, states, source, H):
    """Fills the derivative H (1, n) from that by all states; a place told wrong is like the own place being wrong."""
    H[:] = 0.0
    for a in range(len(states)):
        H[0, a] = H9[0, states[a]]
    if source >= 0:
        error = len(states) + 2 * source
        H[0, error], H[0, error + 1] = H9[0, 0], H9[0, 1]


@compiled
def _step(P, F, d, q, work):
    """`spread` by a row of displacements."""
    spread(P, F, (d[0], d[1], d[2], d[3], d[4], d[5]), q, work)


@compiled
def _predicted(P, Fs, displacements, q, begin, end, work, total):
    """Adds P, predicted over the displacements `begin` .. `end`, to `total`."""
    for i in range(begin, end):
        _step(P, Fs[i], displacements[i], q, work)
    total += P


class Observability(NamedTuple):
    """What is told of position and current to first order, with no prior and perfect odometry."""

    singular_values: Array  # (s, 4) of the derivative of all by position at the start and span times current
    rank: NDArray[np.int64]  # (s,) of 4

    @property
    def condition(self) -> Array:
        """Largest over smallest singular value (s,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.singular_values[:, 0] / self.singular_values[:, -1]


def observability(
    times: Array, relative: Array, *, ranges: Array | bool = True, bearings: Array | bool = False, span: float = 1000.0
) -> Observability:
    """Singular values and rank of ranges, and of bearings times distance, at stations.

    Args:
        times: (k,) [s].
        relative: (s, k, 3) from what is ranged to the vehicle, as of `bounds`.
        ranges: (s, k) or for all, whether there is a range.
        bearings: (s, k) or for all, whether there is a bearing.
        span: Time [s] by which a current counts as a displacement.
    """
    shape = relative.shape[:2]
    along = relative[..., :2] / np.maximum(np.linalg.norm(relative, axis=-1, keepdims=True), 1e-9)
    across = np.stack((-relative[..., 1], relative[..., 0]), axis=-1)
    across = across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    rows = [
        direction * np.broadcast_to(told, shape)[..., None]
        for direction, told in ((along, ranges), (across, bearings))
        if np.any(told)
    ] or [np.zeros((*shape, 2))]
    parts = [np.concatenate((row, row * (times / span)[:, None]), axis=-1) for row in rows]
    values = np.linalg.svd(np.concatenate(parts, axis=1), compute_uv=False)
    rank = np.sum(values > DEFICIENT * np.maximum(values[..., :1], 1e-300), axis=-1)
    return Observability(values, rank)


def displacements_between(rows: Array, ends: NDArray[np.int64]) -> Array:
    """Displacements (k, 6) summed up to each of the samples `ends` (k,) of rows (t, 6), one of each interval."""
    total = np.vstack((np.zeros(6), np.cumsum(rows, axis=0)))[ends]
    return np.diff(total, axis=0, prepend=np.zeros((1, 6)))


def sampled(inputs: Array, dt: float, noise: OdometryNoise) -> Array:
    """Displacements (t, 6), one for each row of inputs (t, 3): speed ahead and to starboard [m/s], heading [rad].

    Each is held for `dt` [s].
    """
    return np.array([Displacement().extended(f, s, h, dt, noise) for f, s, h in inputs.tolist()])
