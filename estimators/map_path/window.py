"""Maximum a posteriori pose of each frame against a window of earlier ones, by stochastic cloning.

The filter's state holds the poses of the window's frames beside the vehicle's (Roumeliotis and Burdick 2002): a match
says where the vehicle is relative to them, so their errors and the vehicle's remain correlated as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from estimators.core import ekf
from estimators.core.consistency import chi_square
from estimators.core.history import Input, Node
from estimators.core.types import NO_MODEL, Array, Gaussian, Measurement, Models, ProcessModel, Verdicts, wrapped
from estimators.map_path.frames import KIND, fault
from estimators.map_path.likelihood import Matcher, Prepared
from estimators.map_path.matching import NO_OVERLAP, Search, match
from estimators.map_path.odometry import RELIEF, OdometryNoise
from estimators.map_path.poses import between, between_jacobians

NIS_GATE = 0.9999  # a match outside is refused
OUTLIER = "outlier"


@dataclass(frozen=True, kw_only=True, slots=True)
class Window:
    """Which of the earlier frames a frame is matched against."""

    kept: int = 12  # the last ones
    lags: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 10, 12)  # of these, counted from the latest
    interval: int = 1  # frames from one that is matched to the next
    covariance_factor: float = 1.0  # of a match, for what the frames' model leaves out: relief, errors that last
    scatter: bool = False  # whether that is learnt from the frames beside it, see `matching.score_covariance`
    relief: float = (
        0.0  # deviation of relative errors of distances between frames; unless 0, `odometry.RELIEF` are states
    )
    relief_time: float = np.inf  # time constant with which those decay [s]


class WindowState(NamedTuple):
    """What a node keeps."""

    whole: Gaussian  # of the vehicle's states and the poses of the window's frames, the latest last (n + 3 k)
    frames: tuple[Prepared, ...] = ()  # of the window
    outliers: int = 0
    verdicts: Verdicts = ()
    count: int = 0  # frames so far

    @property
    def size(self) -> int:
        """Number n of the vehicle's states."""
        return self.whole.mean.size - 3 * len(self.frames)

    @property
    def belief(self) -> Gaussian:
        """Of the vehicle's states, of which the first are north, east and heading."""
        n = self.size
        return Gaussian(mean=self.whole.mean[:n], covariance=self.whole.covariance[:n, :n])


class WindowFilter:
    """Frame-to-window matching for a `History`; inputs are speed [m/s] and turn rate [rad/s].

    Args:
        matcher: Of the frames' grid and model; that a frame is compared with several at once is seen to here.
        start: Belief of the pose (3) at the first node.
        noise: How odometry errs.
        window: Which frames to match against.
        search: Which poses to try.
        saturation: Value at which the receiver saturates.
    """

    def __init__(
        self,
        matcher: Matcher,
        start: Gaussian,
        *,
        noise: OdometryNoise | None = None,
        window: Window | None = None,
        search: Search | None = None,
        saturation: float = np.inf,
    ) -> None:
        noise, window = noise or OdometryNoise(), window or Window()
        self._start, self._window, self._search = noise.start(start, window.relief), window, search or Search()
        model = replace(matcher.model, together=len(window.lags))
        self.matcher, self.process = Matcher(matcher.grid, model), noise.process(window.relief, window.relief_time)
        self.sensors: Models = {}
        self._saturation = saturation

    def start(self, nodes: Sequence[Node[WindowState]], index: int) -> WindowState:
        """The known start, with the node's frame as the first of the window."""
        return self.correct(WindowState(self._start), nodes[index].time, nodes[index].measurements)

    def predict(self, state: WindowState, u: Input, duration: float) -> WindowState:
        """State after `duration` [s]."""
        return state._replace(whole=predicted(state.whole, state.size, self.process, u, duration), verdicts=())

    def correct(self, state: WindowState, node_time: float, measurements: Sequence[Measurement]) -> WindowState:
        """State after a node's frames; those that cannot be used are refused by name."""
        for measurement in measurements:
            if measurement.kind != KIND:
                state = state._replace(verdicts=(*state.verdicts, (measurement, NO_MODEL, np.nan)))
                continue
            reason, nis = fault(measurement.value, self.matcher.grid.seen.size, self._saturation), np.nan
            if not reason:
                frame = self.matcher.prepare(measurement.value)
                if state.frames and state.count % self._window.interval == 0:
                    state, reason, nis, scatter = self._placed(state, frame)
                    frame = frame._replace(scatter=scatter)
                state = self._with(state, frame)
            state = state._replace(verdicts=(*state.verdicts, (measurement, reason, nis)))
        return state

    def process_after(self, state: WindowState) -> ProcessModel:
        """For `smoothing`."""
        return self.process

    def _relief(self) -> slice | None:
        """Which of the process' states are `odometry.RELIEF`; None if it has none of them."""
        space = getattr(self.process, "space", None)
        if space is None or RELIEF[0] not in space.names:
            return None
        first = space.index(RELIEF[0])
        return slice(first, first + len(RELIEF))

    def _placed(self, state: WindowState, frame: Prepared) -> tuple[WindowState, str, float, float]:
        """State with a frame matched against the window, or why it was not, the match's NIS and how it scatters."""
        chosen = [len(state.frames) - lag for lag in self._window.lags if lag <= len(state.frames)]
        if not chosen:
            return state, NO_OVERLAP, np.nan, np.nan
        earlier = [state.frames[k] for k in chosen]
        relation = Relation.of_pose(state.whole, state.size, [state.size + 3 * k for k in chosen])
        prior = relation.covariance(0) + 1e-8 * np.eye(3)
        relatives, relief = relation.relatives, self._relief()
        if relief is not None:
            relatives = relatives + relation.by_relief() @ state.whole.mean[relief]
        found = match(self.matcher, frame, earlier, relatives, prior, self._search, self._window.scatter)
        if isinstance(found, str):
            return state, found, np.nan, np.nan
        H = relation.jacobian(found.weights)
        if relief is not None:
            H[:, relief] = np.tensordot(found.weights, relation.by_relief(later_axes=True), 1)
        limit = chi_square(NIS_GATE, 3)
        R = self._window.covariance_factor * _scatter(state.frames, found.scatter) * found.covariance
        whole, innovation = ekf.correct_linear(state.whole, H, found.offset, R, limit)
        if not innovation.accepted:
            return state._replace(outliers=state.outliers + 1), OUTLIER, innovation.nis, found.scatter
        return state._replace(whole=with_angles(whole, state.size)), "", innovation.nis, found.scatter

    def _with(self, state: WindowState, frame: Prepared) -> WindowState:
        """State with the vehicle's pose cloned as that of a frame, and without the oldest frame too many."""
        n, frames = state.size, (*state.frames, frame)
        rows = np.concatenate((np.arange(state.whole.mean.size), np.arange(3)))
        if len(frames) > self._window.kept:
            frames, rows = frames[1:], np.concatenate((rows[:n], rows[n + 3 :]))
        return state._replace(whole=rearranged(state.whole, rows), frames=frames, count=state.count + 1)


