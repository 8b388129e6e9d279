"""Modems in a run: medium access, stamps by clocks, ranges one way and two ways, bearings, polls, pulses."""

import json
import math

import numpy as np
import pytest

from auvsim.acoustics.access import PollingSettings, Slots, TdmaSettings
from auvsim.acoustics.clock import ClockSettings
from auvsim.acoustics.medium import Medium
from auvsim.acoustics.message import Outgoing
from auvsim.acoustics.modem import ModemSettings
from auvsim.acoustics.modems import Equipment, SoundSettings, build_modems
from auvsim.acoustics.payload import StateReport, packet_bits
from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.physics.truth import Truth

TICK = 0.1
EXACT = {"timing_noise": 0.0, "processing_jitter": 0.0, "source_level": 190.0}


class Fleet:
    """Vehicles on straight ways, with modems."""

    def __init__(self, vehicles, access=None, medium=None, seed=3, **sound):
        """`vehicles`: by name, place (3,), velocity (3,) NED, settings of modem and of clock."""
        self.ways = {name: (np.array(p, float), np.array(v, float)) for name, (p, v, *_) in vehicles.items()}
        settings = SoundSettings(noise_level=20.0, **({"access": access} if access else {}), **sound)
        equipment = {
            n: Equipment(ModemSettings(**EXACT | m), ClockSettings(**(c[0] if c else {})))
            for n, (_, _, m, *c) in vehicles.items()
        }
        self.modems = build_modems(
            settings, equipment, medium or Medium(), lambda name: stream(seed, 0, name), self.report, TICK
        )
        self.fates, self.heard = [], {name: [] for name in vehicles}
        self.time = 0.0

    def truth(self, name, time):
        place, velocity = self.ways[name]
        heading = 0.4
        c, s = math.cos(heading), math.sin(heading)
        body = (c * velocity[0] + s * velocity[1], -s * velocity[0] + c * velocity[1], velocity[2], 0, 0, 0)
        return Truth(
            time, place + velocity * time, np.array((1.0, 0, 0, 0)), np.array((0.0, 0.0, heading)),
            np.array(body, float), np.zeros(3), np.zeros(1),
        )  # fmt: skip

    def report(self, name, time, stamp):
        north, east, depth = self.ways[name][0] + self.ways[name][1] * time
        return StateReport(stamp, north, east, depth, *(0.0,) * 10)

    def run(self, until):
        count = round((until - self.time) / TICK)
        for k in range(1, count + 1):
            before, now = self.time + (k - 1) * TICK, self.time + k * TICK
            truths = [{name: self.truth(name, t) for name in self.ways} for t in (before, now)]
            self.fates += self.modems.advance(*truths)
            for name in self.ways:
                self.heard[name] += self.modems.deliver(name, now)
        self.time += count * TICK
        return self


STILL = (0.0, 0.0, 0.0)


def tell(period, **more):
    return {"tell": {"period": period, **more}}


def test_a_packet_is_handed_over_when_it_is_decoded():
    """Start, travel, preamble and bits, processing; by the settings of the preset."""
    fleet = Fleet({"a": ((0, 0, 20), STILL, tell(100.0, phase=2.0)), "b": ((0, 750, 20), STILL, {})}).run(6.0)
    (fate,), (delivery,) = fleet.fates, fleet.heard["b"]
    assert (fate.message.sent, fate.destination, fate.fate) == (2.0, "b", "delivered")
    assert delivery.received == fate.received == pytest.approx(2.0 + 0.5 + 0.3 + packet_bits(14) / 490.0 + 0.5)
    assert delivery.arrived == pytest.approx(2.5)
    assert delivery.range == pytest.approx(750.0)
    assert delivery.bearing is None
    assert packet_bits(14) == 32 + 14 * 16


