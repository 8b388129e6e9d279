"""Docks and beacons with modems, in whole runs: they tell where they are, and are ranged to like vehicles."""

import math

import numpy as np
import pytest

from auvsim import load_scenario
from auvsim.analysis.heard import heard_vehicles, relative_to
from auvsim.analysis.mission_plan import sources, way
from auvsim.analysis.network_plots import network
from auvsim.analysis.summary import summarise
from auvsim.base.errors import InputError
from auvsim.base.randomness import stream
from auvsim.navigation.odometry import required
from auvsim.simulation import building, scenario
from auvsim.simulation.fixed_stations import FixedStation
from auvsim.simulation.run import run
from auvsim.video.playback import Playback
from auvsim.video.pulses import Pulses

BUOY = {"north": 250.0, "east": 150.0, "depth": 30.0, "modem": {"tell": {"period": 12.0, "phase": 1.0}}}
HOME = {"north": 150.0, "east": -300.0, "depth": 20.0, "heading_deg": 30.0,
        "modem": {"tell": {"period": 16.0}, "transducer": [2.0, 0.0, -1.0]}}  # fmt: skip
QUIET = {"fading": 0.0, "dropout_probability": 0.0, "sound_speed": 1500.0}


def plan(duration=60.0, *, buoy=BUOY, home=HOME, leader=True, ask=None, offset=1e-4):
    whole = load_scenario("leader_follower", duration=duration, network=QUIET).model_dump(mode="json")
    whole["network"]["beacons"] = {"buoy": buoy} if buoy else {}
    whole["structures"] = {"home": home} if home else {}
    if not leader:
        del whole["vehicles"]["leader"]
    whole["vehicles"]["follower"]["modem"]["ask"] = ask or {}
    whole["vehicles"]["follower"]["clock"]["offset"] = offset
    return scenario.parse(whole)


@pytest.fixture(scope="module")
def log():
    return run(plan(150.0), seed=3)


def test_they_tell_their_places_and_ranges_are_those_of_travel_time(log):
    """Clocks differ by 0.1 ms, 0.15 m, and arrival times are noisy by 0.19 m; the dock's modem is off its mouth."""
    received, truth = log.vehicle("follower")["received"], log.vehicle("follower")["truth"]
    turned = math.radians(30.0)
    places = {
        "buoy": (250.0, 150.0, 30.0),
        "home": (150.0 + 2.0 * math.cos(turned), -300.0 + 2.0 * math.sin(turned), 19.0),
    }
    for name, place in places.items():
        mine = received["source"] == name
        assert mine.sum() > 5
        assert received["payload"][mine][:, 1:4] == pytest.approx(np.tile(place, (mine.sum(), 1)))
        assert np.all(received["payload"][mine][:, 5:14] == 0.0)
        there = np.column_stack(
            [np.interp(received["arrived"][mine], truth["time"], truth["position"][:, k]) for k in range(3)]
        )
        assert received["range"][mine] == pytest.approx(np.linalg.norm(there - place, axis=1), abs=1.0)


def test_a_follower_uses_them_beside_its_leader(log):
    fates = log.vehicle("follower")["measurements"]
    for name in ("leader", "buoy", "home"):
        assert fates["accepted"][fates["sensor"] == name].sum() > 4
    assert heard_vehicles(log.vehicle("follower")) == ("leader",)
    rows = log.groups["network/messages"]
    assert {"buoy", "home"} <= {*rows["destination"].tolist()}  # they hear, too, though nobody reads it


def test_a_relative_error_is_the_difference_of_both(log):
    follower, leader = log.vehicle("follower"), log.vehicle("leader")
    found = relative_to(follower, "leader")
    time = found.time[-5]
    off = []
    for vehicle in (follower, leader):
        estimate, truth = vehicle["estimate"], vehicle["truth"]
        at = [np.interp(time, estimate["time"], estimate["position"][:, k]) for k in range(2)]
        off.append(np.array(at) - [np.interp(time, truth["time"], truth["position"][:, k]) for k in range(2)])
    assert found.error[-5] == pytest.approx(off[0] - off[1], abs=1e-6)
    rms = summarise(follower)["relative_to"]
    assert rms == {"leader": pytest.approx(math.sqrt(np.mean(np.sum(found.error**2, axis=1))))}
    assert "relative_to" not in summarise(leader)


