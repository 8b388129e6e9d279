"""Simultaneous localisation and mapping on detections: an extended Kalman filter with landmarks in its state.

Detections are peaks of the matched-filtered frame above a threshold, associated to the nearest landmark inside a gate.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter

from estimators.core import ekf
from estimators.core.consistency import chi_square
from estimators.core.history import Input, Node
from estimators.core.types import NO_MODEL, Array, Gaussian, Measurement, Models, ProcessModel, Verdicts, wrapped
from estimators.map_path.frames import KIND, fault
from estimators.map_path.likelihood import Matcher
from estimators.map_path.odometry import OdometryNoise


@dataclass(frozen=True, kw_only=True, slots=True)
class Detection:
    """How features are found and associated."""

    threshold: float = 3.2  # of a peak, in standard deviations of the filtered noise
    deviation: float = 0.25  # of its place, along each axis [m]
    gate: float = 0.99  # probability that a landmark's own detection is inside
    unseen: int = 6  # frames without a detection after which a landmark is forgotten
    most: int = 60  # landmarks


class LandmarkState(NamedTuple):
    """What a node keeps."""

    whole: Gaussian  # of the five states and the places of the landmarks (5 + 2 k)
    missed: tuple[int, ...] = ()  # (k,) frames since each landmark was last detected
    outliers: int = 0
    verdicts: Verdicts = ()

    @property
    def belief(self) -> Gaussian:
        """Of the five states; see `odometry`."""
        return Gaussian(mean=self.whole.mean[:5], covariance=self.whole.covariance[:5, :5])


class LandmarkFilter:
    """EKF-SLAM for a `History`; inputs are speed [m/s] and turn rate [rad/s].

    Args:
        matcher: Filters frames.
        start: Belief of the pose (3) at the first node.
        noise: How odometry errs.
        detection: How features are found.
        saturation: Value at which the receiver saturates.
    """

    def __init__(
        self,
        matcher: Matcher,
        start: Gaussian,
        *,
        noise: OdometryNoise | None = None,
        detection: Detection | None = None,
        saturation: float = np.inf,
    ) -> None:
        noise = noise or OdometryNoise()
        self.matcher, self.process, self._detection = matcher, noise.process(), detection or Detection()
        self.sensors: Models = {}
        self._start, self._saturation = noise.start(start), saturation

    def start(self, nodes: Sequence[Node[LandmarkState]], index: int) -> LandmarkState:
        """The known start, with the landmarks of the node's frame."""
        return self.correct(LandmarkState(self._start), nodes[index].time, nodes[index].measurements)

    def predict(self, state: LandmarkState, u: Input, duration: float) -> LandmarkState:
        """State after `duration` [s]; landmarks stay where they are."""
        mean, P = state.whole.mean.copy(), state.whole.covariance.copy()
        F = self.process.jacobian(mean[:5], u, duration)
        predicted = ekf.predict(state.belief, self.process, u, duration)
        mean[:5], P[:5, :5] = predicted.mean, predicted.covariance
        P[:5, 5:] = F @ P[:5, 5:]
        P[5:, :5] = P[:5, 5:].T
        return state._replace(whole=Gaussian(mean=mean, covariance=P), verdicts=())

    def correct(self, state: LandmarkState, node_time: float, measurements: Sequence[Measurement]) -> LandmarkState:
        """State after a node's frames; those that cannot be used are refused by name."""
        for measurement in measurements:
            reason = NO_MODEL
            if measurement.kind == KIND:
                reason = fault(measurement.value, self.matcher.grid.seen.size, self._saturation)
            if not reason:
                state = self._seen(state, self.detect(measurement.value))
            state = state._replace(verdicts=(*state.verdicts, (measurement, reason, np.nan)))
        return state

    def process_after(self, state: LandmarkState) -> ProcessModel:
        """For `smoothing`."""
        return self.process

    def detect(self, intensity: Array) -> Array:
        """Places (k, 2) of features: forward, starboard [m], the strongest first."""
        grid, values = self.matcher.grid, self.matcher.prepare(intensity).values
        inside = grid.holds(grid.centres, grid.cell)
        peaks = (values == maximum_filter(values, 3)) & inside
        peaks &= values > self._detection.threshold * self.matcher.noise_filtered
        rows, columns = np.nonzero(peaks)
        order = np.argsort(-values[rows, columns])
        rows, columns = rows[order], columns[order]
        offsets = []
        for before, after in (((rows - 1, columns), (rows + 1, columns)), ((rows, columns - 1), (rows, columns + 1))):
            low, middle, high = values[before], values[rows, columns], values[after]
            offsets.append(0.5 * (low - high) / np.minimum(low - 2.0 * middle + high, -1e-12))
        return grid.centres[rows, columns] + grid.cell * np.clip(np.stack(offsets, axis=1), -0.5, 0.5)

    def _seen(self, state: LandmarkState, places: Array) -> LandmarkState:
        """State after the detections of a frame: of known landmarks, then of new ones."""
        whole, missed = state.whole, list(state.missed)
        R = self._detection.deviation**2 * np.eye(2)
        limit, detected, new = chi_square(self._detection.gate, 2), set(), []
        for place in places:
            squares = [np.inf if k in detected else _distance(whole, k, place, R) for k in range(len(missed))]
            nearest = int(np.argmin(squares)) if squares else -1
            if nearest >= 0 and squares[nearest] <= limit:
                expected, H = _shown(whole.mean, nearest)
                whole, _ = ekf.correct_linear(whole, H, place - expected, R)
                whole = Gaussian(mean=wrapped(whole.mean, (2,)), covariance=whole.covariance)
                detected.add(nearest)
            elif not squares or min(squares) > 4.0 * limit:  # between the two it may be either
                new.append(place)
        for k in range(len(missed)):
            missed[k] = 0 if k in detected else missed[k] + 1
        kept = [k for k, count in enumerate(missed) if count <= self._detection.unseen]
        whole, missed = _without(whole, kept), [missed[k] for k in kept]
        for place in new[: self._detection.most - len(missed)]:
            whole = _with(whole, place, R)
            missed.append(0)
        return state._replace(whole=whole, missed=tuple(missed))


