"""Surveys: the order of lanes, the depth that keeps an altitude, and a short mission over a generated floor."""

import math

import numpy as np
import pytest

from auvsim.base.reading import Reading
from auvsim.missions.survey.altitude import AltitudeKeeper
from auvsim.missions.track.patterns import LawnMower, points
from auvsim.simulation.loading import load_scenario
from auvsim.simulation.sensor_settings import on_board


def test_a_racetrack_runs_each_lane_once_and_neighbours_one_way() -> None:
    """Seven lanes to port: sides of 3, 4; each half's lanes are run in one direction."""
    pattern = LawnMower(corner=(3.0, -2.0), length=40.0, spacing=5.0, lanes=7, side="port", order="racetrack")
    ends = points(pattern).reshape(7, 2, 2)
    lanes = (-2.0 - ends[:, 0, 1]) / 5.0
    assert lanes.tolist() == [0.0, 4.0, 1.0, 5.0, 2.0, 6.0, 3.0]
    ways = ends[:, 1, 0] - ends[:, 0, 0]
    assert ways.tolist() == [40.0, -40.0] * 3 + [40.0]


def test_altitude_by_a_tilted_altimeter_within_safe_depths() -> None:
    """Range times the vertical part of the axis below the gauge's depth; blind and safe depths otherwise."""
    keeper = AltitudeKeeper({"altimeter"}, 5.0, deepest=14.0, blind=8.0, patience=5.0)
    assert keeper.depth(0.0) == 8.0
    compass = Reading("compass", 1.0, 1.0, np.array((0.3, 0.2, -0.1)))
    down = math.cos(0.2) * math.cos(0.1)
    keeper.observe([compass, Reading("altimeter", 1.0, 1.0, np.array((7.0,)))], 10.0)
    assert keeper.depth(1.0) == pytest.approx(10.0 + 7.0 * down - 5.0)
    for k in range(200):
        keeper.observe([Reading("altimeter", 1.2 + 0.2 * k, 0.0, np.array((12.0,)))], 10.0)
    assert keeper.floor == pytest.approx(10.0 + 12.0 * down, abs=0.01)
    assert keeper.depth(41.2) == 14.0
    assert keeper.depth(47.0) == 8.0


def test_a_sensor_named_as_its_kind_is_on_board_once() -> None:
    """So the shipped scenario's altimeter and GPS are each read once a period."""
    names = [name for name, _ in on_board(load_scenario("survey").vehicles["remus100"].sensors)]
    assert sorted(names) == sorted({*names})
    assert {"altimeter", "gps", "sonar"} <= {*names}