def test_one_way_range_is_from_where_it_was_sent_to_where_it_is_heard():
    """A receiver that runs away at 15 m/s is 1 % farther when the sound has caught up with it."""
    fleet = Fleet({"a": ((0, 0, 20), STILL, tell(100.0, phase=2.0)), "b": ((600, 0, 20), (15, 0, 0), {})}).run(8.0)
    (delivery,) = fleet.heard["b"]
    assert delivery.range == pytest.approx(630.0 / (1.0 - 15.0 / 1500.0), abs=1e-6)


def test_clocks_stamp_what_is_sent_and_measured():
    """2 ms between two clocks are 3 m of range; the payload is stamped by the sender's clock, too."""
    a, b = {"offset": 0.3, "drift_ppm": 20.0}, {"offset": 0.302}
    fleet = Fleet({"a": ((0, 0, 20), STILL, tell(100.0, phase=40.0), a), "b": ((0, 750, 20), STILL, {}, b)}).run(50.0)
    (delivery,) = fleet.heard["b"]
    assert delivery.message.sent == pytest.approx(40.0, abs=1e-9) == delivery.message.payload[0]
    sent = (40.0 - 0.3) / (1.0 + 20e-6)  # when a's clock shows 40 s
    assert fleet.fates[0].message.sent == pytest.approx(sent, abs=1e-9)
    assert delivery.arrived == pytest.approx(sent + 0.5 + 0.302, abs=1e-9)
    assert delivery.range == pytest.approx(1500.0 * (sent + 0.5 + 0.302 - 40.0), abs=1e-6)


def test_noise_of_arrival_times_is_noise_of_ranges():
    """1 ms is 1.5 m; 300 ranges give the sd to 4 %."""
    fleet = Fleet(
        {"a": ((0, 0, 20), STILL, tell(2.0)), "b": ((0, 750, 20), STILL, {"timing_noise": 1e-3})}
    ).run(610.0)  # fmt: skip
    ranges = np.array([d.range for d in fleet.heard["b"]])
    assert len(ranges) > 300
    assert ranges.std() == pytest.approx(1.5, rel=4 * 0.041)
    assert ranges.mean() == pytest.approx(750.0, abs=4 * 1.5 / len(ranges) ** 0.5)


def test_another_sound_speed_than_assumed_scales_the_range():
    fleet = Fleet(
        {"a": ((0, 0, 20), STILL, tell(100.0)), "b": ((0, 750, 20), STILL, {"sound_speed": 1515.0})}
    ).run(5.0)  # fmt: skip
    assert fleet.heard["b"][0].range == pytest.approx(1.01 * 750.0)


def test_two_way_range_needs_no_common_clock():
    """The clocks differ by 7 s; a asks b, whose reply comes after its turn-around time and carries its state."""
    ask = {"ask": {"whom": "b", "period": 100.0, "phase": 1.0}}
    fleet = Fleet(
        {"a": ((0, 0, 20), STILL, ask, {"offset": -7.0}), "b": ((300, 400, 20), STILL, {"turn_around": 1.75})}
    ).run(20.0)  # fmt: skip
    assert [(f.message.kind, f.destination) for f in fleet.fates] == [("request", "b"), ("state", "a")]
    (reply,) = fleet.heard["a"]
    assert fleet.fates[0].message.sent == pytest.approx(8.0)
    assert fleet.fates[1].message.sent == pytest.approx(8.0 + 1.0 / 3.0 + 1.75)
    assert reply.range == pytest.approx(500.0, abs=1e-6)
    assert reply.message.answers == fleet.fates[0].message.sequence
    assert reply.message.payload[1:3] == (300.0, 400.0)


def test_two_way_range_of_two_that_move():
    """Closing at 5 m/s: half the way there and half the way back, of two lengths."""
    ask = {"ask": {"whom": "b", "period": 100.0, "phase": 1.0}}
    fleet = Fleet({"a": ((0, 0, 20), (2, 0, 0), ask), "b": ((900, 0, 20), (-3, 0, 0), {})}).run(20.0)
    there = (900.0 - 5.0) / 1503.0  # from a at 1 s
    begin = 1.0 + there + 2.0
    back = (900.0 - 5.0 * begin) / 1502.0
    assert fleet.heard["a"][0].range == pytest.approx(0.5 * 1500.0 * (there + back), abs=1e-6)


