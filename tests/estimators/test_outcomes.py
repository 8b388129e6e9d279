"""The fate of every measurement: what a history refuses, what a filter refuses, and what a replay changes later."""

import math
from dataclasses import replace

import numpy as np
import pytest
from docking_runs import TICK, simulate
from test_augmented import shifted
from test_history import compass, fix, history_until

from estimators.core.history import History
from estimators.docking.estimator import REFERENCE_NOISE, AugmentedFilter, DockingEstimator, InteractingFilter
from estimators.planar.model import PRESTERO


def fates(outcomes):
    """The last outcome of each measurement."""
    return {(o.kind, o.source, o.stamp, o.sequence): (o.accepted, o.reason) for o in outcomes}


def followed(filter_, run, fixes):
    """All outcomes, and the last estimate."""
    estimator, outcomes, estimate = DockingEstimator(filter_, run.usbl, step=TICK), [], None
    waiting = sorted(fixes, key=lambda f: f.received)
    for k, heading in enumerate(run.compass):
        arrived = [f for f in waiting if f.received <= TICK * k]
        waiting = waiting[len(arrived) :]
        estimate = estimator.tick(TICK * k, heading, run.rudder, 0.0, arrived)
        outcomes.append(estimate.outcomes)
    return outcomes, estimate


def test_what_the_history_refuses_is_told_by_kind_source_stamp_and_number():
    history = history_until(40.0, keep=10.0)
    assert history.insert(replace(fix(39.0, sequence=7), source="a"))
    assert history.insert(replace(fix(39.0, sequence=7), source="b"))  # another beacon seen at the same time
    refused = {
        "duplicate": replace(fix(39.2, sequence=7), source="b"),
        "future": fix(40.1),
        "too_old": fix(29.9),
        "not_finite": fix(39.1, value=(math.nan, 0.0)),
        "not_positive_definite": fix(39.1, covariance=[[1, 2], [2, 1]], sequence=3),
    }
    for measurement in refused.values():
        assert not history.insert(measurement)
    history.replay()
    told = [(o.kind, o.source, o.stamp, o.sequence, o.reason) for o in history.outcomes if not o.accepted]
    # Ticks without measurements before the start say nothing; no measurement came before it.
    assert told == [
        (m.kind, m.source, m.stamp, -1 if m.sequence is None else m.sequence, reason) for reason, m in refused.items()
    ]
    assert [(o.source, o.nis == o.nis) for o in history.outcomes if o.accepted] == [("a", False), ("b", False)]
    assert history.replay() is not None
    assert history.outcomes == ()


def test_a_late_first_fix_lets_in_what_had_come_too_early():
    history = history_until(1.0)
    history.append(1.5, (0.0,), [compass(1.5)])
    history.append(2.0, (0.0,), [fix(2.0)])
    history.replay()
    assert [(o.stamp, o.reason) for o in history.outcomes] == [(1.5, "not_started"), (2.0, "")]
    history.insert(fix(1.2))
    history.replay()
    assert [(o.stamp, o.reason) for o in history.outcomes] == [(1.2, ""), (1.5, "")]


@pytest.mark.parametrize("kind", [AugmentedFilter, InteractingFilter])
def test_every_packet_and_sample_has_one_fate_and_refusals_add_up(kind):
    run = simulate(11, duration=150.0)
    rng = np.random.default_rng(12)
    fixes = [replace(f, received=min(f.stamp + rng.uniform(0.0, 20.0), 150.0)) for f in run.fixes]
    fixes = [shifted(f, (20.0 * rng.standard_normal(), -15.0)) if k % 6 == 4 else f for k, f in enumerate(fixes)]
    fixes.append(replace(fixes[3], sequence=900, stamp=50.0, received=51.0, position=(math.nan, 0.0, 0.0)))
    fixes.append(replace(fixes[3], sequence=901, stamp=51.0, received=52.0, position=(1e9, 0.0, 0.0)))
    fixes.append(replace(fixes[3], received=150.0))  # by then too old: the others' numbers stay apart
    outcomes, estimate = followed(kind(PRESTERO, REFERENCE_NOISE), run, fixes)
    last = fates(o for tick in outcomes for o in tick)
    assert len([key for key in last if key[0] == "compass"]) == len(run.compass)
    assert {key[3] for key in last if key[0] == "usbl"} == {f.sequence for f in fixes}
    reasons = [reason for (sensor, *_), (_, reason) in last.items() if sensor == "usbl"]
    for reason in ("outlier", "not_finite", "implausible"):
        assert reasons.count(reason) == estimate.refused[reason] > 0
    judged = [o for tick in outcomes for o in tick if o.reason == "outlier"]
    assert min(o.nis for o in judged) > 5.0  # far beyond the mean of two degrees of freedom