class Relation(NamedTuple):
    """A pose in a state relative to poses of earlier frames in it, and its derivatives in the later pose's axes."""

    whole: Gaussian
    later: int  # where it begins in the state
    earlier: Sequence[int]  # where those begin
    relatives: Array  # (k, 3)
    derivatives: Sequence[tuple[Array, Array]]  # (3, 3) by the earlier and by the later pose

    @classmethod
    def of_pose(cls, whole: Gaussian, size: int, earlier: Sequence[int], later: int = 0) -> "Relation":
        """Of the vehicle's pose, or of that of a frame.

        Args:
            whole: of the vehicle's states and of frames.
            size: number of the vehicle's states.
            earlier: where the poses of the earlier frames begin.
            later: where the later pose begins.
        """
        pose, clones = whole.mean[later : later + 3], np.array([whole.mean[k : k + 3] for k in earlier])
        return cls(whole, later, earlier, between(clones, pose), [_in_later_axes(clone, pose) for clone in clones])

    def covariance(self, which: int) -> Array:
        """Covariance (3, 3) of the pose relative to one of the earlier ones."""
        places = [self.later + i for i in range(3)] + [self.earlier[which] + i for i in range(3)]
        both = np.hstack(self.derivatives[which][::-1])
        return both @ self.whole.covariance[np.ix_(places, places)] @ both.T

    def by_relief(self, later_axes: bool = False) -> Array:
        """Derivative (k, 3, 3) of what frames show of the relative poses by the states `odometry.RELIEF`."""
        moved = -between(self.relatives, np.zeros(3)) if later_axes else self.relatives
        derivative = np.zeros((len(moved), 3, 3))
        derivative[:, 0, :2], derivative[:, 1, :2] = moved[:, [0, 1]] * (1.0, -1.0), moved[:, [1, 0]]
        derivative[:, 2, 2] = np.hypot(moved[:, 0], moved[:, 1])
        return derivative

    def jacobian(self, weights: Array) -> Array:
        """Derivative (3, n + 3 k) of the mean of the relative poses with some weights (k,) by the whole state."""
        H = np.zeros((3, self.whole.mean.size))
        for place, (by_earlier, by_later), weight in zip(self.earlier, self.derivatives, weights, strict=True):
            H[:, self.later : self.later + 3] += weight * by_later
            H[:, place : place + 3] += weight * by_earlier
        return H


def _scatter(frames: Sequence[Prepared], own: float) -> float:
    """Geometric mean of the scatter of a match and of those of frames before, as each alone is noisy; 1 of none."""
    known = [s for s in (own, *(frame.scatter for frame in frames)) if np.isfinite(s)]
    return float(np.exp(np.mean(np.log(known)))) if known else 1.0


def predicted(whole: Gaussian, size: int, process: ProcessModel, u: Input, duration: float) -> Gaussian:
    """A belief of the vehicle's states and of frames' poses after `duration` [s]: the frames stay where they are."""
    mean, covariance = whole.mean.copy(), whole.covariance.copy()
    F = np.ascontiguousarray(process.jacobian(mean[:size], u, duration))
    belief = Gaussian(mean=mean[:size], covariance=whole.covariance[:size, :size])
    moved = ekf.predict(belief, process, u, duration)
    mean[:size] = moved.mean
    covariance[:size, size:] = F @ covariance[:size, size:]
    covariance[size:, :size] = covariance[:size, size:].T
    covariance[:size, :size] = moved.covariance
    return Gaussian(mean=mean, covariance=covariance)


def with_angles(whole: Gaussian, size: int) -> Gaussian:
    """The poses with all headings in (-pi, pi]."""
    angles = (2, *range(size + 2, whole.mean.size, 3))
    return Gaussian(mean=wrapped(whole.mean, angles), covariance=whole.covariance)


def rearranged(whole: Gaussian, rows: np.ndarray) -> Gaussian:
    """A belief of some components of another, in any order, any of them more than once."""
    return Gaussian(mean=whole.mean[rows], covariance=whole.covariance[np.ix_(rows, rows)])


def _in_later_axes(earlier: Array, later: Array) -> tuple[Array, Array]:
    """Derivatives (3, 3) of the relative pose, in the later pose's axes, by the earlier and the later pose."""
    by_earlier, by_later = between_jacobians(earlier, later)
    turn = later[2] - earlier[2]
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return turned @ by_earlier, turned @ by_later
