"""Eq. 7, eq. 11, the docking filters' errors and consistency, delayed and shuffled packets, and what they refuse."""

import math
from dataclasses import replace

import numpy as np
import pytest
from docking_runs import COMPASS_SIGMA, Run, position_errors, simulate, track

from estimators.core.consistency import interval, nees
from estimators.core.errors import ParameterError
from estimators.docking.estimator import (
    REFERENCE_NOISE,
    AugmentedFilter,
    DockingEstimator,
    DockingNoise,
    PaperFilter,
    UsblFix,
    UsblModel,
    estimate_current,
    horizontal_rotation,
)
from estimators.planar.model import PRESTERO

FIX = UsblFix(stamp=1.0, received=3.0, position=(10.0, 0.0, 0.0), heading=0.0, sequence=5)


def filters():
    return [AugmentedFilter(PRESTERO), PaperFilter(PRESTERO)]


def test_dock_facing_east_sees_ahead_what_is_east():
    measurement = UsblModel().world_fix(replace(FIX, heading=math.pi / 2))
    assert measurement.value == pytest.approx([0.0, 10.0], abs=1e-12)  # the paper's x_D = 10 (east), y_D = 0 (north)
    assert (measurement.stamp, measurement.received, measurement.sequence) == (1.0, 3.0, 5)


def test_rotation_equals_the_product_of_elementary_ones():
    h, p, r = 0.7, -0.3, 0.2
    Rz = np.array([[math.cos(h), -math.sin(h), 0], [math.sin(h), math.cos(h), 0], [0, 0, 1]])
    Ry = np.array([[math.cos(p), 0, math.sin(p)], [0, 1, 0], [-math.sin(p), 0, math.cos(p)]])
    Rx = np.array([[1, 0, 0], [0, math.cos(r), -math.sin(r)], [0, math.sin(r), math.cos(r)]])
    assert horizontal_rotation(h, p, r) == pytest.approx((Rz @ Ry @ Rx)[:2], abs=1e-15)


@pytest.mark.parametrize(("distance", "sigma"), [(200, 0.4807), (100, 0.339), (40, 0.0678), (12, 0.0067)])
def test_deviation_table(distance, sigma):
    model = UsblModel()
    assert model.deviation(distance) == pytest.approx(sigma)
    assert model.deviation(5.0) == 0.0067
    assert model.deviation(500.0) == pytest.approx(0.4807)
    assert model.deviation(math.sqrt(40.0 * 100.0)) == pytest.approx(math.sqrt(0.0678 * 0.339))  # halfway on log axes


def test_covariance_of_a_fix():
    model = UsblModel(ranges=(1.0, 2.0), deviations=(0.1, 0.1), dock_heading=0.02)
    fix = replace(FIX, position=(30.0, 40.0, 0.0), heading=0.4)
    R = model.world_fix(fix).covariance
    along = horizontal_rotation(0.4, 0.0, 0.0) @ np.array([0.6, 0.8, 0.0])
    across = np.array([-along[1], along[0]])
    assert along @ R @ along == pytest.approx(0.1**2)
    assert across @ R @ across == pytest.approx(0.1**2 + (50.0 * 0.02) ** 2)
    assert along @ R @ across == pytest.approx(0.0, abs=1e-12)


def test_lever_arms():
    model = UsblModel(transceiver=(-1.0, 2.0, 0.5))
    transponder, heading, position = (0.8, 0.1), 0.6, np.array([-20.0, 7.0])
    c, s = math.cos(heading), math.sin(heading)
    on_hull = position + np.array([c * 0.8 - s * 0.1, s * 0.8 + c * 0.1])
    dock_heading = 1.1
    in_dock = np.linalg.inv(np.vstack((horizontal_rotation(dock_heading, 0, 0), [0, 0, 1]))) @ [*on_hull, 3.0]
    fix = UsblFix(stamp=0.0, received=0.0, position=in_dock - (-1.0, 2.0, 0.5), heading=dock_heading)
    for docking_filter in (
        AugmentedFilter(PRESTERO, transponder=transponder),
        PaperFilter(PRESTERO, transponder=transponder),
    ):
        estimate = DockingEstimator(docking_filter, model).tick(0.0, heading, 0.0, 0.0, [fix])
        assert estimate.mean[:2] == pytest.approx(position, abs=1e-9)
        assert np.linalg.eigvalsh(estimate.covariance)[0] >= -1e-15


def test_current_of_eq_11():
    history, weights, gain = ((0.1, -0.2), (0.3, 0.4)), np.array([0.3, 0.3, 0.4]), np.array([[0.5, 0.1], [0.0, 0.4]])
    expected = [
        0.3 * 0.1 + 0.3 * 0.3 + 0.4 * (0.3 + (0.5 * 2.0 + 0.1 * 1.0) / 5.0),
        0.3 * -0.2 + 0.3 * 0.4 + 0.4 * (0.4 + 0.4 * 1.0 / 5.0),
    ]
    assert estimate_current(history, weights, gain, np.array([2.0, 1.0]), 5.0) == pytest.approx(expected)
    with pytest.raises(ParameterError, match="of sum 1"):
        PaperFilter(PRESTERO, weights=(0.5, 0.6))


