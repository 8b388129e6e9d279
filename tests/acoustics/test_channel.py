"""The shared channel: arrival while both move, overlaps, capture, half duplex, losses with range, independent links."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, norm
from still_water import LOUD, Water, fates, packet, still

from auvsim.acoustics.channel import ChannelSettings
from auvsim.acoustics.medium import Medium
from auvsim.acoustics.propagation import noise_density, packet_success, transmission_loss

C = 1500.0


def test_both_wave_fronts_arrive_where_the_receiver_is_then():
    """Straight ways: the arrival solves a quadratic, and the packet is as long as Doppler makes it."""
    v, w = np.array((3.0, 0.0, 0.0)), np.array((-6.0, 2.0, 0.0))
    p0, q0 = np.array((0.0, 0.0, 40.0)), np.array((1200.0, 300.0, 80.0))
    water = Water({"a": lambda t: p0 + v * t, "b": lambda t: q0 + w * t})
    (decided,) = water.run([packet("a", 0.73, bits=1000)], until=6.0)
    arrival = decided.arrival

    def arrives(sent):
        """Root of |q0 + w t - p(sent)|^2 = c^2 (t - sent)^2."""
        away = q0 - (p0 + v * sent)
        roots = np.roots([w @ w - C**2, 2.0 * (away @ w + C**2 * sent), away @ away - (C * sent) ** 2]).real
        return min(r for r in roots if r > sent)

    assert decided.fate == "delivered"
    assert arrival.front == pytest.approx(arrives(0.73), abs=1e-9)
    assert arrival.tail == pytest.approx(arrives(2.73), abs=1e-9)
    assert (arrival.tail - arrival.front) / 2.0 == pytest.approx(1.0 - 8.3 / C, abs=5e-4)  # closing at about 8.3 m/s


def test_a_wave_front_is_looked_for_at_every_distance():
    """From 1 m, within a tick, to 60 km."""
    for distance in (1.0, 149.0, 151.0, 60_000.0):
        medium = Medium(C)
        water = Water({"a": still(0.0), "b": still(distance)}, medium=medium, modem=replace(LOUD, source_level=1000.0))
        (decided,) = water.run([packet("a", 0.05)], until=50.0)
        assert decided.arrival.front == pytest.approx(0.05 + distance / C, abs=1e-9)


def test_two_equal_packets_that_overlap_both_die():
    """At the same distance and level; the later one begins 1 ms before the first has ended, or 1 ms after."""
    places = {"a": still(-300.0), "b": still(300.0), "c": still(0.0)}
    duration = 0.5
    for gap, fate in ((0.0, "collision"), (0.3, "collision"), (0.499, "collision"), (0.501, "delivered")):
        found = fates(Water(places).run([packet("a", 1.0), packet("b", 1.0 + gap)], until=4.0))
        assert found["a", "c", 0] == found["b", "c", 0] == fate, gap
    assert LOUD.duration(250) == duration


def test_the_stronger_of_two_survives_by_the_capture_ratio():
    near, far = 100.0, 700.0
    difference = transmission_loss(far, 25e3) - transmission_loss(near, 25e3)
    places = {"a": still(-near), "b": still(far), "c": still(0.0)}
    messages = [packet("a", 1.4), packet("b", 1.0)]  # both are at c from 1.467 s
    for capture, fate in ((difference - 0.01, "delivered"), (difference + 0.01, "collision")):
        found = fates(
            Water(places, settings=ChannelSettings(noise_level=0.0, capture=capture)).run(messages, until=4.0)
        )
        assert found["a", "c", 0] == fate
        assert found["b", "c", 0] == "collision"


def test_interference_adds_up():
    """Two equal packets under a stronger one: 3 dB more than one of them."""
    difference = transmission_loss(700.0, 25e3) - transmission_loss(100.0, 25e3)
    places = {"a": still(-100.0), "b": still(700.0), "c": still(0.0), "d": still(0.0, 700.0)}
    messages = [packet("a", 1.4), packet("b", 1.0), packet("d", 1.0)]
    for capture, fate in ((difference - 3.02, "delivered"), (difference - 3.0, "collision")):
        found = fates(
            Water(places, settings=ChannelSettings(noise_level=0.0, capture=capture)).run(messages, until=4.0)
        )
        assert found["a", "c", 0] == fate


def test_who_sends_hears_nothing():
    """The packet of a is at b from 1.2 to 1.7 s; what b sends ends before, overlaps, or begins after."""
    places = {"a": still(0.0), "b": still(300.0)}
    for start, fate in ((0.69, "delivered"), (0.71, "transmitting"), (1.69, "transmitting"), (1.71, "delivered")):
        found = fates(Water(places).run([packet("a", 1.0), packet("b", start)], until=4.0))
        assert found["a", "b", 0] == fate, start


def test_an_addressed_packet_disturbs_all_the_same():
    places = {"a": still(-300.0), "b": still(300.0), "c": still(0.0)}
    found = fates(Water(places).run([packet("a", 1.0, destination="b"), packet("b", 1.0, destination="c")], until=4.0))
    assert found["b", "c", 0] == "collision"


def test_other_bands_neither_hear_nor_disturb():
    other = replace(LOUD, frequency=12e3)
    places = {"a": still(-300.0), "b": still(300.0), "c": still(0.0)}
    water = Water(places, modems={"a": LOUD, "b": other, "c": LOUD})
    found = fates(water.run([packet("a", 1.0), packet("b", 1.0)], until=4.0))
    assert found["a", "c", 0] == "delivered"
    assert found["b", "c", 0] == found["a", "b", 0] == "other band"


def test_no_path_is_a_loss():
    water = Water({"a": still(0.0, depth=5.0), "b": still(800.0, depth=5.0)}, medium=Medium(1500.0, -0.5))
    (decided,) = water.run([packet("a", 0.5)], until=1.0)
    assert decided.fate == "no path"
    assert not water.channel.busy


def test_loss_with_range_follows_the_closed_form():
    """Shares of 400 packets at three distances about the brink, within four standard deviations of the binomial."""
    modem = replace(LOUD, source_level=165.0, coding_gain=0.0)
    settings = ChannelSettings(wind=8.0, shipping=0.2, dropout_probability=0.1)
    shares, expected = [], []
    for distance in (4650.0, 4830.0, 5000.0):
        water = Water({"a": still(0.0), "b": still(distance)}, settings=settings, modem=modem)
        decided = water.run([packet("a", 0.55 * k, sequence=k) for k in range(1, 401)], until=230.0)
        shares.append(np.mean([d.fate == "delivered" for d in decided]))
        snr = 165.0 - transmission_loss(distance, 25e3) - noise_density(25e3, 8.0, 0.2) - 10.0 * math.log10(5e3)
        expected.append(0.9 * packet_success(snr, 250, 5e3, 500.0))
        assert settings.success(modem, distance, 250) == pytest.approx(expected[-1])
        assert {d.fate for d in decided} <= {"delivered", "noise", "dropped"}
    assert expected[0] > 0.8 > expected[1] > 0.2 > expected[2]
    assert shares == pytest.approx(expected, abs=4.0 * math.sqrt(0.25 / 400))


def test_fading_spreads_the_level():
    settings = ChannelSettings(noise_level=0.0, fading=4.0)
    water = Water({"a": still(0.0), "b": still(200.0)}, settings=settings)
    decided = water.run([packet("a", 0.55 * k) for k in range(1, 401)], until=230.0)
    levels = np.array([d.arrival.level for d in decided]) - settings.received_level(LOUD, 200.0)
    assert levels.std() == pytest.approx(4.0, rel=4 / math.sqrt(800))


def test_links_draw_independently():
    """10 000 draws of each link with one seed: no link's losses say anything of another's, nor of its own before."""
    names = ("a", "b", "c")
    places = {name: still(100.0 * k) for k, name in enumerate(names)}
    water = Water(places, settings=ChannelSettings(noise_level=0.0, dropout_probability=0.3))
    links = list(itertools.permutations(names, 2))
    noises = [water.channel._links[link] for link in links]
    lost = np.array([[noise.uniforms(3)[0] < 0.3 for noise in noises] for _ in range(10_000)])
    n = len(lost)
    limit = norm.isf(1e-5 / 2)
    assert np.abs(lost.mean(axis=0) - 0.3).max() < limit * math.sqrt(0.21 / n)
    statistic = 0.0
    for i, j in itertools.combinations(range(len(links)), 2):
        statistic += n * np.corrcoef(lost[:, i], lost[:, j])[0, 1] ** 2
    assert statistic < chi2.isf(1e-5, 15)
    later = sum(n * np.corrcoef(lost[:-1, i], lost[1:, j])[0, 1] ** 2 for i in range(6) for j in range(6))
    assert later < chi2.isf(1e-5, 36)


def test_a_packet_more_changes_no_other_fate():
    """Another sender takes no draws of the link from a to b."""
    settings = ChannelSettings(noise_level=0.0, dropout_probability=0.4, capture=0.0)
    alone = Water({"a": still(0.0), "b": still(200.0)}, settings=settings)
    packets = [packet("a", 1.0 * k, sequence=k) for k in range(1, 60)]
    with_c = Water({"a": still(0.0), "b": still(200.0), "c": still(90_000.0)}, settings=settings)
    more = [packet("c", 0.5 + 1.0 * k, sequence=k) for k in range(1, 60)]
    first, second = fates(alone.run(packets, until=62.0)), fates(with_c.run(packets + more, until=62.0))
    assert {key: second[key] for key in first} == first
    assert 0 < sum(fate == "dropped" for fate in first.values()) < 59


@pytest.mark.parametrize("load", [0.3, 1.0])
def test_throughput_of_pure_aloha(load):
    """The short form, within four standard deviations: some 1300 or 400 of 3000 packets survive, good to 2 and 5 %."""
    assert _throughput(load, 3_000) == pytest.approx(load * math.exp(-2.0 * load), rel=0.08 if load < 0.5 else 0.2)


@pytest.mark.slow
@pytest.mark.parametrize("load", [0.1, 0.5, 1.0])
def test_throughput_of_pure_aloha_closely(load):
    """G exp(-2 G) within 3 %: 60 000 packets, of which 8000 survive at the least, good to 1.1 %."""
    assert _throughput(load, 60_000) == pytest.approx(load * math.exp(-2.0 * load), rel=0.03)


def _throughput(load, packets):
    """Share of time in which one receiver receives whole packets that 20 senders send at Poisson times.

    The senders work in narrow bands beside each other, and hear each other not; the receiver hears all.
    """
    rng = np.random.default_rng(7)
    duration = LOUD.duration(250)
    times = np.cumsum(rng.exponential(duration / load, packets))
    names = [f"s{k}" for k in range(20)]
    places = {n: still(50.0 * math.cos(k), 50.0 * math.sin(k)) for k, n in enumerate(names)} | {"sink": still(0.0)}
    modems = {n: replace(LOUD, frequency=20e3 + 100.0 * k, bandwidth=50.0) for k, n in enumerate(names)}
    water = Water(places, modems=modems | {"sink": replace(LOUD, frequency=21e3, bandwidth=5e3)})
    free, messages = dict.fromkeys(names, -1.0), []
    for time in times.tolist():  # who still sends gives the packet to another: the population is large
        name = next(n for n in rng.permutation(names).tolist() if free[n] <= time)
        free[name] = time + duration
        messages.append(packet(name, time))
    decided = water.run(messages, until=times[-1] + 5.0)
    survived = sum(d.fate == "delivered" for d in decided if d.arrival.receiver == "sink")
    return survived * duration / times[-1]
