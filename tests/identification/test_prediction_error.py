"""Prediction error: likelihood against a filter written anew, derivatives, and fits under noise of the process."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim.base.errors import InputError
from auvsim.identification import compiled
from auvsim.identification.fit import DEFAULT_FREE, with_values
from auvsim.identification.prediction_error import Likelihood, PredictionErrorOptions, fit_prediction_error
from auvsim.identification.segments import SegmentOptions, fit_segments
from auvsim.identification.simulated import SHEETS, Vessel, simulate
from auvsim.identification.states import first_belief, smoothed
from estimators.planar.model import PRESTERO, PlanarProcess

PARAMETERS = replace(PRESTERO, X_prop=0.0, X_nn=4e-3, X_nu=-0.15, X_uu=-6.0)
DENSITIES = (0.0, 0.0, 0.0, 1e-4, 1e-4, 1e-5)
FREE = ("X_uu", "Y_uv", "N_ur", "N_dd")
OPTIONS = PredictionErrorOptions(nuisances=SHEETS)
TRUTH = np.array([getattr(PARAMETERS, name) for name in FREE])


def noisy(seed, duration=60.0, kind="multisine"):
    return simulate(Vessel(parameters=PARAMETERS, densities=DENSITIES), kind, seed, duration)


def shown(x):
    """What the channels show (8,) of a filter's state (12,)."""
    turn = (1.0 + x[11]) * np.exp(-1j * x[10])
    water = (x[3] + 1j * x[4]) * turn
    ground = (x[3] + 1j * x[4] + (x[6] + 1j * x[7]) * np.exp(-1j * x[2])) * turn
    return np.array([x[0], x[1], x[2] + x[9], water.real, water.imag, x[5] + x[8], ground.real, ground.imag])


def test_likelihood_equals_that_of_a_filter_written_anew():
    """One scalar after the other, derivatives by differences of what channels show, covariances in Joseph's form."""
    run = noisy(1, 10.0)
    q = np.concatenate([DENSITIES, np.zeros(6)])
    x, P = first_belief(run.record, PARAMETERS, SHEETS.vector())
    process, cost = PlanarProcess(PARAMETERS, q[:8]), 0.0
    variances = run.record.deviations**2
    e, s = np.empty((100, 8)), np.empty((100, 8))
    found = compiled.filters().track(
        x.copy(), P.copy(), run.record.inputs, run.record.measured, variances, PARAMETERS.vector(), q, 0.1, 1, e, s
    )
    for given, measured in zip(run.record.inputs, run.record.measured, strict=True):
        for c in np.flatnonzero(np.isfinite(measured)):
            H = np.array([(shown(x + d)[c] - shown(x - d)[c]) / 2e-5 for d in 1e-5 * np.eye(12)])
            innovation = measured[c] - shown(x)[c]
            innovation = np.angle(np.exp(1j * innovation)) if c == 2 else innovation
            variance = H @ P @ H + variances[c]
            cost += 0.5 * (innovation**2 / variance + math.log(variance))
            K = P @ H / variance
            x, left = x + K * innovation, np.eye(12) - np.outer(K, H)
            P = left @ P @ left.T + variances[c] * np.outer(K, K)
        F = np.eye(12)
        F[:8, :8] = process.jacobian(x[:8], given, 0.1)
        x = np.concatenate([process.evaluate(x[:8], given, 0.1), x[8:]])
        P = F @ P @ F.T + 0.05 * (F @ np.diag(q) @ F.T + np.diag(q))
    # Central differences of 1e-5 are right to 1e-10 of what they differentiate; innovations are of order 1.
    assert found == pytest.approx(cost, abs=1e-5)
    assert np.isfinite(e).sum() == np.isfinite(run.record.measured).sum()


@pytest.mark.parametrize("channel", range(8))
def test_what_a_channel_shows_and_its_derivatives(channel):
    """Derivatives against central differences of `shown`, at states with drift, current and constant errors."""
    generator, H = np.random.default_rng(channel), np.empty(12)
    for _ in range(20):
        x = generator.normal(0.0, [50, 50, 2, 1, 0.3, 0.2, 0.4, 0.4, 0.01, 0.05, 0.05, 0.02])
        assert compiled.filters().row_of(x, channel, H) == pytest.approx(shown(x)[channel], abs=1e-12)
        differences = [(shown(x + d)[channel] - shown(x - d)[channel]) / 2e-6 for d in 1e-6 * np.eye(12)]
        np.testing.assert_allclose(H, differences, atol=1e-7)  # rounding of 100 m in a step of 1e-6


