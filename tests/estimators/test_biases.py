"""Errors of vehicle, clock and dock as further states: derivatives, first beliefs, and what is found."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim.reproduce.paper1.runs import Conditions, simulate, track
from estimators.core.errors import ParameterError
from estimators.core.history import Node
from estimators.core.types import Measurement
from estimators.docking.estimator import REFERENCE_NOISE, AugmentedFilter, Bias, DockingEstimator, DockingNoise
from estimators.docking.models import PlanarModels
from estimators.docking.sensors import COMPASS, USBL, HeadingModel, PositionModel
from estimators.planar.model import BIASES, PRESTERO, PlanarProcess, step_function

ALL = {"surge": Bias(3e-3), "compass": Bias(0.02), "dock_heading": Bias(0.01), "clock": Bias(0.2)}
STATE = np.array([30.0, -17.0, 0.4, 0.9, -0.06, 0.05, 0.2, -0.3, -0.01, 0.03, 0.05, 0.3])
INPUT = (0.08, 60.0)


def differences(function, x, h=1e-5):
    return np.array([(function(x + h * e) - function(x - h * e)) / (2 * h) for e in np.eye(x.size)]).T


@pytest.mark.parametrize("integrator", ["euler", "midpoint"])
def test_process_jacobian_equals_finite_differences(integrator):
    process = PlanarProcess(PRESTERO, np.zeros(12), integrator=integrator, biases=BIASES)
    F = process.jacobian(STATE, INPUT, 0.5)
    # Central differences: truncation h^2 = 1e-10, rounding 1e-16 / h times states of order 30.
    assert pytest.approx(differences(lambda x: process.evaluate(x, INPUT, 0.5), STATE), abs=1e-6) == F
    assert F[3, 8] == pytest.approx(0.5, rel=0.1)  # an acceleration, over half a second


@pytest.mark.parametrize(
    "model",
    [
        HeadingModel(12, 9),
        PositionModel((0.6, -0.2), 12, dock_heading=10, clock=11),
        PositionModel((0.6, -0.2), 12, clock=11),
        PositionModel((0.6, -0.2), 12, dock_heading=10),
        PositionModel(n=12),
    ],
)
def test_measurement_jacobians_equal_finite_differences(model):
    assert pytest.approx(differences(model.evaluate, STATE), abs=1e-6) == model.jacobian(STATE)  # as above


def test_sensors_show_the_biases():
    assert HeadingModel(12, 9).evaluate(STATE) == pytest.approx([0.43])
    position = PositionModel(n=12, dock_heading=10, clock=11).evaluate(STATE)
    c, s = math.cos(0.4), math.sin(0.4)
    ground = np.array([c * 0.9 + s * 0.06 + 0.2, s * 0.9 - c * 0.06 - 0.3])
    later = STATE[:2] + 0.3 * ground
    turned = math.atan2(later[1], later[0]) + 0.05
    assert position == pytest.approx(np.linalg.norm(later) * np.array([math.cos(turned), math.sin(turned)]))


def test_first_belief_has_the_covariance_of_its_errors():
    """Sampled: truths drawn about a state, measurements of each, and the first belief that they give."""
    noise = DockingNoise(biases=ALL, compass=0.02)
    models = PlanarModels(PRESTERO, noise, transponder=(0.8, 0.1), initial_surge=0.9)
    rng = np.random.default_rng(1)
    deviations = np.array([0.0, 0.0, 0.0, 0.1, 0.05, 0.05, *(2 * [noise.initial_current]), 3e-3, 0.02, 0.01, 0.2])
    place = np.array([30.0, -17.0, 0.4, 0.9, *np.zeros(8)])
    errors = []
    for _ in range(3000):
        truth = place + deviations * rng.standard_normal(12)
        heading = models.heading.evaluate(truth) + 0.02 * rng.standard_normal(1)
        fix = models.position.evaluate(truth) + 0.1 * rng.standard_normal(2)
        measurements = [
            Measurement(kind=kind, value=value, covariance=R, stamp=0.0, received=0.0)
            for kind, value, R in ((COMPASS, heading, np.eye(1)), (USBL, fix, 0.01 * np.eye(2)))
        ]
        first = models.first([Node(0.0, (0.0, 0.0), measurements, is_grid=True)], 0)
        assert first is not None
        errors.append((first[0].mean - truth, first[0].covariance))
    sampled, believed = np.cov(np.array([e for e, _ in errors]).T), np.mean([P for _, P in errors], axis=0)
    scale = np.sqrt(np.diagonal(believed))
    # Sampled correlations of 3000 have deviations up to 0.026 (diagonal), products of errors add some per cent more.
    assert sampled / np.outer(scale, scale) == pytest.approx(believed / np.outer(scale, scale), abs=0.1)
    assert believed[2, 9] == pytest.approx(-(0.02**2))  # a compass that shows too much gives too much heading


@pytest.mark.parametrize(
    ("name", "conditions", "truth"),
    [
        ("surge", {"thrust": 0.9}, -0.1037 / 31.41),  # a tenth of the thrust over the mass with its added mass
        ("compass", {"compass_bias": 0.035}, 0.035),
        ("clock", {"clock_offset": 0.3}, 0.3),
        ("dock_heading", {"dock_heading_bias": 0.035}, 0.035),
    ],
)
def test_a_bias_is_found_on_a_circle(name, conditions, truth):
    """In half an hour the circle turns round often enough to tell what turns with the vehicle from a current."""
    run = simulate(Conditions(duration=1800.0, **conditions), 11)
    noise = replace(REFERENCE_NOISE, biases={name: ALL[name]})
    estimator = DockingEstimator(AugmentedFilter(PRESTERO, noise), run.usbl)
    fixes = list(run.fixes)
    for time, heading, rudder in zip(run.times, run.compass, run.rudder, strict=True):
        arrived = [fix for fix in fixes if fix.received <= time]
        fixes = fixes[len(arrived) :]
        estimate = estimator.tick(time, heading, rudder, 0.0, arrived)
    belief = estimator.nodes[-1].state.belief
    deviation = math.sqrt(belief.covariance[8, 8])
    assert abs(belief.mean[8] - truth) < 4.0 * deviation  # missed once in 16 000 if the covariance is right
    assert deviation < 0.25 * abs(truth)  # and it is found, not only believed possible
    assert estimate.mean.tolist() == belief.mean.tolist()  # the bias is a state of the estimate, too
    assert estimate.covariance.shape == (9, 9)


def test_a_filter_that_is_told_of_its_biases_is_the_filter_without():
    """A bias whose deviation is next to nothing changes nothing."""
    run = simulate(Conditions(duration=100.0), 12)
    none = {name: Bias(1e-9) for name in BIASES}
    plain = track(run, AugmentedFilter(PRESTERO, REFERENCE_NOISE))
    biased = track(run, AugmentedFilter(PRESTERO, replace(REFERENCE_NOISE, biases=none)))
    assert biased.means == pytest.approx(plain.means, abs=1e-6, nan_ok=True)  # 1e-9 of time or angle, at 40 m


def test_wrong_biases_are_refused_by_name():
    with pytest.raises(ParameterError, match="no bias thrust; there are surge, compass, dock_heading, clock"):
        DockingNoise(biases={"thrust": Bias(1.0)})
    with pytest.raises(ParameterError, match="in that order"):
        step_function(biases=("compass", "surge"))
    with pytest.raises(ParameterError, match="must be 9 power spectral densities"):
        PlanarProcess(PRESTERO, np.zeros(8), biases=("surge",))
