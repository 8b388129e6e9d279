"""The interacting filter: turns, outliers, its own errors; and what every docking filter must do alike."""

import math
from dataclasses import replace

import numpy as np
import pytest
from test_augmented import shifted

from auvsim.reproduce.paper1.runs import TICK, Conditions, in_order, simulate, track
from estimators.core.errors import NotFiniteError, ParameterError
from estimators.core.history import Node
from estimators.core.types import Measurement
from estimators.docking.estimator import (
    INTERACTING_NOISE,
    REFERENCE_NOISE,
    AugmentedFilter,
    Bias,
    DockingEstimator,
    InteractingFilter,
    PaperFilter,
    UsblFix,
)
from estimators.docking.recovery import Rejected, agreeing
from estimators.docking.sensors import COMPASS, USBL
from estimators.planar.model import PRESTERO

BIASES = {"surge": Bias(3e-3), "compass": Bias(0.02), "dock_heading": Bias(0.01), "clock": Bias(0.1)}
FILTERS = {
    "paper": PaperFilter(PRESTERO),
    "paper_euler": PaperFilter(PRESTERO, integrator="euler", max_substep=0.5),
    "no_current": PaperFilter(PRESTERO, weights=None),
    "augmented": AugmentedFilter(PRESTERO, REFERENCE_NOISE),
    "augmented_biases": AugmentedFilter(PRESTERO, replace(REFERENCE_NOISE, biases=BIASES)),
    "unscented": AugmentedFilter(PRESTERO, REFERENCE_NOISE, transform="unscented"),
    "interacting": InteractingFilter(PRESTERO),
    "interacting_eight": InteractingFilter(PRESTERO, INTERACTING_NOISE, currents=(1e-6, 0.02)),
}


def with_fixes(run, fixes):
    return replace(run, fixes=tuple(sorted(fixes, key=lambda fix: fix.received)))


@pytest.mark.parametrize("name", FILTERS)
def test_delayed_and_shuffled_packets_end_in_the_state_of_prompt_ones(name):
    run = simulate(Conditions(duration=120.0, outliers=0.1), 1)
    prompt = in_order(run)
    rng = np.random.default_rng(2)
    delays = rng.uniform(0.0, 25.0, len(prompt.fixes))
    late = [replace(fix, received=min(fix.stamp + d, 120.0)) for fix, d in zip(prompt.fixes, delays, strict=True)]
    late += [replace(fix, received=120.0) for fix in late[::4]]  # and some twice
    shuffled = with_fixes(run, late)
    assert [fix.stamp for fix in shuffled.fixes] != sorted(fix.stamp for fix in shuffled.fixes)
    expected, got = track(prompt, FILTERS[name]), track(shuffled, FILTERS[name])
    assert np.nanmax(np.abs(got.means[60] - expected.means[60])) > 1e-6 or np.isnan(got.means[60]).all()
    assert (got.means[-1] == expected.means[-1]).all()  # bit for bit, the 1e-9 that are asked for included
    assert (got.covariances[-1] == expected.covariances[-1]).all()


@pytest.mark.parametrize("name", FILTERS)
def test_no_input_makes_a_filter_return_nan(name):
    """Fixes at the edge of the numbers: an estimate, or none, but never NaN; and it comes back."""
    run = simulate(Conditions(duration=150.0), 3)
    estimator = DockingEstimator(FILTERS[name], run.usbl)
    rng = np.random.default_rng(4)
    fixes, last = list(run.fixes), None
    with np.errstate(over="ignore", invalid="ignore"):
        for k, time in enumerate(run.times.tolist()):
            arrived = [fix for fix in fixes if fix.received <= time]
            fixes = fixes[len(arrived) :]
            if 60.0 < time < 80.0:
                wild = rng.choice([1e200, -1e300, 1e308, math.nan, math.inf, 1e9], 3)
                arrived = [UsblFix(stamp=time - 0.1, received=time, position=tuple(wild), heading=0.0)]
            last = estimator.tick(time, run.compass[k], run.rudder[k], 0.0, arrived)
            assert np.isfinite(last.mean).all()
            assert np.isfinite(last.covariance).all()
    assert last is not None
    assert last.initialised
    # Half a minute of good fixes after the last bad one: within the error that the regular filter always has.
    assert np.linalg.norm(last.mean[:2] - run.states[-1, :2]) < 5.0


def test_a_filter_that_fails_starts_anew_and_counts_it():
    """As after an overflow, made at one tick."""
    run = simulate(Conditions(duration=60.0), 5)

    class Failing(AugmentedFilter):
        def correct(self, state, node_time, measurements):
            if 30.0 <= node_time < 30.5 and any(m.kind == "compass" for m in measurements):
                raise NotFiniteError
            return super().correct(state, node_time, measurements)

    estimator = DockingEstimator(Failing(PRESTERO, REFERENCE_NOISE), run.usbl)
    fixes = [shifted(run.fixes[3], (9.0, 9.0)) if k == 3 else fix for k, fix in enumerate(run.fixes)]
    known = []
    for k, time in enumerate(run.times.tolist()):
        arrived = [fix for fix in fixes if fix.received <= time]
        fixes = fixes[len(arrived) :]
        estimate = estimator.tick(time, run.compass[k], run.rudder[k], 0.0, arrived)
        known.append(estimate.initialised)
    first = known.index(True)
    assert not all(known[first:])
    assert known[60] is False
    assert all(known[-20:])
    assert estimate.reinitialised == 1  # however often it was replayed
    assert estimate.refused["outlier"] == 1  # of before the new start


