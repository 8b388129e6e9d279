"""A bank of extended Kalman filters against mirror solutions: each starts from a current of its own, ranges decide.

Each range is used once; its variance holds that of the leader's place. One of the kind `SHARED` corrects each filter,
but tells nothing of which of them is right. The states are those of
`core.models.odometry`: give a deviation at the start to what is to be estimated, clock, sound speed, speed log and
compass included; what has none is taken as right. What a leader's filter errs by lasts from packet to packet: with
`memory` each leader's error, north and east, are two states more, a Gauss-Markov process of the variance it tells.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimators.core import imm, loops
from estimators.core.compiling import compiled
from estimators.core.consistency import chi_square
from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.filter import OUTLIER
from estimators.core.history import Input, Node
from estimators.core.models.odometry import SPACE, Displacement, N, OdometryNoise, move, show_range, spread
from estimators.core.types import NO_MODEL, Array, Gaussian, Measurement, Verdicts
from estimators.motion_radius.geometry import Geometry
from estimators.motion_radius.ranges import KIND, SHARED

CLOSEST = 1.0  # distance below which a range is not taken to bend any more [m]
SAME = 0.05  # squared normalised distance below which two filters have come to the same solution
IMPROBABLE = 1e-6  # probability below which a filter is given up
BENT = 0.5  # bend of a range over a filter's spread, in the range's deviations, from which on a split is worth it
MOST, SPLIT = 300, 1e-3  # filters of a bank, and probability from which one is worth a split
PARTS = (0.2252, 0.6716)  # of a normal density in three: weight of the outer ones, deviation of each (DeMars 2013)
BREADTH = 1.135  # variance of the normal density that weighs 7 currents a side so that their mixture has the start's
REACH, WIDTH = 1.8, 0.36  # outermost currents of the bank and deviation of each, in deviations of the start's current


class BankState(NamedTuple):
    """What a node keeps: each filter's belief at the last range, and the displacement since."""

    means: Array  # (m, n), of the 9 states and the errors of each leader's place
    covariances: Array  # (m, n, n)
    weights: Array  # (m,) probabilities
    q: Array  # (n,) densities of random walks of the states [unit^2/s]
    since: Displacement = Displacement()
    accepted: int = 0  # ranges so far
    geometry: Geometry = Geometry()
    verdicts: Verdicts = ()
    leaders: tuple[tuple[str, float], ...] = ()  # whose errors are states, and the stamp of the last range to each [s]

    @property
    def modes(self) -> tuple[Array, Array]:
        """Means (m, n) and covariances (m, n, n), predicted from the last range to now."""
        return predict_modes(self.means, self.covariances, self.since, self.q)

    @property
    def belief(self) -> Gaussian:
        """The filters' beliefs merged, now."""
        means, covariances = self.modes
        mean, covariance = loops.merge(means, covariances, self.weights, np.zeros(0, dtype=np.int64))
        return Gaussian(mean=mean[:N], covariance=covariance[:N, :N])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why position and current may be wrong by more than their covariance says; empty if nothing is suspected."""
        means, covariances = self.modes
        return self.geometry.warnings(means, covariances, self.weights)


class BankFilter:
    """Gaussian sum filter over the current, for a `History`; inputs: forward, starboard speed [m/s] and heading [rad].

    Args:
        start: Belief at the first node, of the states of `core.models.odometry.SPACE`.
        noise: Of the odometry.
        side: Currents of the bank along each axis; 1 is a plain extended Kalman filter.
        pruned: After how many ranges, each time, filters that have come to the same solution become one, and those no
            longer probable are given up.
        walks: Densities (9,) of random walks of the states [unit^2/s]; None: all are constant.
        gate: Probability with which a range that fits is accepted by the filter that it fits best; None accepts all.
        memory: Time constant of the errors of leaders' places [s]; 0: they are white noise.
        bend: How far a range may bend over a filter's spread, in the range's deviations, before that becomes three, as
            `BENT` says; infinite: however far.

    Raises:
        ParameterError: The start has other states, the bank has no filter, or the memory is below 0.
    """

    def __init__(
        self,
        start: Gaussian,
        noise: OdometryNoise,
        *,
        side: int = 7,
        pruned: int = 30,
        walks: Array | None = None,
        gate: float | None = None,
        memory: float = 0.0,
        bend: float = math.inf,
    ) -> None:
        if start.mean.shape != (N,) or side < 1:
            raise ParameterError(
                f"start of {start.mean.size} states and {side} currents a side; there must be {N} states, "
                f"{', '.join(SPACE.names)}, and 1 current or more"
            )
        if not memory >= 0.0:
            raise ParameterError(f"memory {memory} s of errors of leaders' places must be 0 s or more")
        self._means, self._covariances, self._weights = spread_over_currents(start, side)
        self._noise, self._pruned, self._memory, self._bend = noise, pruned, memory, bend
        self._q = np.zeros(N) if walks is None else np.array(walks, dtype=float)
        self._limit = math.inf if gate is None else chi_square(gate, 1)

    def start(self, nodes: Sequence[Node[BankState]], index: int) -> BankState:
        """State at the first node, with its measurements."""
        state = BankState(self._means, self._covariances, self._weights, self._q)
        return self.correct(state, nodes[index].time, nodes[index].measurements)

    def predict(self, state: BankState, u: Input, duration: float) -> BankState:
        """State after `duration` [s]."""
        since = state.since.extended(u[0], u[1], u[2], duration, self._noise)
        return state._replace(since=since, verdicts=())

    def correct(self, state: BankState, node_time: float, measurements: Sequence[Measurement]) -> BankState:
        """State after a node's measurements.

        Raises:
            NotFiniteError: The correction is not finite.
        """
        for m in measurements:
            if m.kind not in (KIND, SHARED):
                state = state._replace(verdicts=(*state.verdicts, (m, NO_MODEL, math.nan)))
                continue
            state = self._ranged(state, m)
        return state

    def _ranged(self, state: BankState, m: Measurement) -> BankState:
        north, east, depth, own, told = m.parameters
        distance, variance = float(m.value[0]), float(m.covariance[0, 0])
        white, error = variance, -1
        if self._memory > 0.0 and m.kind == KIND and told > 0.0:
            state, error = remembered(state, m.source, m.stamp, told, self._memory)
            white -= told * max(0.0, 1.0 - ((depth - own) / distance) ** 2)
        x, P = predict_modes(state.means, state.covariances, state.since, state.q)
        x, P, weights = split(x, P, state.weights, north, east, self._bend * math.sqrt(variance))
        means, covariances, logs, nis = correct_modes(x, P, distance, white, north, east, depth - own, error)
        best = float(nis[weights > 1e-6].min())
        if best > self._limit:
            return state._replace(verdicts=(*state.verdicts, (m, OUTLIER, best)))
        if not (np.isfinite(logs).all() and np.isfinite(means).all()):
            raise NotFiniteError(f"correction by the range {distance} m at {m.stamp} s is not finite")
        # Errors that last from packet to packet would be counted again and again as evidence for one filter.
        weights = weights if m.kind == SHARED else imm.update(weights, logs)
        accepted = state.accepted + 1
        verdict = (m, "", float(nis[weights.argmax()]))
        if accepted % self._pruned == 0 and len(weights) > 1:
            means, covariances, weights = pruned(means, covariances, weights)
        geometry = state.geometry.extended(state.since, north, east, distance, variance)
        return BankState(
            means, covariances, weights, state.q, Displacement(), accepted, geometry, (*state.verdicts, verdict),
            state.leaders,
        )  # fmt: skip


def remembered(state: BankState, leader: str, stamp: float, told: float, memory: float) -> tuple[BankState, int]:
    """The state with the error of a leader's place as of `stamp` [s], and where that is among the states.

    Args:
        state: Before a range.
        leader: To whom.
        stamp: Of the range [s].
        told: Variance of the error along each axis that the leader tells [m^2].
        memory: Time constant of the error [s].
    """
    names = [name for name, _ in state.leaders]
    number = names.index(leader) if leader in names else len(names)
    error = N + 2 * number
    means, covariances, q, leaders = state.means, state.covariances, state.q, list(state.leaders)
    if number == len(names):
        means = np.pad(means, ((0, 0), (0, 2)))
        covariances, q = np.pad(covariances, ((0, 0), (0, 2), (0, 2))), np.pad(q, (0, 2))
        kept = 0.0
        leaders.append((leader, stamp))
    else:
        means, covariances = means.copy(), covariances.copy()
        kept = math.exp(-max(0.0, stamp - leaders[number][1]) / memory)
        leaders[number] = (leader, stamp)
    both = slice(error, error + 2)
    means[:, both] *= kept
    covariances[:, both] *= kept
    covariances[:, :, both] *= kept
    covariances[:, (error, error + 1), (error, error + 1)] += told * (1.0 - kept**2)
    return state._replace(means=means, covariances=covariances, q=q, leaders=tuple(leaders)), error


def spread_over_currents(start: Gaussian, side: int) -> tuple[Array, Array, Array]:
    """Means (m, 9), covariances (m, 9, 9) and weights (m,) of `side` squared filters over the start's current."""
    if side == 1:
        return start.mean[None].copy(), start.covariance[None].copy(), np.ones(1)
    deviations = np.sqrt(np.diagonal(start.covariance)[2:4])
    steps = np.linspace(-REACH, REACH, side)
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    means = np.repeat(start.mean[None], len(grid), axis=0)
    means[:, 2:4] += grid * deviations
    shrink = np.ones(N)
    shrink[2:4] = WIDTH
    covariances = np.repeat((start.covariance * np.outer(shrink, shrink))[None], len(grid), axis=0)
    weights = np.exp(-0.5 * np.sum(grid**2, axis=1) / BREADTH)
    return means, covariances, weights / weights.sum()