def test_a_recovery_takes_back_what_was_refused():
    """The belief is pushed off; the second good fix agrees with the first, which had been refused."""
    run = simulate(13, duration=100.0)
    fixes = [f if f.stamp < 50.0 else shifted(f, (14.0, -6.0)) for f in run.fixes]
    moved = [f for f in fixes if f.stamp >= 50.0]
    outcomes, _ = followed(AugmentedFilter(PRESTERO, REFERENCE_NOISE), run, fixes)
    told = [(o.sequence, o.reason) for tick in outcomes for o in tick if o.kind == "usbl" and o.stamp >= 50.0]
    first, second = moved[0].sequence, moved[1].sequence
    assert told[:3] in (
        [(first, "outlier"), (first, ""), (second, "")],
        [(first, "outlier"), (second, ""), (first, "")],
    )


def test_a_late_fix_that_undoes_a_recovery_gives_the_refusal_back():
    """Delivered late, in any order, the last outcomes are those of the fixes delivered in order."""
    run = simulate(14, duration=100.0)
    fixes = [f if f.stamp < 50.0 else shifted(f, (14.0, -6.0)) for f in run.fixes]
    fixes = [shifted(f, (25.0, 3.0)) if k in (4, 5, 9) else f for k, f in enumerate(fixes)]
    ends = set()
    for seed in range(6):
        rng = np.random.default_rng(seed)
        late = [replace(f, received=min(f.stamp + seed * rng.uniform(0.0, 5.0), 100.0)) for f in fixes]
        outcomes, _ = followed(AugmentedFilter(PRESTERO, REFERENCE_NOISE), run, late)
        last = fates(o for tick in outcomes for o in tick if o.kind == "usbl")
        ends.add(tuple(sorted(last.items())))
    assert len(ends) == 1
    assert any(not accepted for _, (accepted, _) in next(iter(ends)))


class Forgiving:
    """Refuses each fix, and takes it back at the next node, unless that has a second measurement."""

    def start(self, nodes, index):
        return self.correct(((), ()), nodes[index].time, nodes[index].measurements)

    def predict(self, state, u, duration):
        return state[0], ()

    def correct(self, state, node_time, measurements):
        refused, _ = state
        verdicts = [(m, "outlier", 9.0) for m in measurements]
        if len(measurements) == 1:
            verdicts += [(m, "", 9.0) for m in refused]
        return tuple(measurements), tuple(verdicts)


def test_what_a_later_node_revises_is_told_once_and_taken_back_once():
    history = History(Forgiving(), step=0.5, verdicts=lambda state: state[1])
    told = []
    for k in range(3):
        history.append(0.5 * k, (0.0,), [fix(0.5 * k)] if k else [])
        history.replay()
        told.append([(o.stamp, o.reason) for o in history.outcomes])
    assert told == [[], [(0.5, "outlier")], [(0.5, ""), (1.0, "outlier")]]
    history.insert(fix(0.01, kind="early"))  # all is replayed, and nothing of these changes
    history.replay()
    assert [(o.kind, o.stamp, o.reason) for o in history.outcomes] == [("early", 0.01, "")]
    history.insert(fix(0.99, kind="late"))  # the node that took the fix back does so no more
    history.replay()
    assert {(o.kind, o.stamp, o.reason) for o in history.outcomes} == {
        ("fix", 0.5, "outlier"),
        ("late", 0.99, "outlier"),
    }
