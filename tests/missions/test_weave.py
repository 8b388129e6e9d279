"""The weave on an approach: its shape, its foretold bound against batch least squares, its least amplitude."""

import math

import numpy as np
import pytest
from dockings import DOCK_DEPTH, NOSE, new, update

from auvsim.acoustics.link import AcousticSettings
from auvsim.acoustics.usbl import UsblSettings
from auvsim.base.reading import Reading
from auvsim.missions.docking.guidance import DockingSettings, Phase
from auvsim.missions.docking.weave import CURRENT_WALK, Leg, Weave, least_weave, miss_deviation, prior_of
from auvsim.missions.fixes import FixSource, fix_sources
from auvsim.navigation.estimate import COMPASS_BIAS, PLANAR_STATES, Estimate
from auvsim.sensors.range import RangeSettings
from estimators.docking.noise import DockingNoise

LEG = Leg(0.3, 0.25, (40.0, -25.0, 20.0), -190.0, -20.0, 1.1, (0.1, -0.15), 7.0)
AHEAD = FixSource((60.0, -20.0, 33.0), 4.0, lambda d: 0.1)
ASIDE = FixSource((-90.0, 70.0, 38.0), 7.0, lambda d: 0.25)
USBL = FixSource((40.0, -25.0, 19.0), 12.3, lambda d: 0.02 + 0.002 * d, bearing=True)
STATES = [0, 1, 2, 3, 8]  # of an odometer: place, current, and what the compass shows too much
WEAVE = Weave(9.0, -190.0, -34.0)


def prior() -> np.ndarray:
    """A lopsided covariance of place, current and compass bias."""
    root = np.diag([1.5, 2.0, 0.04, 0.06, 0.02])
    root[1, 0], root[2, 0], root[2, 1], root[3, 1], root[3, 2], root[4, 1] = 0.4, 0.02, -0.01, 0.05, 0.01, 0.01
    found = np.zeros((9, 9))
    found[np.ix_(STATES, STATES)] = root @ root.T
    return found


