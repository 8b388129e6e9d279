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
from estimators.map_path.matching import Search, match
from estimators.map_path.odometry import POSE, OdometryNoise
from estimators.map_path.poses import between, between_jacobians

NIS_GATE = 0.9999  # a match outside is refused
OUTLIER = "outlier"


@dataclass(frozen=True, kw_only=True, slots=True)
class Window:
    """Which of the earlier frames a frame is matched against."""

    kept: int = 12  # the last ones
    lags: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 10, 12)  # of these, counted from the latest


class WindowState(NamedTuple):
    """What a node keeps."""

    whole: Gaussian  # of the five states and the poses of the window's frames, the latest last (5 + 3 k)
    frames: tuple[Prepared, ...] = ()  # of the window
    outliers: int = 0
    verdicts: Verdicts = ()

    @property
    def belief(self) -> Gaussian:
        """Of north, east, heading and the biases of speed and turn rate."""
        return Gaussian(mean=self.whole.mean[:5], covariance=self.whole.covariance[:5, :5])


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
        noise = noise or OdometryNoise()
        self._start, self._window, self._search = noise.start(start), window or Window(), search or Search()
        model = replace(matcher.model, together=len(self._window.lags))
        self.matcher, self.process = Matcher(matcher.grid, model), noise.process()
        self.sensors: Models = {}
        self._saturation = saturation

    def start(self, nodes: Sequence[Node[WindowState]], index: int) -> WindowState:
        """The known start, with the node's frame as the first of the window."""
        return self.correct(WindowState(self._start), nodes[index].time, nodes[index].measurements)

    def predict(self, state: WindowState, u: Input, duration: float) -> WindowState:
        """State after `duration` [s]."""
        mean, covariance = state.whole.mean.copy(), state.whole.covariance.copy()
        F = np.ascontiguousarray(self.process.jacobian(mean[:5], u, duration))
        predicted = ekf.predict(state.belief, self.process, u, duration)
        mean[:5] = predicted.mean
        covariance[:5, 5:] = F @ covariance[:5, 5:]
        covariance[5:, :5] = covariance[:5, 5:].T
        covariance[:5, :5] = predicted.covariance
        return state._replace(whole=Gaussian(mean=mean, covariance=covariance), verdicts=())

    def correct(self, state: WindowState, node_time: float, measurements: Sequence[Measurement]) -> WindowState:
        """State after a node's frames; those that cannot be used are refused by name."""
        for measurement in measurements:
            if measurement.kind != KIND:
                state = state._replace(verdicts=(*state.verdicts, (measurement, NO_MODEL, np.nan)))
                continue
            reason, nis = fault(measurement.value, self.matcher.grid.seen.size, self._saturation), np.nan
            if not reason:
                frame = self.matcher.prepare(measurement.value)
                if state.frames:
                    state, reason, nis = self._placed(state, frame)
                state = self._with(state, frame)
            state = state._replace(verdicts=(*state.verdicts, (measurement, reason, nis)))
        return state

    def process_after(self, state: WindowState) -> ProcessModel:
        """For `smoothing`."""
        return self.process

    def _placed(self, state: WindowState, frame: Prepared) -> tuple[WindowState, str, float]:
        """State with a frame matched against the window, or why it was not, and the match's NIS."""
        count = len(state.frames)
        chosen = [count - lag for lag in self._window.lags if lag <= count]
        pose, clones = state.whole.mean[POSE], state.whole.mean[5:].reshape(-1, 3)[chosen]
        jacobians = [_in_later_axes(clone, pose) for clone in clones]
        P, latest = state.whole.covariance, 5 + 3 * chosen[0]
        places = [0, 1, 2, latest, latest + 1, latest + 2]
        both = np.hstack((jacobians[0][1], jacobians[0][0]))
        prior = both @ P[np.ix_(places, places)] @ both.T + 1e-8 * np.eye(3)
        earlier = [state.frames[k] for k in chosen]
        found = match(self.matcher, frame, earlier, between(clones, pose), prior, self._search)
        if isinstance(found, str):
            return state, found, np.nan
        H = np.zeros((3, state.whole.mean.size))
        for k, (by_clone, by_pose), weight in zip(chosen, jacobians, found.weights, strict=True):
            H[:, POSE] += weight * by_pose
            H[:, 5 + 3 * k : 8 + 3 * k] = weight * by_clone
        limit = chi_square(NIS_GATE, 3)
        whole, innovation = ekf.correct_linear(state.whole, H, found.offset, found.covariance, limit)
        if not innovation.accepted:
            return state._replace(outliers=state.outliers + 1), OUTLIER, innovation.nis
        angles = (2, *range(7, whole.mean.size, 3))
        whole = Gaussian(mean=wrapped(whole.mean, angles), covariance=whole.covariance)
        return state._replace(whole=whole), "", innovation.nis

    def _with(self, state: WindowState, frame: Prepared) -> WindowState:
        """State with the vehicle's pose cloned as that of a frame, and without the oldest frame too many."""
        n = state.whole.mean.size
        rows = np.concatenate((np.arange(n), np.arange(3)))
        frames = (*state.frames, frame)
        if len(frames) > self._window.kept:
            frames, rows = frames[1:], np.concatenate((rows[:5], rows[8:]))
        whole = Gaussian(mean=state.whole.mean[rows], covariance=state.whole.covariance[np.ix_(rows, rows)])
        return state._replace(whole=whole, frames=frames)


def _in_later_axes(earlier: Array, later: Array) -> tuple[Array, Array]:
    """Derivatives (3, 3) of the relative pose, in the later pose's axes, by the earlier and the later pose."""
    by_earlier, by_later = between_jacobians(earlier, later)
    turn = later[2] - earlier[2]
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return turned @ by_earlier, turned @ by_later
