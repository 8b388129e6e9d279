"""Navigation by sonar frames on long missions: frame to window beside any sensors, with keyframes that close loops.

The state holds the poses of the window's frames and of earlier keyframes beside the vehicle's (Eustice, Singh, Leonard
2006, exactly sparse delayed-state filters, in covariance form): a loop closure corrects the whole path.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from estimators.core import ekf
from estimators.core.consistency import chi_square
from estimators.core.filter import OUTLIER, Start
from estimators.core.history import Node
from estimators.core.types import (
    NO_MODEL,
    Array,
    Gaussian,
    Measurement,
    MeasurementModel,
    Models,
    ProcessModel,
    Verdicts,
    model_of,
)
from estimators.map_path.closures import LEAST, PROBABILITY, largest_clique
from estimators.map_path.frames import KIND
from estimators.map_path.likelihood import Matcher, Prepared
from estimators.map_path.matching import Search, match
from estimators.map_path.poses import between, compose, wrapped
from estimators.map_path.window import Relation, Window, WindowFilter, WindowState, rearranged, with_angles

MARK = "mark"  # kind of a measurement whose value says nothing: the pose at its time stays in the state, the first time
MARKED = -1  # number of the blank frame that stands for it
PATIENCE = 3  # measurements of a kind refused in a row, after which the next is believed


@dataclass(frozen=True, kw_only=True, slots=True)
class Keyframes:
    """Which frames are kept beyond the window, and which loops they close."""

    spacing: int = 6  # frames from one keyframe to the next
    closures: bool = True  # whether loops are closed
    gap: int = 60  # frames between the two of a closure at least
    distance: float = 12.0  # between the places that the two look at, at most [m]
    turn: float = np.pi  # between their headings, at most [rad]
    alike: float = 0.5  # between their headings up to which they show the same sides of rocks and slopes [rad]
    interval: int = 2  # frames from one attempt to the next
    support: int = 3  # keyframes that are matched at once at most
    ratio: float = 25.0  # least log-likelihood of a closure against no relation
    search: Search = Search(limits=(4.0, 4.0, np.radians(4.0)))  # noqa: RUF009 - immutable
    search_prior: tuple[float, float, float] = (0.1, 0.1, np.radians(0.5))  # added to that of the search, deviations
    covariance_factor: float = 6.0  # of a closure: relief moves echoes, of neighbouring closures alike
    other_factor: float = 25.0  # the same where headings are not alike


class Closure(NamedTuple):
    """A match with keyframes that is not yet believed."""

    later: int  # number of the frame
    earlier: tuple[int, ...]  # numbers of the keyframes
    measured: Array  # (k, 3) pose relative to each of them
    weights: Array  # (k,)
    covariance: Array  # (3, 3) in the later frame's axes


class KeyframeState(NamedTuple):
    """What a node keeps; as `window.WindowState`, with the frames' numbers."""

    whole: Gaussian
    frames: tuple[Prepared, ...] = ()
    outliers: int = 0
    verdicts: Verdicts = ()
    numbers: tuple[int, ...] = ()  # of the frames
    stamps: tuple[float, ...] = ()  # of the frames [s]
    count: int = 0  # frames so far
    pending: tuple[Closure, ...] = ()
    closed: int = 0  # closures believed so far
    links: tuple[tuple[float, float], ...] = ()  # stamps of their later and earlier frames, one of each pair [s]
    refused: tuple[tuple[str, int], ...] = ()  # measurements refused in a row, by kind

    size = WindowState.size
    belief = WindowState.belief

    @property
    def poses(self) -> Array:
        """Poses (k, 3) of the frames that are kept, given all so far."""
        return self.whole.mean[self.size :].reshape(-1, 3)

    @property
    def mark(self) -> tuple[float, Array] | None:
        """When the pose was marked [s], and that pose (3,) given all so far; None without a mark."""
        return (self.stamps[0], self.poses[0]) if self.numbers[:1] == (MARKED,) else None

    def place(self, number: int) -> int:
        """Where a frame's pose begins in the whole state."""
        return self.size + 3 * self.numbers.index(number)


