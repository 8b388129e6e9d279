"""Yardsticks for the followers of paper 3: the whole trajectory at its most probable, and a particle filter.

Both hear everything at once, as the oracle does, and have the leader's error e as a state. That is of dead reckoning,
moves with the leader's own displacement, and is told by no packet; a pulse measures |own leader - e - follower|.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from auvsim.reproduce.paper3.follow import SAMPLE, Track
from auvsim.reproduce.paper3.truths import STEP, Run
from estimators.core import batch
from estimators.core.consistency import normalised_square
from estimators.core.errors import NotFiniteError
from estimators.core.history import Node
from estimators.core.particle import ParticleFilter, ParticleState, drawn
from estimators.core.types import Array, Gaussian, Measurement, MeasurementModel, ProcessModel
from estimators.path_prediction.messages import Packet, Pulse

RANGE = "range"
ACROSS = 1e-3  # density of the noise across the way, without which no covariance can be inverted [m^2/s]
PARTICLES = 2000


class Pair(ProcessModel):
    """Follower's pose and leader's error (6,); inputs are speed, yaw rate, and the leader's own move and heading."""

    def __init__(self, run: Run) -> None:
        self._noise = run.noise

    def evaluate(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """State after `dt`."""
        return self.move(x[None], u, dt)[0]

    def move(self, points: Array, u: Sequence[float], dt: float) -> Array:
        """States (k, 6) after `dt`."""
        speed, yaw_rate, north, east, _ = u
        x = points.copy()
        x[:, 0] += dt * speed * np.cos(points[:, 2])
        x[:, 1] += dt * speed * np.sin(points[:, 2])
        x[:, 2] += dt * yaw_rate
        x[:, 3] -= east * points[:, 5]
        x[:, 4] += north * points[:, 5]
        return x

    def jacobian(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Derivative (6, 6) of `evaluate`."""
        speed, _, north, east, _ = u
        F = np.eye(6)
        F[0, 2], F[1, 2] = -dt * speed * math.sin(x[2]), dt * speed * math.cos(x[2])
        F[3, 5], F[4, 5] = -east, north
        return F

    def covariance(self, x: Array, u: Sequence[float], dt: float) -> Array:
        """Of the odometry of both, and a little across their ways."""
        Q = np.zeros((6, 6))
        for at, heading, noise in ((0, x[2], self._noise.follower), (3, u[4], self._noise.leader)):
            c, s = math.cos(heading), math.sin(heading)
            R = np.array([[c, -s], [s, c]])
            Q[at : at + 2, at : at + 2] = dt * R @ np.diag([noise.speed, ACROSS]) @ R.T
            Q[at + 2, at + 2] = dt * noise.yaw_rate
        return Q


class LeaderRange(MeasurementModel):
    """Range to the leader, whose own estimate the parameters are."""

    def evaluate(self, x: Array, measurement: Measurement) -> Array:
        """Range (1,) [m]."""
        return self.evaluate_each(x[None], measurement)[0]

    def evaluate_each(self, points: Array, measurement: Measurement) -> Array:
        """Ranges (k, 1)."""
        away = np.array(measurement.parameters) - points[:, 3:5] - points[:, :2]
        return np.hypot(away[:, 0], away[:, 1])[:, None]

    def jacobian(self, x: Array, measurement: Measurement) -> Array:
        """Derivative (1, 6)."""
        away = np.array(measurement.parameters) - x[3:5] - x[:2]
        unit = away / max(float(np.hypot(*away)), 1e-9)
        return np.array([[-unit[0], -unit[1], 0.0, -unit[0], -unit[1], 0.0]])


def most_probable(run: Run) -> Track:
    """The track of the whole trajectory given all ranges (core.batch).

    Where the search does not converge, which happens at the paper's noise, the track is that of the extended Kalman
    filter from which it starts.
    """
    nodes = _nodes(run)
    means, covariances = _followed(run)
    picked = np.arange(round(SAMPLE / STEP), len(nodes), round(SAMPLE / STEP))
    try:
        found = batch.solve(nodes, _prior(run), Pair(run), {RANGE: LeaderRange()}, means, iterations=40, tolerance=1e-3)
    except NotFiniteError:
        return _track(run, means[picked], covariances[picked])
    return _track(run, found.means[picked], np.array([found.covariance(k)[:2, :2] for k in picked.tolist()]))


def particle(run: Run) -> Track:
    """The track of core's bootstrap particle filter."""
    filter_ = ParticleFilter(
        Pair(run), {RANGE: LeaderRange()}, drawn(_prior(run), PARTICLES), threshold=0.5, tail=1e-6, seed=1
    )
    state: ParticleState | None = None
    nodes, beliefs, every = _nodes(run), [], round(SAMPLE / STEP)
    for k, node in enumerate(nodes):
        if state is None:
            state = filter_.start(nodes, 0)
            assert state is not None
            continue
        state = filter_.predict(state, nodes[k - 1].input, node.time - nodes[k - 1].time)
        state = filter_.correct(state, node.time, node.measurements)
        if k % every == 0:
            beliefs.append(state.belief)
    return _track(run, np.array([b.mean for b in beliefs]), np.array([b.covariance[:2, :2] for b in beliefs]))


def _prior(run: Run) -> Gaussian:
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = covariance[3:, 3:] = run.start.covariance
    return Gaussian(mean=np.array([*run.start.mean, 0.0, 0.0, 0.0]), covariance=covariance)


def _nodes(run: Run) -> list[Node]:
    """One each step, with the pulses that a follower would hear without delay."""
    own, moves = run.leader_own, np.diff(run.leader_own[:, :2], axis=0)
    inputs = np.column_stack((run.odometry, moves, own[:-1, 2]))
    nodes = [Node(STEP * k, tuple(u), [], True) for k, u in enumerate([*inputs.tolist(), inputs[-1].tolist()])]
    places = {event.number: event.pose[:2] for event in run.prompt if isinstance(event, Packet)}
    for event in run.prompt:
        if isinstance(event, Pulse) and event.emitted > 0.0:
            shown = Measurement(
                kind=RANGE, value=np.array([event.range]), covariance=np.array([[event.range_variance]]),
                stamp=event.emitted, received=event.emitted, parameters=tuple(places[event.number].tolist()),
            )  # fmt: skip
            nodes[round(event.emitted / STEP)].measurements.append(shown)
    return nodes


def _followed(run: Run) -> tuple[Array, Array]:
    """States (k + 1, 6) of an extended Kalman filter over the nodes, and covariances (k + 1, 2, 2) of the place."""
    nodes, process, model, prior = _nodes(run), Pair(run), LeaderRange(), _prior(run)
    x, P = prior.mean.copy(), prior.covariance.copy()
    found, spread = [x], [P[:2, :2]]
    for before, node in pairwise(nodes):
        x, P, _ = process.propagate(x, P, before.input, node.time - before.time)
        for m in node.measurements:
            H = model.jacobian(x, m)
            gain = P @ H.T / (H @ P @ H.T + m.covariance)
            x, P = x + gain[:, 0] * (m.value - model.evaluate(x, m)), P - gain @ H @ P
        found.append(x)
        spread.append(P[:2, :2])
    return np.array(found), np.array(spread)


def _track(run: Run, means: Array, covariances: Array) -> Track:
    every = round(SAMPLE / STEP)
    at = np.arange(every, len(run.follower), every)
    times: Array = np.multiply(at, STEP, dtype=np.float64)
    errors = means[:, :2] - run.follower[at, :2]
    leader = run.leader_own[at, :2] - means[:, 3:5] - run.leader[at, :2]
    return Track(times, errors, normalised_square(errors, covariances) / 2.0, errors - leader, leader)