def test_gradient_equals_differences_of_the_likelihood():
    run = noisy(2)
    likelihood = Likelihood([run.record], PARAMETERS, FREE, OPTIONS)
    unknowns = np.concatenate([TRUTH * 1.02, np.log([2e-4, 5e-5, 1e-5])])
    H, g = likelihood.information(likelihood.at(unknowns))
    for j, size in enumerate(1.0 / np.sqrt(np.diag(H))):
        step = np.zeros(len(unknowns))
        step[j] = 1e-2 * size
        slope = (likelihood.at(unknowns + step).cost - likelihood.at(unknowns - step).cost) / (2.0 * step[j])
        # In units of a deviation: central differences of a hundredth of it are wrong by its square.
        assert size * slope == pytest.approx(size * g[j], abs=1e-3 * max(1.0, abs(size * g[j])))


def test_gradient_has_the_fishers_covariance():
    """At the truth the gradient is zero in the mean and its covariance is the information; 16 records."""
    squares, means = [], []
    for seed in range(300, 316):
        likelihood = Likelihood([noisy(seed, 40.0).record], PARAMETERS, FREE, OPTIONS)
        H, g = likelihood.information(likelihood.at(np.concatenate([TRUTH, np.log(DENSITIES[3:])])))
        scaled = np.linalg.solve(np.linalg.cholesky(H), g)
        squares.append(scaled @ scaled)
        means.append(scaled)
    # Chi-square of 7 degrees of freedom in the mean of 16: 1 +- 0.13; four deviations.
    assert np.mean(squares) / 7.0 == pytest.approx(1.0, abs=0.53)
    assert np.abs(np.mean(means, axis=0)).max() < 1.0  # each 0 +- 0.25


def test_polish_bears_noise_that_misleads_output_errors():
    """Whole-record output error takes drift for dynamics: far outside its own intervals; the polish is not."""
    run = noisy(3, 150.0)
    whole = SegmentOptions(nuisances=SHEETS, length=math.inf)
    output = fit_segments([run.record], PARAMETERS, FREE, whole)
    rough = fit_segments([run.record], PARAMETERS, FREE, SegmentOptions(nuisances=SHEETS))
    polished = fit_prediction_error([run.record], rough.parameters, FREE, OPTIONS)
    assert polished.converged
    scores = np.abs((polished.values - TRUTH) / polished.deviations)
    assert scores.max() < 3.5  # four normal deviates; beyond in one of 500 seeds
    assert np.abs((output.values - TRUTH) / output.deviations).max() > 10.0
    assert polished.noise is not None
    assert polished.noise_deviations is not None
    logs = np.log(polished.noise[3:] / np.array(DENSITIES[3:])) / polished.noise_deviations[3:]
    assert np.abs(logs).max() < 3.5
    assert polished.residual_rms[2:] == pytest.approx(1.0, abs=0.12)  # 750 readings of each and more: 0.026
    white = [test.probability for test in polished.whiteness if test is not None]
    assert len(white) == 8
    assert min(white) > 1e-4
    assert max(test.statistic for test in output.whiteness if test is not None) > 100.0


def test_a_wrong_start_comes_to_the_same_optimum():
    """All that is free by default, off by up to a half, with noise of the process: least squares may mislead there."""
    run = noisy(8, 100.0)
    truth = np.array([getattr(PARAMETERS, name) for name in DEFAULT_FREE])
    start = with_values(PARAMETERS, DEFAULT_FREE, truth * np.random.default_rng(8).uniform(0.5, 1.5, len(truth)))
    right, other = (fit_prediction_error([run.record], p, DEFAULT_FREE, OPTIONS) for p in (PARAMETERS, start))
    assert right.converged
    assert other.converged
    # Both stop where a step would change the log likelihood by 1e-4, 0.014 deviations.
    assert np.abs(other.values - right.values) / right.deviations == pytest.approx(0.0, abs=0.05)


