"""The gate of the augmented filter: outliers move nothing, and nothing locks it out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from docking_runs import TICK, position_errors, simulate, track

from estimators.docking.estimator import AugmentedFilter, UsblFix
from estimators.planar.model import PRESTERO


def shifted(fix: UsblFix, offset) -> UsblFix:
    return replace(fix, position=tuple(np.add(fix.position, (*offset, 0.0))))


def with_outliers(fixes, rng, share):
    """Fixes of which a `share`, not the first two, lies 10 to 30 m off."""
    spoilt = []
    for k, fix in enumerate(fixes):
        distance, bearing = rng.uniform(10.0, 30.0), rng.uniform(-math.pi, math.pi)
        is_outlier = rng.random() < share and k > 1
        spoilt.append(shifted(fix, (distance * math.cos(bearing), distance * math.sin(bearing))) if is_outlier else fix)
    return spoilt


def test_a_lone_outlier_moves_nothing():
    run = simulate(1, duration=120.0)
    spoilt = [shifted(fix, (8.0, -6.0)) if k == 12 else fix for k, fix in enumerate(run.fixes)]
    without = [fix for k, fix in enumerate(run.fixes) if k != 12]
    expected, _, _ = track(run, AugmentedFilter(PRESTERO), without)
    means, _, last = track(run, AugmentedFilter(PRESTERO), spoilt)
    assert last.refused["outlier"] == 1
    # Not bit for bit: the node at its stamp splits one interval of prediction, an integration error of 1e-5 m.
    assert np.abs(means - expected)[:, :2].max() < 1e-3


def test_ten_percent_of_outliers_cost_little():
    rng = np.random.default_rng(7)
    clean, spoilt = [], []
    for seed in range(20):
        run = simulate(400 + seed, duration=300.0)
        clean.append(position_errors(run, track(run, AugmentedFilter(PRESTERO))[0]))
        means, _, last = track(run, AugmentedFilter(PRESTERO), with_outliers(run.fixes, rng, 0.1))
        spoilt.append(position_errors(run, means))
        assert last.refused["outlier"] >= 1
        assert np.isfinite(means).all()
    # A tenth of the fixes missing leaves gaps of 10 s, in which a current of noise 3e-3 carries 0.9 m (1 sd) unseen;
    # an accepted outlier would show as more than 5 m.
    assert math.sqrt(np.mean(np.square(spoilt))) < 2.5 * math.sqrt(np.mean(np.square(clean)))
    assert np.max(spoilt) < 5.0
    without_gate = []
    for seed in range(5):
        run = simulate(400 + seed, duration=300.0)
        fixes = with_outliers(run.fixes, rng, 0.1)
        without_gate.append(position_errors(run, track(run, AugmentedFilter(PRESTERO, gate=None), fixes)[0]))
    assert np.max(without_gate) > 5.0


def test_recovers_from_a_first_fix_that_was_an_outlier():
    for seed in range(10):
        run = simulate(500 + seed, duration=60.0)
        spoilt = [shifted(run.fixes[0], (20.0, 15.0)), *run.fixes[1:]]
        means, _, last = track(run, AugmentedFilter(PRESTERO), spoilt)
        second, third = run.fixes[1], run.fixes[2]
        before = math.ceil(second.received / TICK)
        after = math.ceil(third.received / TICK)
        errors = position_errors(run, means, 0.0)
        assert errors[before - 1] > 10.0
        # Two good fixes give position and current; with noise of 0.07 m and 2 s since, five deviations are 1 m.
        assert errors[after:].max() < 1.0
        assert last.refused["outlier"] == 0  # the fix that was refused at first was used after all


def test_recovers_with_an_outlier_between_two_good_fixes():
    run = simulate(2, duration=60.0)
    fixes = [shifted(run.fixes[0], (-25.0, 10.0)), run.fixes[1], shifted(run.fixes[2], (5.0, 28.0)), *run.fixes[3:]]
    means, _, last = track(run, AugmentedFilter(PRESTERO), fixes)
    after = math.ceil(run.fixes[3].received / TICK)
    assert position_errors(run, means, 0.0)[after:].max() < 1.0
    assert last.refused["outlier"] == 1


@pytest.mark.parametrize("jump", [3.0, 5.0, 30.0, 300.0])
def test_follows_a_truth_that_jumps(jump):
    """A filter whose belief is wrong by any amount follows again at the second fix after it."""
    run = simulate(3, duration=150.0)
    states = run.states.copy()
    states[750:, :2] += [jump, -jump]
    fixes = [shifted(fix, (jump, -jump)) if fix.stamp >= 75.0 else fix for fix in run.fixes]
    moved = replace(run, states=states)
    means, _, last = track(moved, AugmentedFilter(PRESTERO), fixes)
    second = [fix for fix in fixes if fix.stamp >= 75.0][1]
    errors = position_errors(moved, means, 0.0)
    assert errors[math.ceil(second.received / TICK) :].max() < 1.0  # as above
    assert last.refused["outlier"] == 0


def test_follows_a_current_that_turns():
    """A quarter turn of 0.5 m/s at once, more than its random walk expects: no lock-out."""
    for seed in range(10):
        run = simulate(600 + seed, duration=200.0)
        states, turn = run.states.copy(), 100.0
        c = states[0, 6:]
        change = np.array([-c[1], c[0]]) - c
        elapsed = np.clip(0.1 * np.arange(len(states)) - turn, 0.0, None)
        states[:, :2] += elapsed[:, None] * change
        fixes = [shifted(fix, max(0.0, fix.stamp - turn) * change) for fix in run.fixes]
        moved = replace(run, states=states)
        means, _, _ = track(moved, AugmentedFilter(PRESTERO), fixes)
        errors = position_errors(moved, means, turn)
        # 5.5 s between fixes and 1.6 s of delay unseen at 0.71 m/s; one fix more if the first is refused.
        assert errors.max() < 0.71 * (2 * 5.5 + 1.6 + 0.5)
        assert errors[round(30.0 / TICK) :].max() < 1.5
