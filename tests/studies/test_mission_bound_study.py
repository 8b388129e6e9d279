"""Missions against the map of their bound: the short form, and the figures that the study is to reach."""

import math

import numpy as np
import pytest

from auvsim.analysis.mission_plan import way
from auvsim.simulation import building
from auvsim.studies import mission_bound as study


def test_stations_are_points_of_their_maps():
    """A station between two points would be compared with the bound at neither."""
    for station in study.STATIONS:
        span, side = station.map
        step = span / (side - 1)
        for off in (station.north, station.east):
            assert off / step == pytest.approx(round(off / step), abs=1e-9)


def test_a_run_starts_at_its_station_and_knows_its_start_no_better_than_it_says():
    plan = study.plan(study.STATIONS[2], 60.0, (2.0, -5.0), {"current": {"kind": "uniform", "speed": 0.3}})
    follower = plan.start_position("follower")
    assert plan.start_position("leader")[:2] == (follower[0], follower[1] + 200.0)
    assumed = plan.vehicles["follower"].estimator
    assert (assumed.north, assumed.east) == (follower[0] + 2.0, follower[1] - 5.0)
    assert assumed.position == 3.0
    assert plan.water.current.speed == 0.3


def test_one_course_is_one_course():
    plan = study.plan(study.STATIONS[-1], 60.0)
    field = building.current(plan, 0)
    ways = [way(plan, name, field).inputs[:, 2] for name in ("leader", "follower")]
    assert np.ptp(np.concatenate(ways)) < 1e-12


def test_trials_differ_and_are_the_same_again():
    one, other, again = (study.run_one(study.STATIONS[1], 60.0, 5, k) for k in (0, 1, 0))
    assert one == again != other
    assert math.isfinite(one.square)
    assert one.nees > 0.0


@pytest.mark.slow
def test_missions_keep_to_the_map():
    """Ten runs at two stations: an rms of ten runs whose errors last is uncertain by some 25 %."""
    for station in (study.STATIONS[1], study.STATIONS[4]):
        _, least, rank, _ = study.bound_at(station, 600.0)
        found = [study.run_one(station, 600.0, 77, k) for k in range(10)]
        assert rank == 4
        assert 0.7 < math.sqrt(np.mean([f.square for f in found])) / least < 1.6