def test_without_noise_the_polish_agrees_with_segments():
    run = simulate(Vessel(parameters=PARAMETERS), "multisine", 4, 100.0)
    rough = fit_segments([run.record], PARAMETERS, FREE, SegmentOptions(nuisances=SHEETS, length=math.inf))
    polished = fit_prediction_error([run.record], rough.parameters, FREE, OPTIONS)
    assert polished.converged
    # Midpoint against Runge and Kutta, 0.07 % where intervals are 0.15 %; densities that cannot be below zero.
    assert np.abs((polished.values - rough.values) / polished.deviations).max() < 1.0
    assert polished.noise is not None
    assert (polished.noise[3:5] < 1e-6).all()  # 1e-4 in the other tests


def test_signs_and_prior():
    run = noisy(5)
    start = with_values(PARAMETERS, ("X_nu",), [0.0])
    fit = fit_prediction_error([run.record], start, ("X_uu", "X_nu"), replace(OPTIONS, signs=True))
    assert fit.parameters.X_nu <= 0.0
    held = fit_prediction_error([run.record], PARAMETERS, ("X_uu",), replace(OPTIONS, prior=1e-4))
    assert held.parameters.X_uu == pytest.approx(PARAMETERS.X_uu, rel=5e-4)


def test_smoother_follows_the_truth():
    run = noisy(6, 100.0)
    way = smoothed(run.record, PARAMETERS, SHEETS.vector())
    errors = np.sqrt(np.mean((way[:, 2:6] - run.states[:, 2:6]) ** 2, axis=0))
    # Heading within the compass's bias; velocities within a log's reading, the yaw rate within a few of the gyro's.
    assert (errors < [0.03, 0.02, 0.02, 0.005]).all()


def test_smoother_is_that_of_each_sample_whatever_its_substeps():
    """Gains of Rauch, Tung and Striebel from the derivative of a whole sample of three substeps, by differences."""
    run, parts, count = noisy(9, 4.0), 3, 12
    q = np.concatenate([DENSITIES, np.zeros(6)])
    x, P = first_belief(run.record, PARAMETERS, SHEETS.vector())
    loops, process = compiled.filters(), PlanarProcess(PARAMETERS, q[:8])
    step = 0.48  # of a sample [s]: long enough for the order of the substeps to matter
    inputs, measured = run.record.inputs[:count], run.record.measured[:count]
    means, covariances = loops.trace(
        x, P, inputs, measured, run.record.deviations**2, PARAMETERS.vector(), q, step, parts
    )
    found = loops.smooth(means, covariances, inputs, PARAMETERS.vector(), q, step, parts)

    def carried(state, given):
        for _ in range(parts):
            state = np.concatenate([process.evaluate(state[:8], given, step / parts), state[8:]])
        return state

    expected = means.copy()
    for n in range(count - 2, -1, -1):
        state, P = means[n].copy(), covariances[n].copy()
        for _ in range(parts):
            F = np.eye(12)
            F[:8, :8] = process.jacobian(state[:8], inputs[n], step / parts)
            P = F @ P @ F.T + 0.5 * step / parts * (F @ np.diag(q) @ F.T + np.diag(q))
            state = np.concatenate([process.evaluate(state[:8], inputs[n], step / parts), state[8:]])
        columns = [
            (carried(means[n] + d, inputs[n]) - carried(means[n] - d, inputs[n])) / 2e-6 for d in 1e-6 * np.eye(12)
        ]
        total = np.array(columns).T
        gain = covariances[n] @ total.T @ np.linalg.inv(P + 1e-12 * np.eye(12))
        expected[n] = means[n] + gain @ (expected[n + 1] - state)
    assert found == pytest.approx(expected, abs=1e-5)


def test_bad_input_is_refused():
    run = noisy(7, 20.0)
    with pytest.raises(InputError, match="no noise of the process 'roll'"):
        fit_prediction_error([run.record], PARAMETERS, FREE, replace(OPTIONS, noise=("roll",)))
    with pytest.raises(InputError, match="densities"):
        fit_prediction_error([run.record], PARAMETERS, FREE, replace(OPTIONS, densities=(1.0,)))
