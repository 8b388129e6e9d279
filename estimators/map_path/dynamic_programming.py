"""The most probable path by dynamic programming over sonar frames (paper 5, eq. 1 to 13), for a `History`.

Beside the maxima, which give the path, the same trellis is summed over: that gives the covariance of pose and errors.
"""

from collections.abc import Sequence
from typing import NamedTuple, Optional

import numpy as np

from estimators.core.history import Input, Node
from estimators.core.types import NO_MODEL, Array, Gaussian, Measurement, Verdicts
from estimators.map_path import poses
from estimators.map_path.frames import KIND, fault
from estimators.map_path.likelihood import Matcher, Prepared
from estimators.map_path.matching import LEAST_CELLS, NO_OVERLAP, Search, scatter_at
from estimators.map_path.trellis import ErrorLattice, advance, mix

REMEMBERED = 12  # matches over which their scatter is averaged


class Step(NamedTuple):
    """From one frame to the next, with those before."""

    before: Optional["Step"]
    time: float  # of the later frame [s]
    came_from: np.ndarray  # (k,) the node before of each node
    increments: Array  # (k, 3) motion between the frames at each node
    motion: tuple[poses.Input, ...]  # what odometry said of it


class Moments(NamedTuple):
    """Probabilities of the nodes, and mean and covariance of the pose given each."""

    log_weights: Array  # (k,) of sum 1
    means: Array  # (k, 3), headings not wrapped
    covariances: Array  # (k, 3, 3)


class PathState(NamedTuple):
    """What a node of the history keeps."""

    lattice: ErrorLattice
    scores: Array  # (k,) log probability of the best path to each node of the trellis
    ends: Array  # (k, 3) pose at the last frame on that path
    moments: Moments
    frame: Prepared | None = None  # the last one
    motion: tuple[poses.Input, ...] = ()  # since then
    step: Step | None = None  # the last one; None before the second frame
    outliers: int = 0
    verdicts: Verdicts = ()
    scatter: tuple[float, int] = (0.0, 0)  # mean logarithm of the matches' scatter of late, and matches so far

    @property
    def belief(self) -> Gaussian:
        """The pose at the end of the best path and the biases there, with the covariance of all paths."""
        best, errors = int(np.argmax(self.scores)), self.lattice.errors
        moved = poses.increments(self.motion, errors)
        pose = poses.compose(self.ends[best], moved[best])
        log_weights, means, covariances = _moved(self.moments, moved)
        weights = np.exp(log_weights)
        states = np.column_stack((means, errors))
        offsets = states - weights @ states
        covariance = (weights * offsets.T) @ offsets
        covariance[:3, :3] += np.einsum("k,kij->ij", weights, covariances)
        cell = [2.0 * a[-1] / max(len(a) - 1, 1) for a in self.lattice.axes]
        covariance[[3, 4], [3, 4]] += np.square(cell) / 12.0
        return Gaussian(mean=np.concatenate((pose, errors[best])), covariance=covariance)

    def path(self, lag: int | None = None) -> list[tuple[float, Array]]:
        """Times [s] and poses (3,) of the best path at the frames after the first; of the last `lag` ones only."""
        node, found, step = int(np.argmax(self.scores)), [], self.step
        pose = self.ends[node]
        while step is not None and (lag is None or len(found) < lag):
            found.append((step.time, pose))
            back = step.increments[node]
            pose = poses.compose(pose, poses.between(back, np.zeros(3)))
            node, step = int(step.came_from[node]), step.before
        return found[::-1]