def _shown(mean: Array, index: int) -> tuple[Array, Array]:
    """Where a landmark lies from the vehicle (2,), and the derivative (2, n)."""
    place = 5 + 2 * index
    c, s = np.cos(mean[2]), np.sin(mean[2])
    turn = np.array([[c, s], [-s, c]])
    seen = turn @ (mean[place : place + 2] - mean[:2])
    H = np.zeros((2, mean.size))
    H[:, :2], H[:, place : place + 2] = -turn, turn
    H[:, 2] = seen[1], -seen[0]
    return seen, H


def _distance(whole: Gaussian, index: int, place: Array, R: Array) -> float:
    """Normalised square of a detection's distance from a landmark."""
    columns = [0, 1, 2, 5 + 2 * index, 6 + 2 * index]
    expected, H = _shown(whole.mean, index)
    H = H[:, columns]
    error = place - expected
    return float(error @ np.linalg.solve(H @ whole.covariance[np.ix_(columns, columns)] @ H.T + R, error))


def _with(whole: Gaussian, place: Array, R: Array) -> Gaussian:
    """The belief with a landmark more, where it was seen."""
    mean, P = whole.mean, whole.covariance
    c, s = np.cos(mean[2]), np.sin(mean[2])
    turn = np.array([[c, -s], [s, c]])
    offset = turn @ place
    J = np.zeros((2, mean.size))
    J[:, :2] = np.eye(2)
    J[:, 2] = -offset[1], offset[0]
    corner = J @ P @ J.T + turn @ R @ turn.T
    covariance = np.block([[P, P @ J.T], [J @ P, corner]])
    return Gaussian(mean=np.concatenate((mean, mean[:2] + offset)), covariance=covariance)


def _without(whole: Gaussian, kept: list[int]) -> Gaussian:
    """The belief with some of its landmarks only."""
    rows = np.concatenate((np.arange(5), *(np.array([5 + 2 * k, 6 + 2 * k]) for k in kept))).astype(int)
    return Gaussian(mean=whole.mean[rows], covariance=whole.covariance[np.ix_(rows, rows)])
