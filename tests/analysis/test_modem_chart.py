"""The chart of a modem: overlap as of pure ALOHA, none in slots, ages in closed form, bounds that follow."""

import csv
import math

import pytest

from auvsim import cli
from auvsim.acoustics.payload import STATE, packet_bits
from auvsim.acoustics.presets import PRESETS
from auvsim.analysis import modem_chart
from auvsim.analysis.modem_chart import Fleet, bound, heard, mean_age, run, slot

PSK = PRESETS["micromodem_psk"]


def fleet(**changed):
    return Fleet("micromodem_psk", 3, 15.0, "ALOHA", "one-way", 300.0)._replace(**changed)


def test_age_of_what_is_known():
    """From 10 s on 4 s old, and from 20 s on 1 s old; a state that comes late and is older changes nothing."""
    assert mean_age([(10.0, 6.0), (20.0, 19.0)], 30.0) == pytest.approx(0.5 * ((4 + 14) / 2 + (1 + 11) / 2))
    assert mean_age([(10.0, 6.0), (15.0, 2.0)], 20.0) == pytest.approx((4 + 14) / 2)
    assert mean_age([], 20.0) == math.inf


def test_two_modems_lose_what_they_send_over():
    """A packet of tau is lost where the other begins to send within tau of it: 2 tau a period, of times at random."""
    period = 8.0
    results = [heard(one, *run(one, 4000.0, 5), 4000.0) for one in (fleet(followers=1, period=period),)]
    (every, collisions, lost, age), tau = results[0], PSK.duration(packet_bits(14))
    assert every == pytest.approx(period, rel=0.01)
    expected = 2.0 * tau / period
    spread = math.sqrt(expected * (1.0 - expected) / 1000.0)  # of 1000 packets; both of a pair are lost together
    assert collisions == pytest.approx(expected, abs=4.0 * spread)
    assert lost >= collisions - 2.0 * spread
    # Uniform times within each period: a state is half a period old on the mean, and half that spread's more.
    assert 0.5 * period < age < 1.2 * period


@pytest.mark.parametrize("ranging", ["one-way", "two-way"])
def test_slots_keep_packets_apart_and_cost_time(ranging):
    few, many = (fleet(access="TDMA", ranging=ranging, followers=n, period=12.0) for n in (1, 7))
    for one in (few, many):
        period, collisions, _, age = heard(one, *run(one, 900.0, 2), 900.0)
        assert collisions == 0.0
        wanted = max(one.period, slot(one) * (one.followers + 1))
        assert period == pytest.approx(wanted, rel=0.25)  # of 900 s, in whole slots
        assert 0.5 * period < age < period + 5.0
    free = fleet(ranging=ranging, followers=7, period=12.0)
    assert heard(free, *run(free, 900.0, 2), 900.0)[1] > 0.2


def test_a_question_and_its_reply_are_both_needed():
    one = fleet(ranging="two-way", followers=1, period=20.0)
    _, received = run(one, 900.0, 3)
    replies = [d for d in received["follower_1"] if d.message.kind == STATE]
    assert len(replies) > 35
    assert [d.range for d in replies] == pytest.approx([300.0] * len(replies), abs=1.5)  # four times 1500 * 125 us
    assert not [d for d in received["follower_1"] if d.message.kind != STATE]


def test_losses_and_rare_packets_raise_the_bound():
    one = fleet()
    whole, lossy, rare = bound(one, 8.0, 0.0), bound(one, 8.0, 0.6), bound(one, 32.0, 0.0)
    assert whole < lossy < 3.0 * whole
    assert whole < rare
    assert bound(one, 8.0, 1.0) == math.inf


def test_the_command_writes_what_it_prints(tmp_path, capsys):
    arguments = ["modem", "s2c_r_18_34", "--followers", "1..2", "--period", "5", "--duration", "100"]
    assert cli.main([*arguments, "--out", str(tmp_path)]) == 0
    assert "TDMA" in capsys.readouterr().out
    with (tmp_path / "modem_s2c_r_18_34.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(r["access"], r["ranging"], r["followers"]) for r in rows][:3] == [
        ("ALOHA", "one-way", "1"), ("ALOHA", "one-way", "2"), ("ALOHA", "two-way", "1"),
    ]  # fmt: skip
    assert (tmp_path / "modem_s2c_r_18_34.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["horn"], "no modem 'horn'; there are atm_900"),
        (["atm_900", "--followers", "8..1"], "--followers 8..1 must lie in 1..30, the smaller number first"),
        (["atm_900", "--followers", "many"], "--followers many must be a number, or FROM..TO"),
        (["atm_900", "--period", "nan"], "--period nan must lie in 1 .. 3600"),
        (["atm_900", "--distance", "1"], "--distance 1 must lie in 10 .. 20000"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, reason, tmp_path, capsys):
    assert cli.main(["modem", *arguments, "--out", str(tmp_path / "new")]) == 2
    error = capsys.readouterr().err
    assert reason in error
    assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / "new").exists()


def test_a_point_joins_all(monkeypatch):
    monkeypatch.setattr(modem_chart, "bound", lambda fleet, period, lost: period + lost)
    point = modem_chart.point(fleet(access="TDMA"), 300.0, 1)
    assert point.bound == point.period + point.lost