def test_the_picture_of_packets_has_a_line_for_each(log, tmp_path):
    network(log, tmp_path / "packets.png")
    assert (tmp_path / "packets.png").stat().st_size > 10_000


def test_a_beacon_alone_is_a_leader_and_answers_questions():
    """Two-way: the clock of the follower, 50 ms off, does not matter."""
    asks = plan(
        90.0, leader=False, home=None, buoy=BUOY | {"modem": {}}, ask={"whom": "buoy", "period": 10.0}, offset=0.05
    )
    log = run(asks, seed=2)
    received, truth = log.vehicle("follower")["received"], log.vehicle("follower")["truth"]
    assert len(received["time"]) >= 6
    there = np.column_stack([np.interp(received["time"], truth["time"], truth["position"][:, k]) for k in range(3)])
    away = np.linalg.norm(there - (250.0, 150.0, 30.0), axis=1)
    assert received["range"] == pytest.approx(away, abs=8.0)  # it moved on at 2 m/s before it was told
    assert log.vehicle("follower")["measurements"]["accepted"][
        log.vehicle("follower")["measurements"]["sensor"] == "buoy"
    ].any()


def test_the_error_of_a_chart_is_drawn_and_told():
    found = []
    for seed in range(40):
        station = run_station(seed, 4.0)
        assert station[8] == station[11] == 16.0
        found.append((station[1] - 250.0, station[2] - 150.0))
    # 95 % of the variance of 80 normals of 4 m.
    assert 11.6 < np.var(found) < 21.4
    assert run_station(1, 0.0)[1:3] == (250.0, 150.0)


def run_station(seed, chart):
    fixed = plan(buoy=BUOY | {"chart": chart}).fixed_modems["buoy"]
    return FixedStation(fixed, stream(seed, 0, "buoy/chart")).report(5.0)


def test_the_bound_counts_them():
    values = plan()
    ways = {name: way(values, name, building.current(values, 0)) for name in values.vehicles}
    found = {source.name: source for source in sources(values, "follower", ways)}
    assert [*found] == ["leader", "home", "buoy"]
    assert found["buoy"].times[:3] == pytest.approx((1.0, 13.0, 25.0))
    assert np.all(found["buoy"].places == (250.0, 150.0, 30.0))
    assert found["buoy"].range_variance(np.array([100.0]))[0] == pytest.approx((1500.0 * 125e-6) ** 2, rel=0.01)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"network": {"beacons": {"leader": BUOY}}}, r"network\.beacons\.leader: a vehicle or structure has that name"),
        ({"network": {"beacons": {"buoy": BUOY | {"depth": 900.0}}}}, r"beacons\.buoy\.depth: 900 m is not"),
        ({"network": {"beacons": {"buoy": BUOY | {"modem": {"ask": {"whom": "nobody"}}}}}}, r"nobody"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_named(change, text):
    whole = load_scenario("leader_follower", duration=5.0).model_dump(mode="json")
    whole["network"] |= change["network"]
    with pytest.raises(InputError, match=text):
        run(scenario.parse(whole), seed=0)


def test_a_follower_without_anyone_to_hear_is_told_what_may_help():
    class Setup:
        others, modem, vehicle = (), object(), "follower"
        settings = type("S", (), {"kind": "range_ekf"})

    with pytest.raises(InputError, match="another vehicle, a structure or a beacon with a modem"):
        required(Setup())  # pyright: ignore[reportArgumentType]


def test_the_video_shows_the_pulse_of_each_sender(log):
    """Every packet of a modem is a ring from where its sender was, dock and beacon included."""
    playback = Playback(log)
    found = Pulses(playback).shown
    rows = log.groups["network/messages"]
    decided = (rows["kind"] != "usbl") & (rows["fate"] != "under way")
    sent = {*zip(rows["time"][decided].tolist(), rows["source"][decided].tolist(), strict=True)}
    assert {(pulse.sent, pulse.source) for pulse in found} == sent
    assert {pulse.source for pulse in found} == {"leader", "buoy", "home"}
    assert playback.fixed_modems["buoy"] == pytest.approx((250.0, -150.0, -30.0))  # MuJoCo's axes: north, west, up
    assert [*playback.beacons] == ["buoy"]