@pytest.mark.parametrize("seed", range(5))
def test_recovers_from_a_first_fix_that_was_an_outlier(seed):
    run = simulate(Conditions(duration=60.0), 500 + seed)
    run = with_fixes(run, [shifted(run.fixes[0], (20.0, 15.0)), *run.fixes[1:]])
    tracked = track(run, InteractingFilter(PRESTERO))
    errors = tracked.errors(run)
    second, third = (math.ceil(fix.received / TICK) for fix in run.fixes[1:3])
    assert errors[second - 1] > 10.0
    assert errors[third:].max() < 1.0  # two good fixes give position and current, each to 0.07 m, 2 s ago


def test_a_first_fix_wrong_by_little_is_not_taken_for_a_current():
    """At 200 m: the second fix is refused, the third just plausible; together they show that the first was wrong."""
    worst = []
    for seed in range(500, 512):
        run = simulate(Conditions(duration=60.0, radius=200), seed)
        run = with_fixes(run, [shifted(run.fixes[0], (10.4, 7.8)), *run.fixes[1:]])
        third = math.ceil(run.fixes[2].received / TICK)
        worst.append(track(run, InteractingFilter(PRESTERO)).errors(run)[third:].max())
    # Two fixes of 0.48 m, 5 s apart and 2 s old, leave 0.14 m/s of the current: 1 m until the next one, three of its
    # deviations. Once in a while the second is taken, and the first for good.
    assert np.median(worst) < 3.0


@pytest.mark.parametrize("jump", [5.0, 30.0, 300.0])
def test_follows_a_truth_that_jumps(jump):
    """However wrong a belief that had been right for long, fixes that agree against it set it right."""
    run = simulate(Conditions(duration=150.0), 3)
    states = run.states.copy()
    states[150:, :2] += [jump, -jump]
    fixes = [shifted(fix, (jump, -jump)) if fix.stamp >= 75.0 else fix for fix in run.fixes]
    moved = replace(with_fixes(run, fixes), states=states)
    errors = track(moved, InteractingFilter(PRESTERO)).errors(moved)
    after = [math.ceil(fix.received / TICK) for fix in moved.fixes if fix.stamp >= 75.0]
    # From the third on it holds with 0.9 that it was wrong; from the fourth on it knows, and from the fifth on the
    # current again, which a small jump had been taken for in part.
    assert errors[after[2] :].max() < 3.0 + 0.1 * math.hypot(jump, jump)
    assert errors[after[3] :].max() < 3.0
    assert errors[after[4] :].max() < 1.0


def test_the_fast_mode_is_believed_while_the_current_turns():
    run = simulate(Conditions(duration=300.0, turn=(120.0, 130.0)), 7)
    estimator = DockingEstimator(InteractingFilter(PRESTERO), run.usbl)
    fixes, weights = list(run.fixes), []
    for k, time in enumerate(run.times.tolist()):
        arrived = [fix for fix in fixes if fix.received <= time]
        fixes = fixes[len(arrived) :]
        estimator.tick(time, run.compass[k], run.rudder[k], 0.0, arrived)
        state = estimator.nodes[-1].state
        weights.append(0.0 if state is None else float(state.weights[1]))
    assert min(weights[200:240]) < 0.2
    assert max(weights[240:290]) > 0.95
    assert weights[-1] < 0.2


def test_wrong_modes_are_refused():
    with pytest.raises(ParameterError, match="3 modes need"):
        InteractingFilter(PRESTERO, currents=(1e-8, 1e-4, 1e-2))
    for initial in ((0.5, 0.6), (0.0, 1.0), (1.0,)):
        with pytest.raises(ParameterError, match="2 probabilities above 0 of sum 1"):
            InteractingFilter(PRESTERO, initial=initial)
    for switching in (((0.0, 0.1), (-0.1, 0.0)), ((0.0, 0.1), (0.0, 0.0))):  # no rate; no way back
        with pytest.raises(ParameterError, match="from every mode to every other"):
            InteractingFilter(PRESTERO, switching=switching)