class PathFilter:
    """Maximum a posteriori path on a trellis of odometry errors; inputs are speed [m/s] and turn rate [rad/s].

    Args:
        matcher: Compares two frames.
        start: Belief of the pose (3) at the first node; as nothing sees it, it stays what it is.
        lattice: The errors of odometry.
        flat: Whether errors of different intervals are taken as independent: each frame is then judged by itself.
        saturation: Value at which the receiver saturates.
        scatter: Whether the log-likelihood is divided by how far matches are found to scatter beyond it, see
            `matching.score_covariance`; it is never multiplied.
    """

    def __init__(
        self,
        matcher: Matcher,
        start: Gaussian,
        *,
        lattice: ErrorLattice | None = None,
        flat: bool = False,
        saturation: float = np.inf,
        scatter: bool = False,
    ) -> None:
        self.matcher, self.lattice, self._scatter = matcher, lattice or ErrorLattice(), scatter
        self._start, self._flat, self._saturation = start, flat, saturation

    def start(self, nodes: Sequence[Node[PathState]], index: int) -> PathState:
        """The known start, with the node's frame as the first."""
        k = len(self.lattice.errors)
        means, covariances = np.tile(self._start.mean, (k, 1)), np.tile(self._start.covariance, (k, 1, 1))
        moments = Moments(np.full(k, -np.log(k)), means, covariances)
        state = PathState(self.lattice, np.zeros(k), means, moments)
        return self.correct(state, nodes[index].time, nodes[index].measurements)

    def predict(self, state: PathState, u: Input, duration: float) -> PathState:
        """State after `duration` [s]: odometry is kept until a frame says how wrong it was."""
        return state._replace(motion=(*state.motion, poses.Input(u[0], u[1], duration)), verdicts=())

    def correct(self, state: PathState, node_time: float, measurements: Sequence[Measurement]) -> PathState:
        """State after a node's frames; those that cannot be used are refused by name."""
        for measurement in measurements:
            reason = NO_MODEL
            if measurement.kind == KIND:
                reason = fault(measurement.value, self.matcher.grid.seen.size, self._saturation)
            if not reason:
                frame = self.matcher.prepare(measurement.value)
                if state.frame is not None and state.motion:
                    state, reason = self._stepped(state, node_time, frame)
                state = state._replace(frame=frame)
            state = state._replace(verdicts=(*state.verdicts, (measurement, reason, np.nan)))
        return state

    def _stepped(self, state: PathState, time: float, frame: Prepared) -> tuple[PathState, str]:
        """State after the step of the trellis to a frame, and why the frame said nothing if so."""
        errors, earlier = self.lattice.errors, state.frame
        assert earlier is not None
        increments = poses.increments(state.motion, errors)
        cells = self.matcher.shared_cells(poses.increments(state.motion, np.zeros((1, 2)))[0])
        log_likelihood, reason = np.zeros(len(errors)), NO_OVERLAP
        if np.count_nonzero(cells) >= LEAST_CELLS:
            log_likelihood, reason = self.matcher.log_likelihood(frame, earlier, increments, cells), ""
            if self._scatter:
                best = increments[int(np.argmax(log_likelihood))]
                state = _learnt(state, scatter_at(self.matcher, frame, earlier, best, cells, Search()))
                log_likelihood = log_likelihood * np.exp(-max(state.scatter[0], 0.0))
        first, second = self.lattice.transitions(sum(u.duration for u in state.motion))
        transitions = (np.zeros_like(first), np.zeros_like(second)) if self._flat else (first, second)
        scores, came_from = advance(state.scores, log_likelihood, transitions)
        step = Step(state.step, time, came_from, increments, state.motion)
        moments = _moved(_mixed(state.moments, log_likelihood, transitions), increments)
        ends = poses.compose(state.ends[came_from], increments)
        spread = self._within_cell(state.motion, moments.means)
        moments = moments._replace(covariances=moments.covariances + spread)
        return state._replace(scores=scores - scores.max(), ends=ends, moments=moments, motion=(), step=step), reason

    def _within_cell(self, motion: tuple[poses.Input, ...], means: Array) -> Array:
        """Covariance (k, 3, 3) of the motion of errors that are spread evenly over a cell of the lattice."""
        duration = sum(u.duration for u in motion)
        along, turn = (2.0 * a[-1] / max(len(a) - 1, 1) * duration for a in self.lattice.axes)
        c, s = np.cos(means[:, 2]), np.sin(means[:, 2])
        direction = np.stack((c, s, np.zeros_like(c)), axis=1)
        spread = along**2 / 12.0 * np.einsum("ki,kj->kij", direction, direction)
        spread[:, 2, 2] += turn**2 / 12.0
        return spread


def _learnt(state: PathState, scatter: float) -> PathState:
    """State with the scatter of one more match, if it is known."""
    mean, count = state.scatter
    if not scatter > 0.0:
        return state
    mean += (np.log(scatter) - mean) / min(count + 1, REMEMBERED)
    return state._replace(scatter=(mean, count + 1))


def _mixed(moments: Moments, log_likelihood: Array, transitions: tuple[Array, Array]) -> Moments:
    """The moments of the nodes of the next step, before any motion."""
    joint = mix(moments.log_weights, transitions)
    largest = joint.max(axis=1, keepdims=True)
    probabilities = np.exp(joint - largest)
    totals = probabilities.sum(axis=1)
    probabilities /= totals[:, None]
    log_weights = largest[:, 0] + np.log(totals) + log_likelihood
    log_weights -= log_weights.max()
    log_weights -= np.log(np.exp(log_weights).sum())
    centre = np.exp(moments.log_weights) @ moments.means
    offsets = moments.means - centre
    squares = moments.covariances + offsets[:, :, None] * offsets[:, None, :]
    shifted = probabilities @ offsets
    second = (probabilities @ squares.reshape(-1, 9)).reshape(-1, 3, 3)
    return Moments(log_weights, shifted + centre, second - shifted[:, :, None] * shifted[:, None, :])


def _moved(moments: Moments, increments: Array) -> Moments:
    """The moments after a motion (k, 3) at each node."""
    c, s = np.cos(moments.means[:, 2]), np.sin(moments.means[:, 2])
    north = c * increments[:, 0] - s * increments[:, 1]
    east = s * increments[:, 0] + c * increments[:, 1]
    F = np.tile(np.eye(3), (len(increments), 1, 1))
    F[:, 0, 2], F[:, 1, 2] = -east, north
    means = moments.means + np.stack((north, east, increments[:, 2]), axis=1)
    return Moments(moments.log_weights, means, F @ moments.covariances @ np.swapaxes(F, 1, 2))
