"""A formation without vehicles: a follower fed by hand says whom it hears, where it goes, and why not."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvsim.acoustics.message import Delivery, Message
from auvsim.acoustics.payload import STATE, StateReport
from auvsim.missions.formation import choice
from auvsim.missions.formation.mission import ALONE, DONE, LEAVING, ON_STATION, Formation
from auvsim.missions.formation.settings import ChoiceSettings, FormationSettings
from auvsim.missions.mission import MissionSetup, Situation
from auvsim.navigation.estimate import Estimate

SPEED, COURSE = 1.2, math.radians(40.0)
AHEAD, STARBOARD = np.array([math.cos(COURSE), math.sin(COURSE)]), np.array([-math.sin(COURSE), math.cos(COURSE)])
LEADERS = {"a": (100.0, 5.0), "b": (-60.0, -80.0), "c": (-50.0, 90.0)}  # ahead, starboard [m]
SETTINGS: dict[str, Any] = {
    "north": 30.0,
    "east": -20.0,
    "course_deg": 40.0,
    "speed": SPEED,
    "leaders": ("a", "b", "c"),
}


def mission(**changes):
    settings = FormationSettings(**{**SETTINGS, **changes})
    setup = MissionSetup(
        name="follower", settings=settings, vehicle=SimpleNamespace(), heading=0.0, depth=8.0, period=1.0,  # pyright: ignore[reportArgumentType]
        holds=lambda speed: True, structures={},
    )  # fmt: skip
    return Formation(setup)


def point(time):
    return np.array([30.0, -20.0]) + SPEED * time * AHEAD


def estimate(time, ahead=0.0, starboard=0.0, current=(0.0, 0.0)):
    place = point(time) + ahead * AHEAD + starboard * STARBOARD
    velocity = np.array([SPEED, 0.0, 0.0])
    return Estimate(
        time=time, position=np.array([*place, 8.0]), heading=COURSE, velocity=velocity, current=np.array(current),
        covariance=np.eye(8), initialised=True,
    )  # fmt: skip


def word(name, time, stations=LEADERS):
    ahead, starboard = stations[name]
    place = point(time) + ahead * AHEAD + starboard * STARBOARD
    north, east = place.tolist()
    velocity = (SPEED * AHEAD).tolist()
    report = StateReport(time, north, east, 9.0, COURSE, *velocity, 0.0, 0.3, 0.0, 0.0, 0.5, 0.0, 0.01)
    return Delivery(Message(name, None, time, STATE, tuple(report)), time, 100.0)


def situation(time, names=(), stations=LEADERS, **place):
    return Situation(time, estimate(time, **place), COURSE, 8.0, None, (), [word(n, time, stations) for n in names])


def run(m, until, names, since=0.0, stations=LEADERS, every=5.0):
    """Updates with words of `names` every 5 s; events as (kind, text)."""
    found = []
    for time in np.arange(since, until, every):
        m.update(situation(float(time), names, stations))
        found += [(e.kind, e.text) for e in m.events]
        m.events.clear()
    return found


def test_on_station_it_goes_with_the_point():
    m = mission(leaders=())
    wanted = m.update(situation(10.0))
    assert (wanted.heading, wanted.speed) == pytest.approx((COURSE, SPEED))
    assert m.phase == ON_STATION
    assert m.row()[2] == pytest.approx(point(10.0))


def test_behind_it_is_faster_and_to_starboard_it_turns_to_port():
    behind, right = mission(leaders=()), mission(leaders=())
    assert behind.update(situation(10.0, ahead=-2.0)).speed == pytest.approx(SPEED + 0.2)
    assert behind.row()[3:5] == pytest.approx((-2.0, 0.0), abs=1e-9)
    far = mission(leaders=()).update(situation(10.0, ahead=-80.0))
    assert far.speed == pytest.approx(SPEED + 0.5)  # no more than the margin
    wanted = right.update(situation(10.0, starboard=20.0))
    assert wanted.heading == pytest.approx(COURSE - math.pi / 4.0)
    # Along the course it keeps up with the point: only its way across is on top.
    assert wanted.speed * math.cos(math.pi / 4.0) == pytest.approx(SPEED)


@pytest.mark.parametrize("known", [True, False])
def test_a_current_is_steered_against_whoever_knows_it(known):
    """As a state of its own, or only as part of the velocity over ground: in two minutes it is made up for."""
    m, current = mission(leaders=()), 0.25 * STARBOARD + 0.15 * AHEAD
    heading, speed = COURSE, SPEED
    for k in range(120):
        own = np.array([speed, 0.0])
        c, s = math.cos(heading), math.sin(heading)
        flow = np.array([c * current[0] + s * current[1], -s * current[0] + c * current[1]])  # in body axes
        e = Estimate(
            time=float(k), position=np.array([*point(float(k)), 8.0]), heading=heading,
            velocity=np.array([*(own if known else own + flow), 0.0]), current=current if known else np.zeros(2),
            covariance=np.eye(8), initialised=True,
        )  # fmt: skip
        wanted = m.update(Situation(float(k), e, heading, 8.0, None, (), ()))
        heading, speed = wanted.heading, wanted.speed
    through = speed * np.array([math.cos(heading), math.sin(heading)])
    assert through + current == pytest.approx(SPEED * AHEAD, abs=2e-3)


def test_a_follower_goes_on_with_two_and_says_so():
    m = mission()
    first = run(m, 60.0, ("a", "b", "c"))
    assert [text for kind, text in first if kind == "heard"] == ["a is heard", "b is heard", "c is heard"]
    assert m.row()[5] == 3
    with_three = m.row()[6]
    then = run(m, 140.0, ("a", "c"), since=60.0)
    assert ("silent", "b is not heard for 40 s") in then
    assert any(kind == "goes_on" and "with a, c" in text for kind, text in then)
    assert m.phase == ON_STATION
    assert m.row()[6] > with_three
    again = run(m, 180.0, ("a", "b", "c"), since=140.0)
    assert ("heard", "b is heard") in again


def test_with_one_leader_it_says_why_it_cannot_and_comes_back():
    m = mission()
    run(m, 60.0, ("a", "b", "c"))
    then = run(m, 140.0, ("a",), since=60.0)
    assert m.phase == ALONE
    assert any("1 leader heard, two are needed" in text for _, text in then)
    assert math.isinf(m.row()[6])
    back = run(m, 180.0, ("a", "b"), since=140.0)
    assert m.phase == ON_STATION
    assert any("goes on with a, b" in text for _, text in back)


def test_it_chooses_the_station_of_the_least_bound():
    """On the leaders' line there is no bound; within reach there is one, which it takes and keeps."""
    line = {"a": (100.0, 0.0), "b": (-80.0, 0.0), "c": (60.0, 0.0)}
    m = mission(follow={"reach": 50.0})
    found = run(m, 60.0, ("a", "b", "c"), stations=line)
    moves = [text for kind, text in found if kind == "station"]
    assert len(moves) == 1
    assert "instead of none" in moves[0]
    ahead, starboard = m.row()[:2]
    assert abs(starboard) > 25.0
    assert math.hypot(ahead, starboard) <= 50.0 + 1e-9
    kept = mission()
    run(kept, 60.0, ("a", "b", "c"), stations=line)
    assert tuple(kept.row()[:2]) == (0.0, 0.0)
    assert math.isinf(kept.row()[6])


def test_leaders_are_where_their_words_say_they_have_gone():
    heard: dict[str, choice.Heard] = {}
    choice.listen(heard, ("a", "b"), [word("a", 10.0), word("b", 14.0), word("c", 14.0)])
    assert sorted(heard) == ["a", "b"]
    places = choice.stations(choice.present(heard, 30.0, 18.0), point(30.0), SPEED * AHEAD, 30.0)
    np.testing.assert_allclose(places, [LEADERS["b"]], atol=1e-9)  # a is silent for 20 s
    sigma = choice.deviations(heard, ChoiceSettings(range_noise=2.0))
    assert sigma == pytest.approx(math.sqrt(4.0 + 0.4))


def test_a_leader_leaves_to_starboard_and_the_formation_ends():
    m = mission(leaders=(), leaves=20.0, lasts=40.0)
    assert m.update(situation(10.0)).heading == pytest.approx(COURSE)
    assert m.update(situation(25.0)).heading == pytest.approx(COURSE + math.pi / 2.0)
    assert m.phase == LEAVING
    assert m.update(situation(45.0)).speed == 0.0
    assert m.phase == DONE
    assert m.finished