@pytest.mark.parametrize("docking_filter", filters(), ids=["augmented", "paper"])
def test_nothing_is_known_before_the_first_fix_and_after_a_reset(docking_filter):
    estimator = DockingEstimator(docking_filter)
    first = estimator.tick(0.0, 0.3, 0.1, 50.0)
    assert not first.initialised
    assert not first.mean.any()
    assert not first.covariance.any()
    known = estimator.tick(0.5, 0.3, 0.1, 50.0, [replace(FIX, stamp=0.2)])
    assert known.initialised
    assert np.isfinite(known.mean).all()
    estimator.tick(1.0, 0.3, 0.1, 50.0, [replace(FIX, stamp=9.0)])
    estimator.reset()
    again = estimator.tick(0.0, 0.3, 0.1, 50.0)
    assert not again.initialised
    assert sum(again.refused.values()) == 0


def test_start_is_at_the_stamp_of_the_first_fix():
    estimator = DockingEstimator(AugmentedFilter(PRESTERO, initial_surge=0.7))
    for k in range(9):
        estimate = estimator.tick(0.5 * k, 0.4 + 0.02 * k, 0.0, 0.0, [])
    fix = UsblFix(stamp=2.75, received=4.5, position=(-50.0, 20.0, 0.0), heading=0.0)
    estimate = estimator.tick(4.5, 0.4 + 0.02 * 9, 0.0, 0.0, [fix])
    node = next(n for n in estimator._history.nodes if n.time == 2.75)
    assert node.state is not None
    belief = node.state.belief
    assert belief.mean == pytest.approx([-50.0, 20.0, 0.4 + 0.02 * 5.5, 0.7, 0, 0, 0, 0])
    sigma = UsblModel().deviation(math.hypot(50.0, 20.0))
    deviations = [sigma, sigma, COMPASS_SIGMA, 0.1, 0.05, 0.05, 0.125**0.5, 0.125**0.5]
    assert np.sqrt(np.diag(belief.covariance)) == pytest.approx(deviations)
    # Replayed to now: 1.75 s at 0.7 m/s.
    assert np.linalg.norm(estimate.mean[:2] - [-50.0, 20.0]) == pytest.approx(1.75 * 0.7, rel=0.05)


@pytest.mark.parametrize("docking_filter", filters(), ids=["augmented", "paper"])
def test_delayed_and_shuffled_packets_end_in_the_state_of_prompt_ones(docking_filter):
    run = simulate(1, duration=100.0)
    prompt = [replace(fix, received=fix.stamp) for fix in run.fixes]
    rng = np.random.default_rng(2)
    # All arrive before the last tick; many pairs change places, some arrive twice.
    shuffled = [replace(fix, received=min(fix.stamp + rng.uniform(0.0, 25.0), 100.0)) for fix in run.fixes]
    shuffled += [replace(fix, received=min(fix.received + 1.0, 100.0)) for fix in shuffled[::4]]
    expected, expected_covariance, _ = track(run, docking_filter, prompt)
    means, covariances, last = track(run, docking_filter, shuffled)
    order = [fix.stamp for fix in sorted(shuffled, key=lambda fix: fix.received)]
    assert order != sorted(order)
    assert last.refused["duplicate"] == len(shuffled) - len(prompt)
    assert np.abs(means[50] - expected[50]).max() > 1e-3  # on the way they differ
    # Bit for bit: the nodes are the same, and each is computed from the one before it alone.
    assert (means[-1] == expected[-1]).all()
    assert (covariances[-1] == expected_covariance[-1]).all()


def test_augmented_filter_is_consistent():
    """NEES over seeds, on the truth that the filter believes in."""
    runs = [simulate(100 + seed, duration=200.0) for seed in range(40)]
    tracked = [track(run, AugmentedFilter(PRESTERO, REFERENCE_NOISE, gate=None)) for run in runs]
    for tick in (100, 200, 300, 400):
        values = [
            nees(means[tick], covariances[tick], run.ticks[tick], angles=(2,))
            for run, (means, covariances, _) in zip(runs, tracked, strict=True)
        ]
        # One value a run, so that all are independent; the interval fails a consistent filter once in 250 such tests.
        low, high = interval(8, samples=len(runs), probability=0.999)
        assert low < np.mean(values) < high


def rms(errors: list) -> float:
    return math.sqrt(np.mean(np.concatenate(errors) ** 2))