class KeyframeFilter(WindowFilter):
    """Matching against a window and keyframes, for a `History`, with any process whose first states are the pose.

    Args:
        matcher: As of `WindowFilter`.
        process: How the vehicle moves; north, east [m] and heading [rad] first.
        sensors: What each kind of measurement beside frames shows of its states.
        start: The belief at the first node that suffices, see `filter.Start`.
        gates: Probability with which a measurement of a kind that fits is accepted; after `PATIENCE` refused in a row
            the next is believed, and the position is taken as uncertain by what it differs.
        window: Which of the last frames to match against.
        search: Which poses to try for that.
        keyframes: What is kept beyond the window; None: nothing, and no loop is closed.
        nearer: Which state is the distance by which echoes come from before what they are of [m]; None: none is.
        saturation: Value at which the receiver saturates.
    """

    def __init__(
        self,
        matcher: Matcher,
        process: ProcessModel,
        sensors: Models,
        start: Start,
        *,
        gates: dict[str, float] | None = None,
        window: Window | None = None,
        search: Search | None = None,
        keyframes: Keyframes | None = None,
        nearer: int | None = None,
        saturation: float = np.inf,
    ) -> None:
        nowhere = Gaussian(mean=np.zeros(3), covariance=np.eye(3))
        super().__init__(matcher, nowhere, window=window, search=search, saturation=saturation)
        self._keyframes = keyframes or Keyframes(closures=False, spacing=0)
        self._closing = Matcher(matcher.grid, replace(matcher.model, together=self._keyframes.support))
        self.process, self.sensors = process, sensors  # pyright: ignore[reportIncompatibleVariableOverride]
        self._begin, self._gates, self._nearer = start, gates or {}, nearer

    def start(self, nodes: Sequence[Node[KeyframeState]], index: int) -> KeyframeState | None:  # pyright: ignore
        """State at the first node that suffices."""
        first = self._begin(nodes, index)
        if first is None:
            return None
        belief, used = first
        known = {id(m) for m in used}
        state = KeyframeState(belief, verdicts=tuple((m, "", np.nan) for m in used))
        return self.correct(state, nodes[index].time, [m for m in nodes[index].measurements if id(m) not in known])

    def correct(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, state: KeyframeState, node_time: float, measurements: Sequence[Measurement]
    ) -> KeyframeState:
        """State after a node's measurements; frames last, with loops closed."""
        for measurement in measurements:
            if measurement.kind == KIND:
                continue
            if measurement.kind == MARK:
                state = self._marked(state, measurement)
                continue
            model = model_of(self.sensors, measurement)
            if model is None:
                state = state._replace(verdicts=(*state.verdicts, (measurement, NO_MODEL, np.nan)))
            else:
                state = self._shown(state, measurement, model)
        for measurement in measurements:
            if measurement.kind != KIND:
                continue
            before = state.count
            state = super().correct(state, node_time, [measurement])  # pyright: ignore
            if state.count > before:
                state = state._replace(stamps=(*state.stamps[: len(state.frames) - 1], measurement.stamp))
                state = self._closed(state)
        return state

    def _shown(self, state: KeyframeState, measurement: Measurement, model: MeasurementModel) -> KeyframeState:
        """State after a measurement of the vehicle's states."""
        n, kind, whole = state.size, measurement.kind, state.whole
        expected, own = model.shown(whole.mean[:n], measurement)
        H = np.zeros((len(own), whole.mean.size))
        H[:, :n] = own
        residual = model.residual(measurement.value, expected)
        refused = dict(state.refused)
        gate = self._gates.get(kind)
        if gate is not None and refused.get(kind, 0) >= PATIENCE:
            gate = None
            covariance = whole.covariance.copy()
            covariance[:2, :2] += np.diag(np.square(residual[:2])) if len(residual) > 1 else 0.0
            whole = Gaussian(mean=whole.mean, covariance=covariance)
        limit = np.inf if gate is None else chi_square(gate, residual.size)
        R = model.covariance(whole.mean[:n], measurement)
        whole, innovation = ekf.correct_linear(whole, H, residual, R, limit)
        reason = "" if innovation.accepted else OUTLIER
        if innovation.accepted:
            refused.pop(kind, None)
            whole = with_angles(whole, n)
        else:
            refused[kind] = refused.get(kind, 0) + 1
        return state._replace(
            whole=whole,
            outliers=state.outliers + (not innovation.accepted),
            refused=tuple(refused.items()),
            verdicts=(*state.verdicts, (measurement, reason, innovation.nis)),
        )

    def _marked(self, state: KeyframeState, measurement: Measurement) -> KeyframeState:
        """State with the vehicle's pose kept before those of all frames."""
        state = state._replace(verdicts=(*state.verdicts, (measurement, "", np.nan)))
        if state.mark is not None:
            return state
        n, blank = state.size, self.matcher.prepare(np.zeros(self.matcher.grid.shape))
        rows = np.concatenate((np.arange(n), np.arange(3), np.arange(n, state.whole.mean.size)))
        return state._replace(
            whole=rearranged(state.whole, rows),
            frames=(blank, *state.frames),
            numbers=(MARKED, *state.numbers),
            stamps=(measurement.stamp, *state.stamps),
        )

    def _with(self, state: KeyframeState, frame: Prepared) -> KeyframeState:  # pyright: ignore
        """State with a frame at the vehicle's pose; the one that leaves the window goes, unless it is a keyframe."""
        n, number = state.size, state.count
        frames, numbers = (*state.frames, frame), (*state.numbers, number)
        stamps = (*state.stamps, np.nan)
        rows = np.concatenate((np.arange(state.whole.mean.size), np.arange(3)))
        leaves, spacing = number - self._window.kept, self._keyframes.spacing
        if leaves >= 0 and leaves in numbers and not (spacing and leaves % spacing == 0):
            k = numbers.index(leaves)
            frames, numbers, stamps = frames[:k] + frames[k + 1 :], numbers[:k] + numbers[k + 1 :], (
                stamps[:k] + stamps[k + 1 :]
            )  # fmt: skip
            rows = np.delete(rows, slice(n + 3 * k, n + 3 * k + 3))
        return state._replace(
            whole=rearranged(state.whole, rows), frames=frames, numbers=numbers, stamps=stamps, count=number + 1
        )

    def _closed(self, state: KeyframeState) -> KeyframeState:
        """State with the loops closed that the latest frame confirms."""
        settings, latest = self._keyframes, state.count - 1
        if not settings.closures or latest % settings.interval:
            return state
        oldest = latest - self._window.kept + 1
        found = self._candidates(state)
        pending = (*(c for c in state.pending if c.later >= oldest), *found)
        if not found:
            return state._replace(pending=pending)
        believed = self._agreeing(state, pending)
        if len(believed) < LEAST:
            return state._replace(pending=pending)
        closed, links, stamps = 0, list(state.links), dict(zip(state.numbers, state.stamps, strict=True))
        for k in believed:
            H, residual = self._innovation(state, pending[k])
            limit = chi_square(PROBABILITY, 3)
            whole, innovation = ekf.correct_linear(state.whole, H, residual, pending[k].covariance, limit)
            if innovation.accepted:
                closed += 1
                links += [(stamps[pending[k].later], stamps[earlier]) for earlier in pending[k].earlier]
            state = state._replace(whole=with_angles(whole, state.size))
        rest = tuple(c for k, c in enumerate(pending) if k not in believed)
        return state._replace(pending=rest, closed=state.closed + closed, links=tuple(links))

    def _candidates(self, state: KeyframeState) -> list[Closure]:
        """Matches of the latest frame with keyframes that look at the same floor: from alike, and from elsewhere."""
        settings, latest, poses = self._keyframes, state.count - 1, state.poses
        ahead = self.matcher.grid.ahead + 0.5 * sum(self.matcher.grid.ranges)
        looked_at = poses[:, :2] + ahead * np.stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])), axis=1)
        old = np.array([k for k, number in enumerate(state.numbers) if MARKED < number <= latest - settings.gap], int)
        turns = np.abs(wrapped(poses[old, 2] - poses[-1, 2]))
        distances = np.hypot(*(looked_at[old] - looked_at[-1]).T)
        near = (distances <= settings.distance) & (turns <= settings.turn)
        found = []
        for group, factor in (
            (near & (turns <= settings.alike), settings.covariance_factor),
            (near & (turns > settings.alike), settings.other_factor),
        ):
            nearest = old[group][np.argsort(distances[group])[: settings.support]].tolist()
            closure = self._matched(state, nearest, factor) if nearest else None
            found += [] if closure is None else [closure]
        return found

    def _matched(self, state: KeyframeState, earlier: Sequence[int], factor: float) -> Closure | None:
        """The match of the latest frame with some earlier ones."""
        settings, latest, n = self._keyframes, state.count - 1, state.size
        places = [n + 3 * k for k in earlier]
        relation = Relation.of_pose(state.whole, n, places, state.place(latest))
        prior = relation.covariance(0) + np.diag(np.square(settings.search_prior))
        expected, nearer = relation.relatives, self._nearer
        if nearer is not None:
            moved = np.pad(_by_nearer(relation), ((0, 0), (0, 1)))
            expected = compose(expected, moved * state.whole.mean[nearer])
            prior += np.outer(moved[0], moved[0]) * state.whole.covariance[nearer, nearer]
        frames = [state.frames[k] for k in earlier]
        found = match(self._closing, state.frames[-1], frames, expected, prior, settings.search)
        if isinstance(found, str) or found.log_likelihood < settings.ratio:
            return None
        if (np.abs(found.offset) > settings.search.limits).any():
            return None
        measured = compose(expected, found.offset)
        numbers = tuple(state.numbers[k] for k in earlier)
        return Closure(latest, numbers, measured, found.weights, factor * found.covariance)

    def _innovation(self, state: KeyframeState, closure: Closure) -> tuple[Array, Array]:
        """Derivative (3, n + 3 k) and residual (3,) of a closure in the present state."""
        places = [state.place(number) for number in closure.earlier]
        relation = Relation.of_pose(state.whole, state.size, places, state.place(closure.later))
        H = relation.jacobian(closure.weights)
        residual = closure.weights @ between(relation.relatives, closure.measured)
        if self._nearer is not None:
            H[:2, self._nearer] = closure.weights @ _by_nearer(relation)
            residual[:2] -= H[:2, self._nearer] * state.whole.mean[self._nearer]
        return H, residual

    def _agreeing(self, state: KeyframeState, pending: Sequence[Closure]) -> list[int]:
        """Indices of the largest set found of closures that agree with the state, and each with each other."""
        shown = [self._innovation(state, closure) for closure in pending]
        agree = np.zeros((len(pending), len(pending)), dtype=bool)
        P, limit = state.whole.covariance, chi_square(PROBABILITY, 6)
        for a in range(len(pending)):
            for b in range(a):
                H, r = np.vstack((shown[a][0], shown[b][0])), np.concatenate((shown[a][1], shown[b][1]))
                S = _seen(P, H)
                S[:3, :3] += pending[a].covariance
                S[3:, 3:] += pending[b].covariance
                agree[a, b] = agree[b, a] = r @ np.linalg.solve(S, r) <= limit
        return largest_clique(agree)


def _by_nearer(relation: Relation) -> Array:
    """How far (k, 2) a match is moved, in the later pose's axes, for each metre by which echoes come from before.

    Each frame sees what it sees nearer to itself, along its heading.
    """
    turn = -relation.relatives[:, 2]  # of the earlier heading from the later one
    return np.stack((1.0 - np.cos(turn), -np.sin(turn)), axis=1)


def _seen(P: Array, H: Array) -> Array:
    """H P H' of a derivative that is zero but in a few columns."""
    columns = np.flatnonzero(H.any(axis=0))
    return H[:, columns] @ P[np.ix_(columns, columns)] @ H[:, columns].T
