"""Tracks: waypoints of the patterns, line of sight on hand-made estimates, and what a log is judged by."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvsim.analysis.summary import summarise
from auvsim.missions.mission import MissionSetup, Situation
from auvsim.missions.track.mission import DONE, SEARCH, UNDER_WAY, Track, TrackSettings
from auvsim.missions.track.patterns import Circle, LawnMower, Waypoints, Weave, heading, points
from auvsim.navigation.estimate import Estimate
from auvsim.simulation import scenario
from auvsim.simulation.run import run


def track(**settings: Any) -> Track:
    """A track of a vehicle that starts heading 0.7 rad."""
    setup = MissionSetup(
        name="auv", settings=TrackSettings(**settings), vehicle=SimpleNamespace(), heading=0.7, depth=5.0, period=0.1,
        holds=lambda speed: True, structures={},
    )  # fmt: skip
    return Track(setup)


def situation(
    time: float, north: float, east: float, heading: float = 0.0, current=(0.0, 0.0), known=True
) -> Situation:
    """What a vehicle at a place knows."""
    estimate = Estimate(
        time=time, position=np.array([north, east, 10.0]), heading=heading, velocity=np.array([1.5, 0.0, 0.0]),
        current=np.array(current), covariance=np.zeros((8, 8)), initialised=known,
    )  # fmt: skip
    return Situation(time, estimate, heading, 10.0, None, (), ())


@pytest.mark.parametrize("heading_deg", [0.0, 37.0, -120.0])
@pytest.mark.parametrize("side", ["starboard", "port"])
def test_lanes_are_parallel_and_alternate(heading_deg: float, side: Any) -> None:
    """Their ends, turned back to north: up the first, across to the side asked for, down the next."""
    pattern = LawnMower(corner=(5.0, -3.0), heading_deg=heading_deg, length=80.0, spacing=20.0, lanes=3, side=side)
    angle = math.radians(heading_deg)
    back = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    sign = 1.0 if side == "starboard" else -1.0
    expected = [(0, 0), (80, 0), (80, 20 * sign), (0, 20 * sign), (0, 40 * sign), (80, 40 * sign)]
    np.testing.assert_allclose((points(pattern) - (5.0, -3.0)) @ back.T, expected, atol=1e-12)


def test_phases_of_a_track() -> None:
    """It holds its heading until it knows where it is, goes from point to point, and stops at the last."""
    mission = track(pattern=Waypoints(points=((50.0, 0.0), (50.0, 80.0))), depth=7.0, speed=1.2)
    assert mission.update(situation(1.0, 0.0, 0.0, known=False))[:3] == (0.7, 7.0, 1.2)
    assert mission.phase == SEARCH
    setpoints = mission.update(situation(2.0, 0.0, 0.0))
    assert mission.phase == UNDER_WAY
    assert setpoints[:3] == pytest.approx((0.0, 7.0, 1.2))
    assert mission.update(situation(30.0, 41.0, 0.0)).heading == pytest.approx(math.pi / 2, abs=0.6)
    assert mission.waypoint == 1
    assert mission.update(situation(60.0, 50.0, 40.0)).heading == pytest.approx(math.pi / 2)
    mission.update(situation(90.0, 50.0, 75.0))
    assert (mission.phase, mission.finished) == (DONE, True)
    assert mission.update(situation(91.0, 50.0, 76.0)).speed == 0.0
    assert [event.kind for event in mission.events] == ["under_way", "waypoint", "waypoint", "done"]


@pytest.mark.parametrize("current", [(0.0, 0.0), (0.2, -0.4)])
@pytest.mark.parametrize("cross", [6.0, -6.0, 0.0])
def test_the_course_over_ground_leads_to_the_leg(cross: float, current: tuple[float, float]) -> None:
    """By the vector sum of speed through the water and current: at a lookahead ahead on the leg."""
    mission = track(pattern=Waypoints(points=((0.0, 200.0),)), speed=1.5, lookahead=15.0)
    mission.update(situation(0.0, 0.0, 0.0, current=current))  # the leg begins at the origin and leads east
    heading = mission.update(situation(10.0, -cross, 60.0, current=current)).heading  # starboard of it is south
    ground = np.array([1.5 * math.cos(heading) + current[0], 1.5 * math.sin(heading) + current[1]])
    np.testing.assert_allclose(
        ground / np.linalg.norm(ground), np.array([cross, 15.0]) / math.hypot(cross, 15.0), atol=1e-9
    )
    assert mission.cross == pytest.approx(cross)


def test_a_waypoint_that_is_passed_abeam_counts() -> None:
    """Farther off than the radius, beyond the end of the leg: the next leg begins."""
    mission = track(pattern=Waypoints(points=((50.0, 0.0), (50.0, 90.0))), radius=5.0)
    mission.update(situation(0.0, 0.0, 0.0))
    mission.update(situation(40.0, 49.0, 12.0))
    assert mission.waypoint == 0
    mission.update(situation(41.0, 50.5, 12.0))
    assert mission.waypoint == 1


@pytest.fixture(scope="module")
def sailed():
    """Two lanes near a dock whose USBL serves, in a current."""
    values = {
        "duration": 260.0,
        "structures": {"d": {"north": 30.0, "east": 100.0, "heading_deg": 50.0}},
        "water": {"current": {"kind": "uniform", "speed": 0.2, "direction_deg": 120.0}},
        "vehicles": {
            "auv": {
                "start": {"north": 0.0, "east": 0.0, "heading_deg": 0.0, "depth": 12.0, "speed": 1.5},
                "mission": {
                    "kind": "track",
                    "pattern": {
                        "kind": "lawn_mower",
                        "corner": [10.0, 5.0],
                        "length": 90.0,
                        "spacing": 45.0,
                        "lanes": 2,
                    },
                    "depth": 12.0,
                },
            }
        },
    }
    return run(scenario.parse(values), seed=3).vehicle()


def test_metrics_are_those_of_the_truth(sailed) -> None:
    """Cross track by hand: from the lanes' own coordinates, in the time between their ends."""
    found = summarise(sailed)
    assert (found["finished"], found["waypoints"]) == (True, 4)
    events, truth = sailed["event"], sailed["truth"]
    ends = events["time"][events["kind"] == "waypoint"]
    inside = lambda a, b: (truth["time"] > a) & (truth["time"] <= b)  # noqa: E731
    north, east = truth["position"][:, 0], truth["position"][:, 1]
    off = [east[inside(*ends[:2])] - 5.0, north[inside(*ends[1:3])] - 100.0, east[inside(*ends[2:4])] - 50.0]
    # A mission decides ten times a second: which of two legs a sample at a corner is counted to may differ.
    assert found["cross_track_rms"] == pytest.approx(math.sqrt(np.mean(np.concatenate(off) ** 2)), rel=0.02)
    straight = inside(ends[0] + 25.0, ends[1])
    assert np.sqrt(np.mean((east[straight] - 5.0) ** 2)) < 2.0  # on a lane, against 0.2 m/s across it