def split(
    means: Array, covariances: Array, weights: Array, north: float, east: float, most: float
) -> tuple[Array, Array, Array]:
    """The filters, those in three for which a range to a place is no straight line over their spread.

    Over an error e across it a range r is longer by e^2 / (2 r). The three together have the mean and the covariance
    of the one, and lie along what an error across the range brings with it.

    Args:
        means: (m, n).
        covariances: (m, n, n).
        weights: (m,) probabilities.
        north: Of the place [m].
        east: Of the place [m].
        most: Bend [m], of a standard deviation, that is not worth a split.
    """
    share, deviation = PARTS
    distance = math.sqrt((1.0 - deviation**2) / (2.0 * share))
    while most < math.inf:
        way = means[:, :2] - (north, east)
        r = np.maximum(np.hypot(way[:, 0], way[:, 1]), CLOSEST)
        across = np.stack((-way[:, 1], way[:, 0]), axis=1) / r[:, None]
        along = np.einsum("mij,mj->mi", covariances[:, :, :2], across)
        variance = np.einsum("mj,mj->m", along[:, :2], across)
        bent = (0.5 * variance / r > most) & (weights > SPLIT)
        kept = weights > IMPROBABLE
        if not bent.any() or kept.sum() + 2 * bent.sum() > MOST:
            break
        step = along[bent] / np.sqrt(variance[bent])[:, None]
        narrow = covariances[bent] - (1.0 - deviation**2) * step[:, :, None] * step[:, None, :]
        outer = share * weights[bent]
        kept &= ~bent
        means = np.concatenate((means[kept], means[bent], means[bent] + distance * step, means[bent] - distance * step))
        covariances = np.concatenate((covariances[kept], narrow, narrow, narrow))
        weights = np.concatenate((weights[kept], (1.0 - 2.0 * share) * weights[bent], outer, outer))
    return means, covariances, weights