def way(leg: Leg, weave: Weave, pieces: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Times and places of the way up to the lookahead before the mouth, by small pieces of dead reckoning."""
    x = np.linspace(leg.begin, -leg.lookahead, pieces)
    t = np.clip((x - weave.begin) / (weave.end - weave.begin), 0.0, 1.0) * math.pi
    y = weave.amplitude * np.sin(2.0 * t) * np.sin(t) / np.max(np.sin(2.0 * t) * np.sin(t))
    c, s = math.cos(leg.line), math.sin(leg.line)
    places = np.array(leg.mouth[:2]) + np.column_stack((x * c - y * s, x * s + y * c))
    step = np.diff(places, axis=0)
    length = np.linalg.norm(step, axis=1)
    ahead, current = step / length[:, None], np.array(leg.current)
    along = ahead @ current
    speed = along + np.sqrt(
        leg.speed**2 - current @ current + along**2
    )  # |ahead speed - current| = speed through water
    return np.concatenate(([0.0], np.cumsum(length / speed))), places


def by_least_squares(leg: Leg, weave: Weave, sources: list[FixSource], covariance: np.ndarray) -> float:
    """Deviation of the miss, of one problem in which place, current and compass bias at every sight are unknown."""
    times, places = way(leg, weave)
    stamps = [(t, s) for s in sources for t in np.arange(times[-1] - 0.5 * s.interval, 0.0, -s.interval)]
    stamps = [(0.0, None), *sorted(stamps, key=lambda pair: pair[0]), (times[-1], None)]
    at = np.stack([np.interp([t for t, _ in stamps], times, column) for column in places.T], axis=1)
    n = 5
    information = np.zeros((n * len(stamps),) * 2)
    information[:n, :n] = np.linalg.inv(covariance[np.ix_(STATES, STATES)])
    for k, (t, source) in enumerate(stamps):
        if k:
            dt = t - stamps[k - 1][0]
            north, east = at[k] - at[k - 1] - dt * np.array(leg.current)  # through the water
            F = np.eye(n)
            F[0, 2] = F[1, 3] = dt
            F[0, 4], F[1, 4] = east, -north  # turned to port by what the compass shows too much
            D = np.zeros((n, n * len(stamps)))
            D[:, n * k : n * k + n], D[:, n * k - n : n * k] = np.eye(n), -F
            q, p = CURRENT_WALK, DockingNoise().position
            Q = np.eye(n) * 1e-14  # a compass bias is constant
            Q[:4, :4] = np.kron(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]) * q, np.eye(2))
            Q[0, 0] += p * dt
            Q[1, 1] += p * dt
            information += D.T @ np.linalg.inv(Q) @ D
        if source is not None:
            away = np.array([*at[k], leg.mouth[2]]) - np.array(source.place)
            distance, level = np.linalg.norm(away), np.linalg.norm(away[:2])
            ahead, aside = away[:2] / distance, np.array([-away[1], away[0]]) / level
            rows = [ahead, aside] if source.bearing else [ahead]
            for row in rows:
                h = np.zeros(n * len(stamps))
                h[n * k : n * k + 2] = row
                information += np.outer(h, h) / source.deviation(distance) ** 2
    last = np.linalg.inv(information)[-n:, -n:]
    a = np.array([-math.sin(leg.axis), math.cos(leg.axis)])
    a = np.array([*a, *(a * leg.lookahead / leg.speed), 0.0])
    return math.sqrt(a @ last @ a)


@pytest.mark.parametrize(
    "sources", [[AHEAD], [AHEAD, ASIDE], [USBL], [AHEAD, USBL]], ids=["ahead", "two", "usbl", "all"]
)
@pytest.mark.parametrize("weave", [WEAVE, WEAVE._replace(amplitude=0.0)], ids=["weave", "straight"])
def test_the_foretold_deviation_is_that_of_a_batch_problem(sources, weave):
    # Within 0.5 %: the way is planned in pieces of 2 m, which moves a sight by centimetres.
    found = miss_deviation(LEG, weave, sources, prior())
    assert found == pytest.approx(by_least_squares(LEG, weave, sources, prior()), rel=5e-3)


def test_nothing_is_heard_beyond_reach_or_where_all_is_lost():
    deaf = [AHEAD._replace(maximum=10.0), ASIDE._replace(interval=math.inf)]
    assert miss_deviation(LEG, WEAVE, deaf, prior()) == pytest.approx(miss_deviation(LEG, WEAVE, [], prior()))
    near = AHEAD._replace(maximum=100.0)  # heard on a part of the way
    part, whole = (miss_deviation(LEG, WEAVE, [one], prior()) for one in (near, AHEAD))
    assert whole < part < miss_deviation(LEG, WEAVE, [], prior())


def test_a_weave_swings_to_both_sides_and_ends_along_the_line():
    x = np.linspace(WEAVE.begin, WEAVE.end, 20_001)
    y, slope = np.array([WEAVE.at(one) for one in x.tolist()]).T
    assert (y.max(), y.min()) == pytest.approx((9.0, -9.0), abs=1e-4)
    assert np.argmax(y) < np.argmin(y)  # to starboard first
    assert slope[1:-1] == pytest.approx(np.gradient(y, x)[1:-1], abs=1e-5)
    assert (y[[0, -1]], slope[[0, -1]]) == (pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))
    assert WEAVE.at(-191.0) == WEAVE.at(-33.0) == (0.0, 0.0)


def least(noise: float) -> float:
    """The amplitude for two beacons ahead, of which one lies a little beside the line."""
    beacons = [AHEAD._replace(deviation=lambda d: noise, place=place) for place in (AHEAD.place, (90.0, -8.0, 30.0))]
    known = prior()
    known[8], known[:, 8] = 0.0, 0.0  # the compass is right
    return least_weave(LEG, 16.0, 1.6, lambda weave: miss_deviation(LEG, weave, beacons, known)).amplitude


def test_the_least_weave_that_suffices_is_flown():
    amplitudes = [least(noise) for noise in (0.03, 0.14, 0.17, 0.18, 0.19, 0.2, 0.3)]
    assert amplitudes[0] == 0.0  # straight suffices
    assert amplitudes == sorted(amplitudes)  # the noisier, the wider
    assert len(set(amplitudes)) > 3


def test_a_straight_line_where_a_weave_gains_nothing():
    def foretold(weave):
        return miss_deviation(LEG, weave, [USBL._replace(deviation=lambda d: 3.0)], prior())

    assert foretold(WEAVE) > 0.1  # not enough
    assert least_weave(LEG, 16.0, 0.1, foretold).amplitude == 0.0
    short = LEG._replace(begin=-90.0)  # no way on which to weave
    assert least_weave(short, 16.0, 0.01, lambda weave: 10.0 - weave.amplitude).amplitude == 0.0


def test_no_weave_is_steeper_than_line_of_sight_can_follow():
    weave = least_weave(LEG, 1000.0, 0.0, lambda weave: 1.0 / (1.0 + weave.amplitude))
    x = np.linspace(weave.begin, weave.end, 2001).tolist()
    assert max(abs(weave.at(one)[1]) for one in x) == pytest.approx(0.8, abs=1e-6)


def test_the_prior_is_what_the_estimate_says_of_the_same_states():
    names = (*PLANAR_STATES, COMPASS_BIAS)
    root = np.random.default_rng(3).normal(size=(9, 9))
    one = Estimate(
        time=0.0, position=np.zeros(3), heading=0.0, velocity=np.zeros(3), current=np.zeros(2),
        covariance=root @ root.T, initialised=True, mean=np.zeros(9), names=names,
    )  # fmt: skip
    P, found = one.covariance, prior_of(one)
    assert found[0, 1] == P[0, 1]
    assert found[1, 3] == P[1, 7]  # east, and the current to the east
    assert found[8, 8] == P[8, 8]
    assert found[8, 2] == P[8, 6]
    assert not found[4:8].any()


def test_sources_are_those_of_the_settings():
    a = RangeSettings(rate=0.5, noise=0.3, dropout_probability=0.2, beacon=(1.0, 2.0, 3.0), maximum=90.0)
    usbl, link = UsblSettings(interval=6.0, noise_scale=2.0), AcousticSettings(dropout_probability=0.4)
    ranged, fixed = fix_sources([object(), a], (usbl, (4.0, 5.0, 6.0)), link)
    assert (ranged.place, ranged.interval, ranged.maximum, ranged.bearing) == ((1.0, 2.0, 3.0), 2.5, 90.0, False)
    assert (fixed.place, fixed.interval, fixed.maximum, fixed.bearing) == ((4.0, 5.0, 6.0), 10.0, math.inf, True)
    assert (ranged.mount, fixed.mount) == ((0.0, 0.0, 0.0), usbl.transceiver)
    assert (ranged.deviation(50.0), fixed.deviation(100.0)) == (0.3, pytest.approx(2.0 * 0.339))
    assert len(fix_sources([a], None, link)) == 1
    (never,) = fix_sources([], (usbl, (0.0, 0.0, 0.0)), AcousticSettings(dropout_probability=1.0))
    assert never.interval == math.inf


def approaching(weave: float, sources: list[FixSource]) -> tuple[list[str], list[float]]:
    """Kinds of the events of a docking along north, and its headings on the line, 40 and 110 m after the gate."""
    guidance = new(DockingSettings(weave=weave), sources=sources)
    headings = []
    for time, north in ((1.0, -280.0), (2.0, -190.0), (3.0, -150.0), (4.0, -80.0)):
        guidance._observe([Reading("usbl", time, time, np.array([50.0, 1.0, 2.0, 0.0, 0.0, 0.0, DOCK_DEPTH]))])
        here = Estimate(
            time=time, position=np.array([north - NOSE, 0.0, DOCK_DEPTH]), heading=0.0,
            velocity=np.array([1.0, 0.0, 0.0]), current=np.zeros(2),
            covariance=np.diag([4.0, 4.0, 0.0, 0.0, 0.0, 0.0, 1e-4, 1e-4]), initialised=True,
        )  # fmt: skip
        headings.append(update(guidance, time, here, 0.0, DOCK_DEPTH).heading)
    assert guidance.phase == Phase.APPROACH
    return [event.kind for event in guidance.events], headings[2:]


def test_guidance_weaves_only_where_it_may_and_needs_to():
    ahead = [FixSource((50.0, 0.0, DOCK_DEPTH), 1.0, lambda d: 0.1)]
    aside = [*ahead, FixSource((-60.0, 60.0, DOCK_DEPTH), 1.0, lambda d: 0.1)]
    straight = ["homing", "approach"]
    for may, sources in ((0.0, ahead), (20.0, aside)):
        kinds, headings = approaching(may, sources)
        assert (kinds, headings) == (straight, [pytest.approx(0.0, abs=1e-12)] * 2)
    kinds, (out, back) = approaching(20.0, ahead)
    assert kinds == [*straight, "weave"]
    assert out > 0.5  # on the axis, 40 m after the gate, the weave is to starboard
    assert back < -0.5  # and to port farther on