def test_paper_filter_at_40_m():
    """Short form of the settled study: the paper's mean error, what augmentation gains and what delay handling does."""
    runs = [simulate(200 + seed, duration=600.0) for seed in range(12)]
    paper = [position_errors(run, track(run, PaperFilter(PRESTERO))[0]) for run in runs]
    augmented = [
        position_errors(run, track(run, AugmentedFilter(PRESTERO, replace(REFERENCE_NOISE, current=1e-8)))[0])
        for run in runs
    ]
    # Table 1 prints 0.1011 m; the bounds are the study's own of 24000 s, wide enough for 12 x 500 s (sd of 3 %).
    assert 0.85 < np.mean(np.concatenate(paper)) / 0.1011 < 1.15
    # 0.83 measured over 24000 s with an sd of 2 to 3 %; here a quarter of that time, so an sd of 5 %: two of them.
    assert rms(augmented) / rms(paper) < 0.93
    late = [replace_received(run) for run in runs[:4]]
    uncompensated = [position_errors(run, track(run, PaperFilter(PRESTERO))[0]) for run in late]
    assert rms(uncompensated) > 3.0 * rms(paper[:4])  # fixes of 1.58 s ago taken for current ones


def replace_received(run: Run) -> Run:
    """The run as a filter without delay handling sees it: each fix stamped with its arrival."""
    return replace(run, fixes=[replace(fix, stamp=fix.received) for fix in run.fixes])


def test_euler_is_worse_than_midpoint_on_a_tight_circle():
    runs = [simulate(300 + seed, radius=12.0, duration=600.0) for seed in range(8)]
    errors = {
        integrator: rms(
            [
                position_errors(run, track(run, PaperFilter(PRESTERO, integrator=integrator, max_substep=0.5))[0])
                for run in runs
            ]
        )
        for integrator in ("euler", "midpoint")
    }
    assert 1.03 < errors["euler"] / errors["midpoint"] < 1.2  # 1.11 measured in the study, bounds as there


def test_bad_packets_are_refused_and_counted():
    run = simulate(4, duration=60.0)
    nan, inf = math.nan, math.inf
    good = run.fixes[3]
    bad = [
        replace(good, position=(nan, 0.0, 0.0), sequence=100),
        replace(good, position=(inf, 0.0, 0.0), sequence=101),
        replace(good, heading=inf, sequence=102),
        replace(good, stamp=nan, sequence=103),
    ]
    for docking_filter in filters():
        expected, _, _ = track(run, docking_filter)
        means, _, last = track(run, docking_filter, [*run.fixes, *bad])
        assert (means == expected).all()
        assert last.refused["not_finite"] == len(bad)


def test_bad_compass_samples_are_refused_and_missing_ones_do_not_matter():
    run = simulate(5, duration=60.0)
    gaps = run.compass.copy()
    gaps[20:25] = [math.nan, math.inf, -math.inf, math.nan, math.nan]
    means, _, last = track(replace(run, compass=gaps), AugmentedFilter(PRESTERO))
    assert last.refused["not_finite"] == 5
    assert np.isfinite(means).all()
    estimator, other = DockingEstimator(AugmentedFilter(PRESTERO)), DockingEstimator(AugmentedFilter(PRESTERO))
    for k in range(30):
        fixes = [replace(FIX, stamp=0.1)] if k == 1 else []
        heading = 0.2 if k < 5 else None
        a = estimator.tick(0.5 * k, heading, 0.0, 0.0, fixes)
        b = other.tick(0.5 * k, math.nan if heading is None else heading, 0.0, 0.0, fixes)
    assert (a.mean == b.mean).all()


def test_inputs_that_are_no_numbers_are_refused_by_name():
    estimator = DockingEstimator(AugmentedFilter(PRESTERO))
    with pytest.raises(ParameterError, match="must be finite"):
        estimator.tick(0.0, 0.0, math.nan, 0.0)
    estimator.tick(0.0, 0.0, 0.0, 0.0)
    with pytest.raises(ParameterError, match="must come after"):
        estimator.tick(0.0, 0.0, 0.0, 0.0)
    with pytest.raises(ParameterError, match="must rise"):
        UsblModel(ranges=(2.0, 1.0), deviations=(0.1, 0.1))


def test_heading_is_wrapped_through_many_turns():
    run = simulate(6, radius=12.0, duration=300.0)
    assert abs(run.ticks[-1, 2]) > 2 * math.pi
    for docking_filter in filters():
        means, _, _ = track(run, docking_filter)
        assert np.abs(means[:, 2]).max() <= math.pi
        error = np.angle(np.exp(1j * (means - run.ticks)[40:, 2]))
        assert np.abs(error).max() < 5 * COMPASS_SIGMA


def test_defaults_are_those_of_docking():
    noise = DockingNoise()
    assert noise.current <= 3e-3
    assert noise.compass == pytest.approx(COMPASS_SIGMA)
    assert noise.densities().shape == (8,)