def test_cross_track_of_an_oblique_leg() -> None:
    """The truth's distance from its projection onto the leg, which lies along neither axis."""
    begin, end = np.array([15.0, 10.0]), np.array([55.0, 110.0])
    values = {
        "duration": 120.0,
        "structures": {"d": {"north": 200.0}},
        "water": {"current": {"kind": "uniform", "speed": 0.3, "direction_deg": 150.0}},
        "vehicles": {
            "auv": {
                "start": {"north": 0.0, "east": 0.0, "heading_deg": 40.0, "depth": 12.0, "speed": 1.5},
                "mission": {
                    "kind": "track",
                    "pattern": {"kind": "waypoints", "points": [begin.tolist(), end.tolist()]},
                    "depth": 12.0,
                },
            }
        },
    }
    log = run(scenario.parse(values), seed=5).vehicle()
    first, last = log["event"]["time"][log["event"]["kind"] == "waypoint"]
    truth = log["truth"]
    part = (truth["time"] > first) & (truth["time"] <= last)
    along = (end - begin) / np.linalg.norm(end - begin)
    off = truth["position"][part, :2] - begin
    rms = math.sqrt(np.mean(np.sum((off - np.outer(off @ along, along)) ** 2, axis=1)))
    # A mission decides ten times a second: which of two legs a sample at a corner is counted to may differ.
    assert summarise(log)["cross_track_rms"] == pytest.approx(rms, rel=0.02)


