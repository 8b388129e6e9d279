"""Four vehicles in formation in MuJoCo: they find their stations in a current, and go on without a leader."""

import numpy as np
import pytest

from auvsim import load_scenario
from auvsim.analysis.formation_plots import formation_figure
from auvsim.missions.formation.metrics import formation_metrics, settled, station_errors
from auvsim.simulation.run import run
from auvsim.studies import formation as study

NAMES = ("leader_1", "leader_2", "leader_3", "follower")


@pytest.fixture(scope="module")
def log():
    """A leader that never speaks: the other two are enough."""
    silent = {"leader_3": {"modem": {"tell": {"period": None}}}}
    return run(load_scenario("formation", duration=110.0, rates={"log": 1.0}, vehicles=silent), seed=6)


def test_all_are_on_station_after_a_minute_and_none_touch(log):
    for name in NAMES:
        vehicle = log.vehicle(name)
        times, errors = station_errors(vehicle)
        late = settled(vehicle, times)
        assert late.any()
        assert np.hypot(*errors[late].T).max() < 5.0
        assert formation_metrics(vehicle)["station_rms"] < 3.0  # the goal
        assert len(vehicle["contact"]["time"]) == 0


def test_the_follower_says_whom_it_hears(log):
    follower = log.vehicle("follower")
    texts = follower["event"]["text"].tolist()
    assert "leader_1 is heard" in texts
    assert "leader_3 is heard" not in texts
    assert any("with leader_1, leader_2" in text for text in texts)
    assert follower["mission"]["heard"][-1] == 2
    assert 0.1 < follower["mission"]["bound"][-1] < 5.0
    assert np.isnan(log.vehicle("leader_1")["mission"]["bound"]).all()


def test_the_picture_shows_stations_errors_and_bounds(log):
    figure = formation_figure(log)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == [
        "The formation as the moving point sees it", "True distance from the station",
        "Error of the estimated position", "Leaders that are not silent",
    ]  # fmt: skip
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {*NAMES, "station", "range", "bound it assumes"} <= set(named)


def test_trials_of_the_study_are_paired():
    first, second = (study.pinned(shape, 3, 5, 100.0) for shape in study.SHAPES[:2])
    assert first["water"] == second["water"] != study.pinned(study.SHAPES[0], 3, 6, 100.0)["water"]
    assert first["vehicles"]["follower"]["start"] == second["vehicles"]["follower"]["start"]


@pytest.mark.slow
def test_the_best_bearings_are_worth_their_while():
    """Four paired trials of the forty: station within 5 m, the follower's error at most 0.6 of that on a line."""
    best, line = ([study.run_one(shape, 77, k, 150.0) for k in range(4)] for shape in study.SHAPES[:2])
    assert max(max(t.station.values()) for t in best) < 5.0
    rms = [np.sqrt(np.mean([t.position**2 for t in trials])) for trials in (best, line)]
    assert rms[0] <= 0.6 * rms[1]