def test_bearing_is_in_the_axes_of_the_receiver():
    usbl = {"bearing_noise_deg": 0.0, "bearing_bias_deg": 2.0}
    fleet = Fleet({"a": ((100, -100, 40), STILL, tell(100.0)), "b": ((0, 0, 20), STILL, usbl)}).run(5.0)
    assert fleet.heard["b"][0].bearing == pytest.approx(-math.pi / 4 - 0.4 + math.radians(2.0))


@pytest.mark.parametrize("distance", [50.0, 1480.0])
def test_slots_with_their_guard_keep_packets_apart(distance):
    """Three that are as far apart as the slots allow for: nothing is lost; without slots and in phase, all is."""
    far = {"a": ((0, 0, 20), STILL), "b": ((0, distance, 20), STILL), "c": ((0, 0.5 * distance, 30), STILL)}
    vehicles = {name: (*way, tell(4.0)) for name, way in far.items()}
    duration = ModemSettings().modem.duration(packet_bits(14))
    slot = duration + 1500.0 / 1500.0 + 0.001
    found = Fleet(vehicles, access=TdmaSettings(slot=slot, reach=1500.0)).run(60.0)
    assert len(found.fates) > 40
    assert {f.fate for f in found.fates} == {"delivered"}
    free = Fleet(vehicles).run(60.0)
    assert {f.fate for f in free.fates} <= {"collision", "transmitting"}


def test_a_clock_that_is_wrong_leaves_its_slot():
    vehicles = {
        "a": ((0, 0, 20), STILL, tell(4.0)), "b": ((0, 300, 20), STILL, tell(4.0), {"offset": 1.5}),
        "c": ((0, 150, 30), STILL, {}),
    }  # fmt: skip
    found = Fleet(vehicles, access=TdmaSettings(slot=1.6, reach=1000.0)).run(60.0)
    assert "collision" in {f.fate for f in found.fates if f.destination == "c"}


def test_slots_are_given_away_once_and_in_order():
    slots = Slots(index=2, count=3, length=5.0)
    assert [slots.take(0.0), slots.take(0.0), slots.take(71.0), slots.take(70.0)] == [10.0, 25.0, 85.0, 100.0]


def test_slots_that_are_too_short_are_refused_with_what_would_do():
    with pytest.raises(InputError, match=r"slot: 1 s is too short for a packet of 'a' \(0.82 s\).*use 1.83 s"):
        Fleet({"a": ((0, 0, 20), STILL, {})}, access=TdmaSettings(slot=1.0))


def test_a_turn_around_that_is_too_short_is_refused():
    with pytest.raises(InputError, match=r"vehicles.b.modem.turn_around: 0.3 s is too short .*'a'; use"):
        Fleet({"a": ((0, 0, 20), STILL, {"ask": {"whom": "b"}}), "b": ((9, 0, 20), STILL, {"turn_around": 0.3})})


def test_who_is_asked_must_have_a_modem():
    with pytest.raises(InputError, match=r"vehicles\.a\.modem.ask.whom: no modem on 'z'; there are a"):
        Fleet({"a": ((0, 0, 20), STILL, {"ask": {"whom": "z"}})})


def test_nobody_asks_itself():
    with pytest.raises(InputError, match=r"vehicles\.a\.modem\.ask\.whom: 'a' cannot ask itself"):
        Fleet({"a": ((0, 0, 20), STILL, {"ask": {"whom": "a"}}), "b": ((9, 0, 20), STILL, {})})


