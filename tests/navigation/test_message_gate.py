"""Messages that no modem can have sent are refused, counted and named."""

import math

import pytest

from auvsim.acoustics.message import Delivery, Message
from auvsim.acoustics.payload import STATE, StateReport
from auvsim.navigation.message_gate import MessageGate


def state(sent, travel=0.2, *, source="leader", sequence=None, **changes):
    payload = StateReport(sent, *(float(k) for k in range(13)))
    message = Message(source, None, sent, STATE, payload, 256, round(sent) if sequence is None else sequence)
    return Delivery(message._replace(**changes), sent + travel + 1.3, 1500.0 * travel, None, sent + travel)


def judged(*deliveries):
    gate = MessageGate("follower", ["leader", "follower", "other"])
    return [gate.judge(delivery) for delivery in deliveries]


GOOD = state(0.0)


@pytest.mark.parametrize(("bad", "reason"), [
    (state(8.0, source="stranger"), "unknown_source"),
    (state(8.0, source="follower"), "unknown_source"),
    (state(8.0, destination="other"), "wrong_vehicle"),
    (state(8.0, payload=(8.0, 1.0, 2.0)), "truncated"),
    (state(8.0, payload=None), "truncated"),
    (state(8.0, payload=(8.0, math.nan, *(0.0,) * 12)), "not_finite"),
    (state(8.0, payload=(8.0, math.inf, *(0.0,) * 12)), "not_finite"),
    (state(8.0, sequence=0), "duplicate"),
    (state(8.0, travel=-0.5), "future"),
    (state(8.0, payload=(9.0, *(0.0,) * 13)), "future"),
    (state(8.0, travel=61.0), "impossible"),
    (state(8.0, travel=1.5), "clock_jump"),
])  # fmt: skip
def test_bad_messages_are_named(bad, reason):
    assert judged(GOOD, bad) == ["", reason]


def test_what_is_no_number_at_all():
    assert judged(state(math.nan, sequence=1), state(8.0, payload=("a",) * 14)) == ["not_finite", "not_finite"]


def test_good_messages_pass_while_both_move():
    """Closing at 4 m/s for half an hour, with an hour of silence in between."""
    times = [*range(0, 900, 8), *range(4500, 5400, 8)]
    assert set(judged(*(state(float(t), travel=15.0 - 4.0 * t / 1500.0) for t in times))) == {""}


def test_a_clock_that_has_leapt_is_refused_until_it_leaps_back():
    travel = [0.2 + 0.001 * k + (0.9 if 5 <= k < 60 else 0.0) for k in range(70)]
    found = judged(*(state(8.0 * k, t) for k, t in enumerate(travel)))
    assert found == [""] * 5 + ["clock_jump"] * 55 + [""] * 10


def test_a_leap_of_one_sender_is_not_that_of_another():
    found = judged(state(0.0), state(0.0, source="other"), state(8.0, 2.0), state(8.0, source="other"))
    assert found == ["", "", "clock_jump", ""]


def test_refusals_are_counted_and_have_fates():
    gate = MessageGate("follower", ["leader"])
    good, fates = gate.passed([GOOD, GOOD, state(8.0), state(16.0, payload=())])
    assert [d.message.sent for d in good] == [0.0, 8.0]
    assert [(f.kind, f.source, f.reason, f.accepted) for f in fates] == [
        ("message", "leader", "duplicate", False), ("message", "leader", "truncated", False),
    ]  # fmt: skip
    assert gate.refused == {"leader": 2}
