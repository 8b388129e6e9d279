"""Smoothing over the buffer and the batch estimate: against dense least squares, each other, and the filter."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim.reproduce.paper1.runs import Conditions, follow, simulate, track
from auvsim.reproduce.paper1.study import FILTERS, ROWS
from auvsim.reproduce.paper1.yardsticks import batch_and_filter
from estimators.core import batch, ekf
from estimators.core.consistency import interval, nees
from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.history import History
from estimators.core.smoothing import smooth
from estimators.core.types import Gaussian, Measurement, MeasurementModel, ProcessModel
from estimators.docking.estimator import (
    REFERENCE_NOISE,
    AugmentedFilter,
    DockingEstimator,
    InteractingFilter,
    PaperFilter,
)
from estimators.planar.model import PRESTERO

A, Q, R, H = np.array([[1.0, 0.5], [0.0, 0.9]]), np.array([[0.02, 0.01], [0.01, 0.05]]), 0.3, np.array([[1.0, 0.0]])
P0 = np.diag([1.0, 0.5])


class Linear(ProcessModel):
    def evaluate(self, x, u, dt):
        return A @ x

    def jacobian(self, x, u, dt):
        return A

    def covariance(self, x, u, dt):
        return Q


class First(MeasurementModel):
    """y = x_0."""

    def evaluate(self, x, measurement=None):
        return x[:1]

    def jacobian(self, x, measurement=None):
        return H

    def covariance(self, x, measurement):
        return measurement.covariance

    def residual(self, value, expected):
        return value - expected


class State:
    def __init__(self, belief):
        self.belief = belief


class Kalman:
    def start(self, nodes, index):
        return State(Gaussian(mean=np.zeros(2), covariance=P0))

    def predict(self, state, u, duration):
        return State(ekf.predict(state.belief, Linear(), u, duration))

    def correct(self, state, node_time, measurements):
        return State(ekf.correct(state.belief, measurements[0], First())[0])


def linear_problem(count=12):
    """Nodes of a linear filter, and the posterior of all states by dense algebra."""
    rng = np.random.default_rng(0)
    values = rng.standard_normal(count)
    history = History(Kalman(), step=0.5)
    for k, y in enumerate(values):
        seen = Measurement(kind="y", value=np.array([y]), covariance=np.array([[R]]), stamp=0.5 * k, received=0.5 * k)
        history.append(0.5 * k, (), [seen])
    history.replay()
    information, vector = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
    information[:2, :2] = np.linalg.inv(P0)
    W = np.linalg.inv(Q)
    for k in range(1, count):
        i, j = slice(2 * k - 2, 2 * k), slice(2 * k, 2 * k + 2)
        information[i, i] += A.T @ W @ A
        information[i, j] -= A.T @ W
        information[j, i] -= W @ A
        information[j, j] += W + H.T @ H / R
        vector[j] += H[0] * values[k] / R
    covariance = np.linalg.inv(information)
    return history.nodes, (covariance @ vector).reshape(-1, 2), covariance


def test_smoothed_beliefs_are_the_marginals_of_all_states():
    nodes, means, covariance = linear_problem()
    smoothed = smooth(nodes, lambda state: Linear(), angles=())
    for k, belief in enumerate(smoothed):
        block = slice(2 * k, 2 * k + 2)
        assert belief.mean == pytest.approx(means[k], abs=1e-10)  # rounding
        assert belief.covariance == pytest.approx(covariance[block, block], abs=1e-10)


def test_batch_estimate_of_a_linear_problem_is_dense_least_squares():
    nodes, means, _ = linear_problem()
    prior = Gaussian(mean=np.zeros(2), covariance=P0)
    found = batch.solve(nodes, prior, Linear(), {"y": First()}, np.ones_like(means), angles=())
    assert found.means == pytest.approx(means, abs=1e-10)
    assert found.iterations == 2  # the first step is exact, the second shows it
    with pytest.raises(NotFiniteError, match="not converged after 1"):
        batch.solve(nodes, prior, Linear(), {"y": First()}, np.ones_like(means), angles=(), iterations=1)


@pytest.mark.parametrize("docking_filter", [AugmentedFilter(PRESTERO, REFERENCE_NOISE), InteractingFilter(PRESTERO)])
def test_poses_of_fifteen_seconds_ago_are_better_known_now(docking_filter):
    filtered, smoothed, normalised = [], [], []
    for seed in range(6):
        run = simulate(Conditions(duration=250.0), 40 + seed)
        estimator = DockingEstimator(docking_filter, run.usbl)
        delivered = []
        for k, estimate in enumerate(follow(run, estimator)):
            delivered.append(estimate)
            if k >= 230 and k % 10 == 0:
                then = k - 30  # 15 s ago
                belief = dict(estimator.smoothed())[run.times[then]]
                filtered.append(np.sum((delivered[then].mean[:8] - run.states[then])[:2] ** 2))
                smoothed.append(np.sum((belief.mean[:8] - run.states[then])[:2] ** 2))
                normalised.append(nees(belief.mean[:2], belief.covariance[:2, :2], run.states[then, :2]))
    assert len(smoothed) > 150
    # The fix to come bounds the error on the other side; 0.5 to 0.6 of the error seen, some 60 independent values.
    assert math.sqrt(np.mean(smoothed) / np.mean(filtered)) < 0.75
    # At most every other value is independent. The interacting filter allows for a turn of the current that does not
    # come: its covariance is up to twice too large.
    low, high = interval(2, samples=len(normalised) // 2, probability=0.999)
    assert (0.5 * low if isinstance(docking_filter, InteractingFilter) else low) < np.mean(normalised) < high


def test_the_newest_pose_is_the_filters():
    run = simulate(Conditions(duration=60.0), 9)
    estimator = DockingEstimator(AugmentedFilter(PRESTERO), run.usbl)
    *_, estimate = follow(run, estimator)
    smoothed = estimator.smoothed()
    assert smoothed[-1][0] == 60.0
    assert (smoothed[-1][1].mean[:8] == estimate.mean).all()
    assert [time for time, _ in smoothed] == sorted(time for time, _ in smoothed)
    assert DockingEstimator(AugmentedFilter(PRESTERO)).smoothed() == []


def test_the_papers_filter_cannot_be_smoothed():
    run, estimator = simulate(Conditions(duration=20.0), 1), DockingEstimator(PaperFilter(PRESTERO))
    list(follow(run, estimator))
    with pytest.raises(ParameterError, match="cannot be smoothed"):
        estimator.smoothed()


def causal_ratios(seeds, times):
    """Errors of the batch estimate of all that had arrived, and of the UKF, by those of the EKF."""
    row = replace(ROWS["settled_40"], conditions=Conditions(duration=times[-1]))
    squares = np.array([batch_and_filter(row, seed, times) for seed in seeds]).mean(axis=0)
    unscented = []
    for seed in seeds:
        run = simulate(row.conditions, seed)
        unscented += track(run, FILTERS["unscented"].make()).errors(run)[np.isin(run.times, times)].tolist()
    return {
        "map": math.sqrt(squares[0] / squares[1]),
        "ukf": math.sqrt(np.mean(np.square(unscented)) / squares[1]),
    }


def test_neither_sigma_points_nor_batches_beat_the_extended_filter():
    """Short form: the three agree to a per cent in every run, so that few runs tell."""
    ratios = causal_ratios(range(60, 62), np.arange(100.0, 161.0, 7.5).tolist())
    assert 0.98 < ratios["ukf"] < 1.02  # the study's own bounds
    assert 0.98 < ratios["map"] < 1.02
    assert 1.0 not in ratios.values()  # the agreement is one of results, not of code


@pytest.mark.slow
def test_neither_sigma_points_nor_batches_beat_the_extended_filter_in_the_long_run():
    ratios = causal_ratios(range(60, 80), np.arange(100.0, 401.0, 10.0).tolist())
    assert 0.98 < ratios["ukf"] < 1.02
    assert 0.98 < ratios["map"] < 1.02