@pytest.mark.parametrize("interval", [1.0, 2.0, 5.0])
def test_modes_change_with_time_and_not_with_the_number_of_fixes(interval):
    """Fixes that say nothing leave the probabilities of a two-state Markov chain, however often they come."""
    away, back, duration = 0.02, 0.05, 10.0
    docking = InteractingFilter(PRESTERO, switching=((0.0, away), (back, 0.0)), initial=(0.9, 0.1))

    def fix(stamp):
        vague = 1e12 * np.eye(2)  # its likelihoods in the modes differ by some 1e-10
        return Measurement(kind=USBL, value=np.array([40.0, 0.0]), covariance=vague, stamp=stamp, received=stamp)

    heading = Measurement(kind=COMPASS, value=np.zeros(1), covariance=np.eye(1), stamp=0.0, received=0.0)
    state = docking.start([Node(0.0, (0.0, 0.0), [heading, fix(0.0)], is_grid=True)], 0)
    assert state is not None
    for k in range(round(duration / interval)):
        stamp = (k + 1) * interval
        state = docking.correct(docking.predict(state, (0.0, 0.0), interval), stamp, [fix(stamp)])
    share = away / (away + back)
    expected = share + (0.1 - share) * math.exp(-(away + back) * duration)
    assert state.weights == pytest.approx([1.0 - expected, expected], abs=1e-6)


def rejected(stamp, north, east):
    residual = np.array([north, east])
    fix = Measurement(kind=USBL, value=residual, covariance=0.0046 * np.eye(2), stamp=stamp, received=stamp)
    return Rejected(fix, residual, np.eye(2, 8))


def test_two_fixes_agree_within_reach_of_a_current_and_three_only_along_one():
    first, second = rejected(0.0, 20.0, 0.0), rejected(5.0, 22.5, 1.0)
    # An error of the current of 0.5 m/s, a deviation and a half of 0.35.
    assert agreeing(second, (first,), REFERENCE_NOISE) == [first]
    assert agreeing(rejected(5.0, 28.0, 0.0), (first,), REFERENCE_NOISE) == []  # 1.6 m/s, more than four
    along, aside = rejected(10.0, 25.0, 2.0), rejected(10.0, 20.0, -4.0)
    assert agreeing(along, (first, second), REFERENCE_NOISE) == [second, first]
    assert len(agreeing(aside, (first, second), REFERENCE_NOISE)) == 1  # each is within reach of it, but not both
    assert agreeing(aside, (first,), REFERENCE_NOISE) == [first]
    assert agreeing(rejected(40.0, 22.5, 1.0), (first,), REFERENCE_NOISE) == []  # forgotten


def test_three_wrong_fixes_in_a_row_do_not_overturn_a_settled_filter():
    run = simulate(Conditions(duration=150.0), 8)
    offsets = {15: (14.0, 4.0), 16: (24.0, 3.0), 17: (20.0, -6.0)}
    wrong = [shifted(fix, offsets[fix.sequence]) if fix.sequence in offsets else fix for fix in run.fixes]
    tracked = track(with_fixes(run, wrong), InteractingFilter(PRESTERO))
    assert tracked.errors(run)[100:].max() < 1.5  # 20 s without a good fix, the current known to some cm/s
    assert tracked.refused["outlier"] == 3


def worst_nees(run, tracked, span):
    """The largest NEES of the position per degree of freedom in a span of ticks."""
    error, covariance = (tracked.means - run.states)[span, :2], tracked.covariances[span, :2, :2]
    return (np.einsum("ki,kij,kj->k", error, np.linalg.inv(covariance), error) / 2.0).max()


@pytest.mark.parametrize(
    ("radius", "offsets", "share", "refused"),
    [
        (40, {15: (14.0, 4.0), 16: (19.0, 5.5), 17: (24.0, 7.0)}, 0.9, 0),  # three that agree against it
        # Five of which the last one agrees with the first alone: no more than that it may be right itself.
        (200, {15: (30.0, 0.0), 16: (-30.0, 8.0), 17: (0.0, 33.0), 18: (-5.0, -31.0), 19: (36.0, 3.0)}, 0.5, 4),
    ],
)
def test_wrong_fixes_that_overturn_a_filter_leave_room_for_what_it_was_sure_of(radius, offsets, share, refused):
    """Of two hypotheses the wrong one has a share p: the error is p d, of a variance p (1 - p) d^2 along it."""
    run = simulate(Conditions(duration=150.0, radius=radius), 8)
    last = max(offsets)
    wrong = [shifted(fix, offsets[fix.sequence]) if fix.sequence in offsets else fix for fix in run.fixes]
    tracked = track(with_fixes(run, wrong), InteractingFilter(PRESTERO))
    overturned, next_one = (
        math.ceil(next(f.received for f in run.fixes if f.sequence == k) / TICK) for k in (last, last + 1)
    )
    errors = tracked.errors(run)
    # A fifth for the errors that both have besides.
    assert errors[overturned] == pytest.approx(share * math.hypot(*offsets[last]), rel=0.2)
    # Half as much again for the spread of either hypothesis: without the other one it is above 1000.
    assert worst_nees(run, tracked, slice(overturned, next_one)) < 1.5 * share / (1.0 - share) / 2.0
    assert errors[next_one:].max() < 1.5 * radius / 40.0  # the next good one decides; fixes are worse farther off
    assert tracked.refused["outlier"] == refused
