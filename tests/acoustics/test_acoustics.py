"""The acoustic link: delay law, losses, order, duplicates, and noise that losses do not shift."""

import math

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import binom, kstest

from auvsim.acoustics.link import AcousticSettings, Channel
from auvsim.acoustics.message import Message
from auvsim.acoustics.network import Network
from auvsim.base.randomness import stream

QUIET = {"dropout_probability": 0.0, "late_probability": 0.0}


def message(index, interval=5.0):
    """A message whose payload is its number."""
    return Message("dock", "remus100", interval * index, "test", index)


def send_all(settings, count=4000, slant_range=50.0, lost=()):
    channel = Channel(settings, stream(2, 0, "remus100/acoustics"))
    packets = [channel.send(message(index), slant_range, lost=index in lost) for index in range(count)]
    return channel, packets


def within(events, count, probability):
    """Whether a count of events lies in the central 1 - 2e-5 of its binomial distribution."""
    low, high = binom.ppf([1e-5, 1 - 1e-5], count, probability)
    return low <= events <= high


@pytest.mark.parametrize("slant_range", [12.0, 200.0])
def test_delay_is_uniform_about_a_line_in_range(slant_range):
    _, packets = send_all(AcousticSettings(**QUIET), slant_range=slant_range)
    delays = np.array([packet.received - packet.message.sent for packet in packets])
    standard = (delays - (1.5 + 0.002 * slant_range)) / 0.1
    assert np.all(np.abs(standard) <= 1.0 + 1e-9)  # stamps of 20 000 s leave 4e-12 s of rounding
    assert kstest(standard, "uniform", args=(-1.0, 2.0)).pvalue > 1e-5  # falsely refused once in 100 000


def test_shares_of_lost_and_late_packets():
    _, packets = send_all(AcousticSettings())
    arrived = [packet for packet in packets if packet.fate == "delivered"]
    late = [r for r in arrived if r.received - r.message.sent > 3.0]
    assert within(len(packets) - len(arrived), len(packets), 0.05)
    assert within(len(late), len(arrived), 0.02)


def test_lost_packets_are_flagged_and_never_arrive():
    channel, packets = send_all(AcousticSettings(dropout_probability=0.3))
    lost = {packet.message.payload for packet in packets if packet.fate == "dropped"}
    assert all(math.isnan(packets[index].received) for index in lost)
    arrived = [r.message.payload for r in channel.receive(math.inf)]
    assert sorted(arrived) == sorted(set(range(len(packets))) - lost)


def test_a_loss_changes_no_other_packet():
    settings = AcousticSettings(duplicate_probability=0.1)
    channel, packets = send_all(settings, count=300)
    gapped, others = send_all(settings, count=300, lost={10, 11, 150})
    for index, (packet, other) in enumerate(zip(packets, others, strict=True)):
        if index in (10, 11, 150):
            assert other.fate == "out of range"
        elif packet.fate == "delivered":
            assert other.received == packet.received
    kept = [r.received for r in channel.receive(math.inf) if r.message.payload not in (10, 11, 150)]
    assert [r.received for r in gapped.receive(math.inf)] == kept


def test_readings_come_in_order_of_arrival_at_the_first_tick_after_it():
    settings = AcousticSettings(late_probability=0.2, duplicate_probability=0.2)
    channel = Channel(settings, stream(3, 0, "remus100/acoustics"))
    received, previous, sent = [], -0.1, 0
    for tick in range(20_000):
        now = 0.1 * tick
        while 5.0 * sent <= now and sent < 390:
            channel.send(message(sent), 100.0)
            sent += 1
        arrived = channel.receive(now)
        assert all(previous < r.received <= now for r in arrived)
        assert all(r.received - r.message.sent >= 1.6 - 1e-12 for r in arrived)  # 1.5 + 0.2 - 0.1 at the least
        received += arrived
        previous = now
    times = [r.received for r in received]
    assert times == sorted(times)
    assert channel.receive(math.inf) == []
    sequences = [r.message.payload for r in received]
    assert sequences != sorted(sequences)
    assert len(sequences) > len(set(sequences))


def test_a_late_packet_arrives_after_its_successor():
    settings = AcousticSettings(dropout_probability=0.0, late_probability=0.02)
    channel = Channel(settings, stream(4, 0, "remus100/acoustics"))
    packets = [channel.send(message(index, interval=6.0), 100.0) for index in range(2000)]  # the longest interval
    delays = np.array([p.received - p.message.sent for p in packets])
    late = [index for index in np.flatnonzero(delays > 3.0) if index + 1 < len(packets) and delays[index + 1] < 3.0]
    assert len(late) > 10
    assert all(packets[index].received > packets[index + 1].received for index in late)


def test_duplicates_follow_the_first_copy():
    settings = AcousticSettings(**QUIET, duplicate_probability=0.25)
    channel, packets = send_all(settings, count=2000)
    copies = {}
    for r in channel.receive(math.inf):
        copies.setdefault(r.message.payload, []).append(r)
    twice = [pair for pair in copies.values() if len(pair) == 2]
    assert within(len(twice), len(packets), 0.25)
    for first, second in twice:
        assert first.message is second.message
        assert first.received == packets[first.message.payload].received
        assert 0.0 <= second.received - first.received <= settings.late_delay


def test_a_network_delivers_to_whom_it_is_sent_and_says_what_becomes_of_the_rest():
    """A broadcast reaches all with a modem, each over its own distance; who has none does not hear it."""
    links = {name: Channel(AcousticSettings(**QUIET), stream(6, 0, f"{name}/acoustics")) for name in ("near", "far")}
    network = Network(links)
    fates = network.send(Message("dock", None, 2.0, "test", "hello"), {"near": 10.0, "far": 400.0, "deaf": 50.0})
    assert [(f.destination, f.fate) for f in fates] == [
        ("near", "delivered"), ("far", "delivered"), ("deaf", "no modem")
    ]  # fmt: skip
    assert math.isnan(fates[2].received)
    for fate, distance in zip(fates, (10.0, 400.0), strict=False):
        assert fate.received == pytest.approx(2.0 + 1.5 + 0.002 * distance, abs=0.1)  # the jitter's half width
        (delivery,) = network.deliver(fate.destination, fate.received)
        assert delivery.message.payload == "hello"
    assert network.deliver("near", math.inf) == network.deliver("deaf", math.inf) == []


def test_replays_bit_for_bit():
    first, again = (send_all(AcousticSettings())[0].receive(math.inf) for _ in range(2))
    assert [(r.received, r.message) for r in first] == [(r.received, r.message) for r in again]


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ({"delay": 0.05}, "must not exceed the delay"),
        ({"dropout_probability": 1.1}, "less than or equal to 1"),
        ({"late_delay": -1.0}, "greater than or equal to 0"),
        ({"loss": 0.1}, "loss"),
    ],
)
def test_bad_settings_are_refused(data, text):
    with pytest.raises(ValidationError, match=text):
        AcousticSettings(**data)