def pruned(means: Array, covariances: Array, weights: Array) -> tuple[Array, Array, Array]:
    """The filters that differ, the most probable first, each with the probability of those that are like it."""
    order = np.argsort(-weights, kind="stable")
    kept: list[int] = []
    total = np.zeros(len(weights))
    for k in order[weights[order] > IMPROBABLE].tolist():
        like = next((j for j in kept if _squared_distance(means[k] - means[j], covariances[j]) < SAME), k)
        total[like] += weights[k]
        if like == k:
            kept.append(k)
    return means[kept], covariances[kept], total[kept] / total[kept].sum()


def _squared_distance(error: Array, covariance: Array) -> float:
    """Of position and current, which make up all that the filters of a bank differ in at first."""
    e = error[:4]
    return float(e @ np.linalg.solve(covariance[:4, :4], e))


@compiled
def predict_modes(means, covariances, d, q):
    """Means (m, n) and covariances (m, n, n) after a displacement."""
    x, P = np.empty_like(means), covariances.copy()
    if d[0] <= 0.0:
        x[:] = means
        return x, P
    F, work = np.eye(means.shape[1]), np.empty(P.shape[1:])
    for k in range(len(means)):
        move(means[k], d, x[k], F)
        spread(P[k], F, d, q, work)
    return x, P


@compiled
def correct_modes(means, covariances, distance, variance, north, east, down, error):
    """Means (m, n), covariances (m, n, n), log likelihoods (m,) and NIS (m,) after a range.

    The error of the place to which it is stands at `error` among the states, -1: it is none of them.
    """
    m, n = means.shape
    x, P, logs, nis = np.empty_like(means), np.empty_like(covariances), np.empty(m), np.empty(m)
    H, R, residual = np.empty((1, n)), np.array([[variance]]), np.empty(1)
    for k in range(m):
        residual[0] = distance - show_range(means[k], north, east, down, H)
        if error >= 0:
            residual[0] -= H[0, 0] * means[k, error] + H[0, 1] * means[k, error + 1]
            H[0, error], H[0, error + 1] = H[0, 0], H[0, 1]
        x[k], P[k], _, S, nis[k], _ = loops.correct(means[k], covariances[k], H, residual, R, math.inf)
        logs[k] = -0.5 * (nis[k] + math.log(2.0 * math.pi * S[0, 0]))
    return x, P, logs, nis