@pytest.mark.parametrize("key", ["bit_rate: 0.5", "bit_rate: -80.0", "transducer: [21.0, 0.0, 0.0]"])
def test_a_modem_that_cannot_be_is_refused(key):
    """Packets would last for ever, or begin far from the vehicle."""
    name, value = key.split(": ")
    with pytest.raises(ValueError, match=name):
        ModemSettings.model_validate({name: json.loads(value)})


def test_a_master_polls_in_turn_and_nobody_else_sends():
    places = {"a": (0, 0, 20), "b": (0, 300, 20), "c": (400, 0, 20)}
    vehicles = {name: (place, STILL, tell(1.0)) for name, place in places.items()}
    fleet = Fleet(vehicles, access=PollingSettings(master="a", period=6.0)).run(60.0)
    assert {f.fate for f in fleet.fates} == {"delivered"}
    polls = [f.message for f in fleet.fates if f.message.source == "a" and f.destination == "b"]
    replies = [f.message for f in fleet.fates if f.message.source != "a"]
    assert [m.asks for m in polls] == ["b", "c"] * 5
    assert [m.source for m in replies] == ["b", "c"] * 5
    ranges = {source: {round(d.range, 6) for d in fleet.heard["a"] if d.message.source == source} for source in "bc"}
    assert ranges == {"b": {300.0}, "c": {400.0}}  # two ways
    assert all(d.message.source == "a" for d in fleet.heard["b"])  # replies are for the master


def test_a_pulse_is_followed_by_the_packet_that_tells_of_it():
    fleet = Fleet(
        {"a": ((0, 0, 20), (2, 0, 0), tell(20.0, phase=1.0, delay=15.0)), "b": ((0, 750, 20), STILL, {})}
    ).run(40.0)  # fmt: skip
    pulse, second, packet = fleet.heard["b"][0], *fleet.heard["b"][2:0:-1]
    assert (pulse.message.kind, packet.message.kind, second.message.kind) == ("pulse", "state", "pulse")
    assert pulse.message.sequence == packet.message.sequence != second.message.sequence
    assert packet.message.payload[:2] == (1.0, 2.0)  # as it was at the pulse
    assert packet.message.sent == 16.0
    assert pulse.range == pytest.approx(math.hypot(2.0, 750.0), abs=1e-6)


def test_a_missions_message_waits_until_the_modem_is_free():
    fleet = Fleet({"a": ((0, 0, 20), STILL, tell(100.0, phase=1.05)), "b": ((0, 150, 20), STILL, {})}).run(1.0)
    assert fleet.modems.post("a", Outgoing("survey", (1.0, 2.0, 3.0))) is None
    assert fleet.modems.post("a", Outgoing("survey", (), "z")).fate == "no modem"
    fleet.run(6.0)
    first, second = (f.message for f in fleet.fates)
    assert (first.kind, first.sent, second.kind) == ("state", 1.05, "survey")
    assert second.sent == pytest.approx(1.05 + ModemSettings().modem.duration(first.bits))
    assert [d.message.payload for d in fleet.heard["b"]][1] == (1.0, 2.0, 3.0)


def test_what_is_under_way_is_known():
    fleet = Fleet({"a": ((0, 0, 20), STILL, tell(100.0, phase=0.5)), "b": ((0, 1500, 20), STILL, {})}).run(1.0)
    (fate,) = fleet.modems.under_way()
    assert (fate.destination, fate.fate) == ("b", "under way")
    fleet.run(8.0)
    assert fleet.modems.under_way() == []


def test_ranges_are_between_transducers():
    """20 m ahead of the body's origin, which heads 0.4 rad, and 3 m above it."""
    modem = {"transducer": (20.0, 0.0, -3.0)}
    fleet = Fleet({"a": ((0, 0, 20), STILL, tell(100.0)), "b": ((0, 750, 20), STILL, modem)}).run(5.0)
    place = (20.0 * math.cos(0.4), 750.0 + 20.0 * math.sin(0.4), 17.0)
    assert fleet.heard["b"][0].range == pytest.approx(math.dist(place, (0.0, 0.0, 20.0)), abs=1e-6)
