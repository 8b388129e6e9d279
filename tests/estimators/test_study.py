"""The study of paper 1: each row's acceptance, in short forms that always run and whole ones that are slow."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvsim.reproduce.paper1.runs import Conditions, follow, in_order, simulate, track
from auvsim.reproduce.paper1.study import FILTERS, ROWS, evaluate, score, summarise
from auvsim.reproduce.paper1.yardsticks import bound
from estimators.core.consistency import assess, interval, ljung_box, nees, nis, whiten
from estimators.docking.estimator import REFERENCE_NOISE, AugmentedFilter, DockingEstimator
from estimators.planar.model import PRESTERO

# Ratios of rms to the paper's filter: limits by row, from the study's acceptance column; for the filter with biases, at
# least as good as the paper's everywhere and a tenth better but on the tightest circle. The measured values lie at
# least three of their deviations (100 runs) below; short forms have ten runs and three times the deviation.
ACCEPTED = {
    "settled_200": {"augmented_constant": 0.80, "imm": 0.92, "imm_biases": 0.90},
    "settled_100": {"augmented_constant": 0.82, "imm": 0.92, "imm_biases": 0.90},
    "settled_40": {"augmented_constant": 0.90, "imm": 0.93, "imm_biases": 0.90},
    "settled_12": {"augmented_constant": 1.00, "imm": 1.03, "imm_biases": 1.00},
    "start": {"imm": 0.65, "imm_biases": 0.65},
    "turn_40": {"imm": 0.75, "imm_biases": 0.75},
    "turn_100": {"imm": 0.55, "imm_biases": 0.55},
    "after_turn": {"imm": 1.03, "imm_biases": 1.03},
    "dropped": {"imm": 0.65, "imm_biases": 0.65},
    "late": {"imm": 0.92, "imm_biases": 0.92},
    "jitter": {"imm": 0.92, "imm_biases": 0.92},
    "outliers": {"imm": 0.10, "imm_biases": 0.10},
    "small_outliers": {"imm": 0.80, "imm_biases": 0.80},
    "thrust": {"imm": 1.30, "imm_biases": 0.90},
    "compass": {"imm": 1.30, "imm_biases": 0.90},
}
PAPER_MEANS = {"settled_200": 0.3530, "settled_100": 0.2850, "settled_40": 0.1011, "settled_12": 0.0603}  # Table 1 [m]


def results(name, row, seeds, filters):
    scores = [evaluate(row, seed, ["paper", *filters]) for seed in seeds]
    reference = [found["paper"] for found in scores]
    return {label: summarise([found[label] for found in scores], reference) for label in ("paper", *filters)}


def check(name, row, seeds):
    found = results(name, row, seeds, list(ACCEPTED[name]))
    for label, limit in ACCEPTED[name].items():
        assert found[label].ratio <= limit, f"{label} in {name}: {found[label]}"
    if name == "outliers":
        for label in ACCEPTED[name]:
            assert found[label].rms <= 0.2
            assert found[label].worst_rms <= 5.0
    if name == "turn_40":
        assert found["paper"].rms <= 1.6
        assert found["paper"].peak <= 4.5
    return found


def test_every_row_has_its_limits():
    assert set(ACCEPTED) == set(ROWS)


@pytest.mark.parametrize("name", [name for name in ROWS if not name.startswith("settled")])
def test_short_form_of_a_row(name):
    check(name, ROWS[name], range(3000, 3010))


@pytest.mark.parametrize("name", PAPER_MEANS)
def test_short_form_of_a_settled_row(name):
    row = ROWS[name]
    short = replace(row, conditions=replace(row.conditions, duration=1000.0), window=(100.0, 1000.0))
    found = check(name, short, range(3100, 3102))
    # The study's bounds, 15 % for 24 000 s, opened by the 5 % that some 90 independent errors leave.
    assert 0.8 < found["paper"].mean / PAPER_MEANS[name] < 1.2


def test_both_ingredients_of_the_papers_filter_are_needed():
    row = ROWS["settled_40"]
    short = replace(row, conditions=replace(row.conditions, duration=600.0), window=(100.0, 600.0))
    found = results("", short, [3200], ["regular", "regular_best", "delay_only", "current_only"])
    # Measured over 24 000 s 24.1, 20.7, 17.2 and 13.8; the limits are the study's for any distance.
    assert found["regular"].ratio >= 5.0
    assert found["regular_best"].ratio >= 5.0
    assert found["delay_only"].ratio >= 4.0
    assert found["current_only"].ratio >= 3.0


def bound_ratio(name, seeds, duration):
    row = ROWS[name]
    row = replace(row, conditions=replace(row.conditions, duration=duration), window=(100.0, duration))
    squares = [evaluate(row, seed, ["augmented_constant"])["augmented_constant"].mean_square for seed in seeds]
    return math.sqrt(np.mean(squares) / np.mean([bound(row, seed) for seed in seeds]))


def test_augmented_filter_reaches_the_bound():
    """Short form: six runs of 500 s at 40 m hold some 120 independent errors in two directions, a deviation of 4 %."""
    assert 0.88 < bound_ratio("settled_40", range(3300, 3306), 600.0) < 1.12


@pytest.mark.slow
@pytest.mark.parametrize("name", PAPER_MEANS)
def test_augmented_filter_reaches_the_bound_at_every_distance(name):
    # At 200 m the errors' correlation time is 100 s and more: 24 000 s leave a deviation of 4 %.
    assert 0.93 < bound_ratio(name, range(3400, 3404), 6000.0) < 1.08


@pytest.mark.slow
@pytest.mark.parametrize("name", ROWS)
def test_whole_row(name):
    row = ROWS[name]
    found = check(name, row, range(4000, 4000 + row.runs))
    if name in PAPER_MEANS:
        assert 0.85 < found["paper"].mean / PAPER_MEANS[name] < 1.15


def test_errors_and_innovations_of_the_augmented_filter_are_consistent():
    """On the truth that it believes in: NEES of all states and of the position, NIS, and whiteness."""
    states, positions, innovations, whites = [], [], [], []
    for seed in range(3500, 3516):
        run = in_order(simulate(Conditions(duration=300.0), seed))
        estimator = DockingEstimator(AugmentedFilter(PRESTERO, REFERENCE_NOISE, gate=None), run.usbl)
        row, residuals, last = [], [], None
        for k, estimate in enumerate(follow(run, estimator)):
            if estimate.innovation is not None and estimate.innovation is not last:
                last = estimate.innovation
                residuals.append((last.residual, last.covariance))
            if estimate.initialised and k % 20 == 0 and k >= 200:
                row.append((estimate.mean, estimate.covariance, run.states[k]))
        means, covariances, truths = (np.array(part) for part in zip(*row, strict=True))
        states.append(nees(means, covariances, truths, angles=(2,)))
        positions.append(nees(means[:, :2], covariances[:, :2, :2], truths[:, :2]))
        r, S = (np.array(part) for part in zip(*residuals, strict=True))
        innovations.append(nis(r, S))
        whites.append(whiten(r, S))
    for values, dof in ((states, 8), (positions, 2)):
        found = assess(np.array(values), dof, probability=0.999)
        assert found.holds, found
        assert 0.85 < found.mean < 1.15  # the study's own bounds
    pooled = np.concatenate(innovations)
    low, high = interval(2, samples=pooled.size, probability=0.999)  # white, so all independent
    assert low < pooled.mean() < high
    probabilities = [ljung_box(white, lags=10).probability for white in whites]
    # Uniform if white: the mean of 16 has a deviation of 0.072; three of them.
    assert np.mean(probabilities) > 0.5 - 0.22
    # And they tell a filter that is wrong about its noise.
    wrong = AugmentedFilter(PRESTERO, replace(REFERENCE_NOISE, position=4e-5, surge=1e-6, sway=1e-6), gate=None)
    run = simulate(Conditions(duration=300.0), 3500)
    assert score(ROWS["jitter"], run, track(run, wrong)).nees > 1.5


def test_pairs_share_all_draws_but_those_of_their_difference():
    plain, biased = (simulate(Conditions(duration=50.0, compass_bias=b), 5) for b in (0.0, 0.1))
    assert (plain.states == biased.states).all()
    assert plain.fixes == biased.fixes
    assert biased.compass - plain.compass == pytest.approx(0.1)
    spoilt = simulate(Conditions(duration=50.0, outliers=0.5, late=0.5, dropped=0.3), 5)
    by_number = {fix.sequence: fix for fix in plain.fixes}
    assert len(spoilt.fixes) < len(plain.fixes)
    assert all(fix.stamp == by_number[fix.sequence].stamp for fix in spoilt.fixes)
    assert any(fix.position != by_number[fix.sequence].position for fix in spoilt.fixes)


def test_an_orbit_stays_about_the_dock_and_a_fixed_rudder_drifts_away():
    held, drifting = (simulate(Conditions(duration=600.0, orbit=orbit), 6) for orbit in (True, False))
    distance = np.linalg.norm(held.states[200:, :2], axis=1)
    assert np.abs(distance - 40.0).max() < 10.0  # speeds over ground from 0.3 to 1.3 m/s
    assert np.linalg.norm(drifting.states[-1, :2]) > 200.0  # 0.5 m/s for 600 s
    assert np.sqrt(np.mean(track(held, FILTERS["paper"].make()).errors(held)[200:] ** 2)) < 0.2