def test_a_log_without_the_settings_of_its_track_is_named(sailed) -> None:
    """In one line."""
    from dataclasses import replace

    from auvsim.base.errors import InputError

    groups = {
        name: {key: value for key, value in values.items() if key != "mission_settings"}
        for name, values in sailed.log.group_attributes.items()
    }
    with pytest.raises(InputError, match="mission_settings"):
        summarise(replace(sailed.log, group_attributes=groups).vehicle())


@pytest.mark.parametrize("side", ["starboard", "port"])
def test_a_circle_is_one(side: Any) -> None:
    """Integrated headings come back to the start after one turn, a diameter to the side asked for at half of it."""
    pattern, speed = Circle(heading_deg=30.0, radius=60.0, side=side), 1.7
    turn = math.tau * 60.0 / speed
    times = (np.arange(4000) + 0.5) / 4000 * turn
    steps = (
        turn
        / 4000
        * speed
        * np.array([(math.cos(h), math.sin(h)) for h in (heading(pattern, t, speed) for t in times)])
    )
    assert steps.sum(axis=0) == pytest.approx((0.0, 0.0), abs=1e-9)
    across = math.radians(30.0 + (90.0 if side == "starboard" else -90.0))
    half = 120.0 * np.array((math.cos(across), math.sin(across)))
    assert steps[:2000].sum(axis=0) == pytest.approx(half, abs=1e-4)  # midpoint rule of 4000 steps


def test_a_weave_is_the_papers() -> None:
    """Qiu and Li's scenario `weave`: c0 + 40 deg sin(2 pi t / 500), and with a phase of 90 deg the cosine."""
    leader = Weave(course_deg=8.0, amplitude_deg=40.0, swing=500.0)
    follower = Weave(course_deg=8.0, amplitude_deg=40.0, swing=300.0, phase_deg=90.0)
    for time in (0.0, 77.0, 431.0):
        expected = 8.0 + 40.0 * math.sin(math.tau * time / 500.0), 8.0 + 40.0 * math.cos(math.tau * time / 300.0)
        assert math.degrees(heading(leader, time, 2.0)) == pytest.approx(expected[0])
        assert math.degrees(heading(follower, time, 2.0)) == pytest.approx(expected[1])


def test_headings_in_time_need_no_position() -> None:
    mission = track(pattern=Weave(course_deg=20.0, amplitude_deg=30.0, swing=40.0), depth=7.0, speed=1.2, lasts=50.0)
    first = mission.update(situation(3.0, 0.0, 0.0, known=False))
    assert first[:3] == pytest.approx((math.radians(20.0), 7.0, 1.2))
    assert mission.phase == UNDER_WAY
    assert mission.update(situation(13.0, 0.0, 0.0, known=False)).heading == pytest.approx(math.radians(50.0))
    mission.update(situation(53.0, 0.0, 0.0, known=False))
    assert (mission.phase, mission.finished) == (DONE, True)
    assert mission.row()[0] == 0
    assert "not finished" in mission.overdue(90.0)
    assert "to the end" in track(pattern=Circle()).overdue(90.0)


def test_metrics_of_a_track_without_waypoints() -> None:
    plan = scenario.parse({
        "duration": 20.0, "vehicles": {"auv": {
            "start": {"north": 0.0, "east": 0.0, "depth": 10.0, "speed": 1.5}, "sensors": {"usbl": {"enabled": False}},
            "estimator": {"kind": "dead_reckoning"},
            "mission": {"kind": "track", "pattern": {"kind": "circle", "radius": 30.0}, "lasts": 10.0},
        }},
    })  # fmt: skip
    assert Track.metrics(run(plan).vehicle()) == {"finished": True, "waypoints": 0, "cross_track_rms": None}
