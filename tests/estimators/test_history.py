"""The delay buffer with a filter so simple that every state can be written down: it records what it was fed."""

import math

import numpy as np
import pytest

from estimators.core.errors import ParameterError
from estimators.core.history import History
from estimators.core.types import Measurement


class Recorder:
    """Starts at the first "fix" and keeps the whole story of predictions and corrections as its state."""

    def start(self, nodes, index):
        fixes = [m for m in nodes[index].measurements if m.kind == "fix"]
        return (("start", nodes[index].time, *(m.stamp for m in fixes)),) if fixes else None

    def predict(self, state, u, duration):
        return (*state, ("predict", u[0], duration))

    def correct(self, state, node_time, measurements):
        return (*state, ("correct", node_time, *((m.kind, m.stamp) for m in measurements)))


def fix(stamp, sequence=None, value=(1.0, 2.0), covariance=None, kind="fix"):
    covariance = np.eye(2) if covariance is None else np.array(covariance, dtype=float)
    value = np.array(value, dtype=float)
    return Measurement(kind=kind, value=value, covariance=covariance, stamp=stamp, received=stamp, sequence=sequence)


def compass(stamp):
    return Measurement(kind="compass", value=np.zeros(1), covariance=np.eye(1), stamp=stamp, received=stamp)


def history_until(end, step=0.5, **options):
    history = History(Recorder(), step=step, **options)
    for k in range(round(end / step) + 1):
        history.append(k * step, (float(k),))
    history.replay()
    return history


def test_a_late_fix_gets_a_node_of_its_own_with_the_input_that_held_there():
    history = history_until(2.0)
    assert history.insert(fix(0.0))
    assert history.insert(fix(1.2))
    assert history.replay() == (
        ("start", 0.0, 0.0),
        ("predict", 1.0, 0.5),  # the input given at a tick held since the tick before
        ("predict", 2.0, 0.5),
        ("predict", 3.0, pytest.approx(0.2)),
        ("correct", 1.2, ("fix", 1.2)),
        ("predict", 3.0, pytest.approx(0.3)),
        ("predict", 4.0, 0.5),
    )


@pytest.mark.parametrize(("stamp", "node"), [(0.96, 1.0), (1.04, 1.0), (0.94, 0.94), (1.06, 1.06), (1.0, 1.0)])
def test_a_fix_within_a_tenth_of_a_step_belongs_to_the_tick_on_either_side(stamp, node):
    history = history_until(2.0)
    history.insert(fix(0.0))
    history.insert(fix(stamp))
    state = history.replay()
    assert state is not None
    assert ("correct", node, ("fix", stamp)) in state


def test_a_tick_corrected_again_starts_from_its_prediction():
    history = History(Recorder(), step=0.5)
    history.append(0.0, (0.0,))
    history.insert(fix(0.0))
    history.append(0.5, (0.0,), [compass(0.5)])
    first = history.replay()
    assert first is not None
    assert first[-1] == ("correct", 0.5, ("compass", 0.5))
    history.insert(fix(0.49))
    assert history.replay() == (
        ("start", 0.0, 0.0),
        ("predict", 0.0, 0.5),
        ("correct", 0.5, ("compass", 0.5), ("fix", 0.49)),  # the compass once
    )


def test_order_of_delivery_does_not_matter():
    rng = np.random.default_rng(3)
    stamps = [1.0, 1.0 + 1e-12, 1.03, 0.98, 1.2, 1.21, 1.2 + 1e-9, 3.7, 0.3, 4.999]
    stories = set()
    for _ in range(50):
        history = history_until(1.0)
        pending = [stamps[k] for k in rng.permutation(len(stamps))]
        for k in range(3, 20):
            history.append(0.5 * k, (float(k),))
            while pending and pending[0] <= 0.5 * k and rng.random() < 0.7:
                assert history.insert(fix(pending.pop(0)))
            history.replay()
        for stamp in pending:
            assert history.insert(fix(stamp))
        stories.add(history.replay())
    assert len(stories) == 1
    assert next(iter(stories))[0] == ("start", 0.3, 0.3)


def test_each_refusal_is_counted_by_its_name():
    history = history_until(40.0, keep=10.0)
    nan = math.nan
    assert history.insert(fix(39.0, sequence=7))
    refused = {
        "duplicate": [fix(39.0), fix(39.2, sequence=7)],
        "future": [fix(40.1)],
        "too_old": [fix(29.9), fix(-1.0)],
        "not_finite": [fix(39.1, value=(nan, 0.0)), fix(nan), fix(39.1, covariance=[[nan, 0], [0, 1]]), fix(math.inf)],
        "not_positive_definite": [
            fix(39.1, covariance=[[1, 2], [2, 1]]),
            fix(39.1, covariance=[[0, 0], [0, 1]]),
            fix(39.1, covariance=[[1, 0.5], [0, 1]]),
            Measurement(kind="fix", value=np.ones(1), covariance=-np.eye(1), stamp=39.1, received=39.1),
        ],
    }
    before = history.replay()
    for measurements in refused.values():
        for measurement in measurements:
            assert not history.insert(measurement)
    assert history.refused == {reason: len(measurements) for reason, measurements in refused.items()}
    assert history.replay() is before  # and nothing was touched
    assert history.insert(fix(39.0, kind="other"))  # another sensor at the same time is no duplicate


def test_nodes_leave_by_age_and_the_state_is_that_of_a_history_that_keeps_all():
    short, long = History(Recorder(), step=0.5, keep=3.0), History(Recorder(), step=0.5, keep=1000.0)
    for k in range(100):
        for history in (short, long):
            history.append(0.5 * k, (float(k),))
            if k % 8 == 6:
                history.insert(fix(0.5 * k - 2.9))  # of the oldest that are accepted
            history.replay()
    assert short.state == long.state
    assert len(short.nodes) < 12
    assert len(long.nodes) > 100


def test_a_tick_that_a_measurement_of_the_greatest_age_still_belongs_to_keeps_its_base():
    """The tick at 0.46 s is within a tenth of a step of the stamp that is just 2 s old: it is not the oldest."""
    short, long = History(Recorder(), step=0.5, keep=2.0), History(Recorder(), step=0.5, keep=1000.0)
    for history in (short, long):
        for k, time in enumerate((0.0, 0.46, 1.0, 1.5, 2.0, 2.5)):
            history.append(time, (float(k),), [fix(0.0)] if k == 0 else ())
            history.replay()
        assert history.insert(fix(0.5))
        history.replay()
    assert short.state == long.state
    assert short.state[2] == ("correct", 0.46, ("fix", 0.5))


def test_rarely_replayed_history_forgets_nothing():
    short, long = History(Recorder(), step=0.5, keep=3.0), History(Recorder(), step=0.5, keep=1000.0)
    for k in range(50):
        for history in (short, long):
            history.append(0.5 * k, (float(k),))
            if k == 1:
                history.insert(fix(0.3))
    assert short.replay() == long.replay()


def test_time_must_advance():
    history = history_until(1.0)
    for time in (1.0, 0.3, math.nan, math.inf):
        with pytest.raises(ParameterError, match="must come after"):
            history.append(time, (0.0,))
    with pytest.raises(ParameterError, match="0 < step <= keep"):
        History(Recorder(), step=0.0)
