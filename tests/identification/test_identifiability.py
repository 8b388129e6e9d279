"""What data can tell: combinations, ties, likelihood intervals; against closed forms and known blindness."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from auvsim.base.errors import InputError
from auvsim.identification.fit import Fit, invert
from auvsim.identification.identifiability import assess, likelihood_interval
from auvsim.identification.least_squares import fit_least_squares
from auvsim.identification.prediction_error import PredictionErrorOptions, fit_prediction_error
from auvsim.identification.segments import SegmentOptions, fit_segments
from auvsim.identification.simulated import SHEETS, Vessel, simulate
from estimators.planar.model import PRESTERO

PARAMETERS = replace(PRESTERO, X_prop=0.0, X_nn=4e-3, X_nu=-0.15, X_uu=-6.0)
VESSEL = Vessel(parameters=PARAMETERS)


def made_up(covariance, free=("Y_uv", "N_ur", "N_dd")):
    """A fit of which only the covariance matters."""
    return Fit(
        method="segments", start=PARAMETERS, parameters=PARAMETERS, free=free, covariance=np.array(covariance),
        nuisances=np.zeros((1, 6)), nuisance_deviations=np.zeros((1, 6)), residual_rms=np.ones(8),
        whiteness=(None,) * 8, cost=1.0, start_cost=2.0, samples=10, iterations=1, converged=True, message="",
    )  # fmt: skip


def test_combinations_are_the_axes_of_the_relative_covariance():
    size = np.abs([PARAMETERS.Y_uv, PARAMETERS.N_ur, PARAMETERS.N_dd])
    axes = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, math.sqrt(2.0)]]) / math.sqrt(2.0)
    relative = axes.T @ np.diag([2.0**2, 0.01**2, 0.1**2]) @ axes
    found = assess(made_up(relative * np.outer(size, size)))
    assert [c.deviation for c in found.combinations] == pytest.approx([0.01, 0.1, 2.0])
    assert found.combinations[2].text in ("0.71 Y_uv + 0.71 N_ur", "0.71 N_ur + 0.71 Y_uv")
    assert " - " in found.combinations[0].text
    assert found.names[0] == "N_dd"
    assert sorted(found.weak) == ["N_ur", "Y_uv"]
    assert [c.deviation for c in found.blind] == pytest.approx([2.0])
    assert not found.identifiable
    assert found.tied[0][:2] == ("Y_uv", "N_ur")
    assert found.tied[0][2] == pytest.approx(1.0, abs=1e-4)


def test_unseen_parameters_come_last():
    found = assess(made_up([[1e-4, 0.0, 0.0], [0.0, np.inf, 0.0], [0.0, 0.0, 1e-6]]))
    assert found.names == ("N_dd", "Y_uv", "N_ur")
    assert math.isinf(found.combinations[-1].deviation)
    assert found.combinations[-1].text == "1.00 N_ur"
    assert found.weak == ("N_ur",)


def test_inverse_of_information():
    root, size = np.random.default_rng(0).standard_normal((4, 4)), np.array([1e-6, 1.0, 1e3, 1e6])
    information = (root * size).T @ (root * size)
    assert invert(information) * np.outer(size, size) == pytest.approx(np.linalg.inv(root.T @ root), rel=1e-9)
    information[:, 2] = information[2] = 0.0
    covariance = invert(information)
    assert math.isinf(covariance[2, 2])
    assert np.isfinite(covariance[np.ix_([0, 1, 3], [0, 1, 3])]).all()


def test_thrust_and_drag_at_one_speed_are_named():
    """Straight ahead at one speed only the sum of X_uu u^2 + X_nn n^2 + X_nu n u is seen: two of three are blind."""
    run = simulate(VESSEL, "turns", 1, 60.0)
    straight = replace(VESSEL, rudder=0.0)
    run = simulate(straight, "turns", 1, 60.0)
    fit = fit_segments([run.record], PARAMETERS, ("X_uu", "X_nn", "X_nu"), SegmentOptions(nuisances=SHEETS))
    found = assess(fit)
    assert not found.identifiable
    assert len(found.blind) >= 1
    steps = simulate(VESSEL, "multisine", 1, 200.0)
    told = assess(fit_segments([steps.record], PARAMETERS, ("X_uu", "X_nn", "X_nu"), SegmentOptions(nuisances=SHEETS)))
    assert told.identifiable


@pytest.mark.parametrize("method", ["segments", "prediction error"])
def test_likelihood_interval_of_a_well_known_parameter_is_its_deviations(method):
    run = simulate(replace(VESSEL, densities=(0.0, 0.0, 0.0, 1e-5, 1e-5, 1e-6)), "zigzag", 2, 60.0)
    free = ("X_uu", "N_dd")
    if method == "segments":
        options = SegmentOptions(nuisances=SHEETS)
        fit = fit_segments([run.record], PARAMETERS, free, options)
    else:
        options = PredictionErrorOptions(nuisances=SHEETS)
        fit = fit_prediction_error([run.record], PARAMETERS, free, options)
    low, high = likelihood_interval([run.record], fit, "N_dd", options)
    half = math.sqrt(chi2.ppf(0.95, 1)) * fit.deviations[1]
    # Nearly quadratic: the ends to some per cent of the width (the search stops within one).
    assert (low, high) == pytest.approx((fit.values[1] - half, fit.values[1] + half), abs=0.06 * half)


def test_likelihood_interval_of_an_unseen_parameter_is_open():
    run = simulate(replace(VESSEL, rudder=0.0), "turns", 3, 20.0)
    fit = fit_segments([run.record], PARAMETERS, ("X_dd", "X_uu"))
    assert likelihood_interval([run.record], fit, "X_dd") == (-math.inf, math.inf)
    with pytest.raises(InputError, match="no free parameter of the fit 'N_dd'; there are X_dd, X_uu"):
        likelihood_interval([run.record], fit, "N_dd")
    start = fit_least_squares([run.record], PARAMETERS, ("X_uu",))
    with pytest.raises(InputError, match="least squares"):
        likelihood_interval([run.record], start, "X_uu")
