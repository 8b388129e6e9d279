"""Vehicles that talk, in whole runs: what is sent, heard, lost and logged, and what a follower makes of it."""

import math
from typing import Any

import numpy as np
import pytest

from auvsim import load_scenario
from auvsim.acoustics.message import Outgoing
from auvsim.base.errors import InputError
from auvsim.data import log as logs
from auvsim.missions.track.mission import Track
from auvsim.replay import trial_logs
from auvsim.replay.run import replay
from auvsim.simulation import scenario
from auvsim.simulation.agent import Agent
from auvsim.simulation.run import Simulation, run


def plan(duration: float = 90.0, **changes: Any) -> scenario.Scenario:
    return load_scenario("leader_follower", duration=duration, **changes)


def errors(log, name="follower"):
    """Times [s], errors north and east [m], and their covariances, of an estimate."""
    estimate, truth = log.vehicle(name)["estimate"], log.vehicle(name)["truth"]
    there = np.array([np.interp(estimate["time"], truth["time"], truth["position"][:, k]) for k in range(2)]).T
    return estimate["time"], estimate["position"][:, :2] - there, estimate["covariance"][:, :2, :2]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "log.nc"
    run(plan(rates={"log": 10.0}, network={"fading": 0.0, "dropout_probability": 0.2}), seed=4, path=path)
    return path


@pytest.fixture(scope="module")
def log(path):
    return logs.read(path)


def test_every_packet_has_a_row_and_every_delivered_one_is_received(log):
    rows, received = log.groups["network/messages"], log.vehicle("follower")["received"]
    assert rows["source"].tolist() == ["leader"] * len(rows["time"])
    assert np.diff(rows["time"]) == pytest.approx(8.0, abs=1e-6)
    delivered = rows["fate"] == "delivered"
    assert 0 < delivered.sum() < len(delivered)
    assert received["time"].tolist() == rows["received"][delivered & (rows["received"] <= 90.0)].tolist()
    assert set(rows["fate"][~delivered].tolist()) <= {"dropped", "under way"}
    assert "received" in log.vehicle("leader")
    assert len(log.vehicle("leader")["received"]["time"]) == 0


def test_a_loss_has_an_event_where_it_begins(log):
    rows = log.groups["network/messages"]
    fates = [f for f in rows["fate"].tolist() if f != "under way"]
    begins = sum(now == "dropped" != before for before, now in zip(["", *fates], fates, strict=False))
    events = log.vehicle("follower")["event"]
    assert events["text"][events["kind"] == "lost"].tolist() == ["packet of leader: dropped"] * begins
    assert begins > 0


def test_a_range_is_from_where_the_packet_left_to_where_it_arrived(log):
    received, (rows) = log.vehicle("follower")["received"], log.groups["network/messages"]
    sent = rows["time"][rows["fate"] == "delivered"]
    leader, follower = (log.vehicle(name)["truth"] for name in ("leader", "follower"))

    def place(truth, times):
        return np.array([np.interp(times, truth["time"], truth["position"][:, k]) for k in range(3)]).T

    n = len(received["time"])
    arrived = received["arrived"] - 0.0001  # the follower's clock is 0.1 ms ahead
    true = np.linalg.norm(place(leader, sent[:n]) - place(follower, arrived), axis=1)
    # 125 us are 0.19 m; the clocks' 0.1 ms are 0.15 m
    assert received["range"] - true == pytest.approx(0.15, abs=4 * 0.19)
    assert received["range"][0] == pytest.approx(100.0, abs=20.0)


def test_what_is_told_is_the_senders_estimate_when_it_sends(log):
    received, estimate = log.vehicle("follower")["received"], log.vehicle("leader")["estimate"]
    told = received["payload"][:, :14]
    assert np.isnan(received["payload"][:, 14:]).all()
    assert told[:, 0] == pytest.approx(received["stamp"])
    last = np.searchsorted(estimate["time"], received["stamp"] - 1e-3) - 1
    since = received["stamp"] - estimate["time"][last]
    for k in range(2):  # the last estimate before, moved on
        moved = estimate["position"][last, k] + since * told[:, 5 + k]
        assert told[:, 1 + k] == pytest.approx(moved, abs=1e-4)  # stamps are of a clock
    speed = np.hypot(told[:, 5], told[:, 6])
    assert (speed > 1.5).all()  # 2 m/s in a current of 0.7 m/s


def test_a_replay_gives_the_same_estimates(path, log):
    (_, recording) = trial_logs.recordings(path)
    (again,) = replay(recording)
    before = log.vehicle("follower")["estimate"]
    assert recording.name.endswith("follower")
    assert len(recording.messages) > 5
    np.testing.assert_array_equal([e.state for e in again.estimates], before["mean"])
    np.testing.assert_array_equal([e.covariance for e in again.estimates], before["covariance"])


def test_runs_repeat_bit_for_bit_and_a_modem_changes_no_sensor():
    short = plan(20.0)
    one, other = run(short, seed=5), run(short, seed=5)
    assert logs.differences(one, other) == []
    alone = short.model_copy(
        update={"vehicles": {"leader": short.vehicles["leader"].model_copy(update={"modem": None})}}
    )
    silent = run(alone, seed=5)
    assert "received" not in silent.vehicle("leader")
    for sensor in ("compass", "depth", "dvl", "gyro", "ship"):
        np.testing.assert_array_equal(
            silent.vehicle("leader")[sensor]["value"], one.vehicle("leader")[sensor]["value"]
        )  # fmt: skip


class Chatty(Track):
    """A track that sends a word to the follower every fifth second."""

    count = 0

    def update(self, now):
        if self.count % 50 == 0:
            self.outbox.append(Outgoing("word", (float(self.count),), "follower"))
        self.count += 1
        return super().update(now)


class Listening(Track):
    """A track that remembers what it hears."""

    def __init__(self, setup):
        super().__init__(setup)
        self.heard = []

    def update(self, now):
        self.heard += now.messages
        return super().update(now)


def test_missions_send_and_hear():
    values = plan(22.0, network={"dropout_probability": 0.0, "fading": 0.0})
    missions: dict[str, Any] = {}

    def make(name, *args, **more):
        agent = Agent(name, *args, **more)
        kind = Chatty if name == "leader" else Listening
        agent.mission.__class__ = kind
        agent.mission.heard = []
        missions[name] = agent.mission
        return agent

    simulation = Simulation(values, seed=1, agents=make, record=False)
    while simulation.ticks < 220:
        simulation.step()
    words = [d.message for d in missions["follower"].heard if d.message.kind == "word"]
    assert [w.payload for w in words] == [(0.0,), (50.0,), (100.0,), (150.0,), (200.0,)]
    assert {w.bits for w in words} == {48}
    assert words[1].sent == pytest.approx(5.1 + 0.1, abs=0.11)


def test_a_deaf_follower_does_not_pretend():
    """Nothing is heard: the unknown current of 0.5 m/s along each axis carries it off, and it says so."""
    _deaf(200.0)


@pytest.mark.slow
def test_a_follower_that_hears_nothing_for_an_hour():
    _deaf(3600.0)


def _deaf(duration):
    lasts = {"mission": {"lasts": duration}}
    deaf = plan(duration, network={"dropout_probability": 1.0}, vehicles={"leader": lasts, "follower": lasts})
    log = run(deaf, seed=6)
    assert log.attributes["status"] == "complete"
    times, error, covariance = errors(log)
    assert times[-1] == pytest.approx(duration, abs=1.0)
    end = times > 0.5 * duration
    normalised = [e @ np.linalg.solve(P, e) for e, P in zip(error[end], covariance[end], strict=True)]
    assert max(normalised) < 9.2  # 99 % of two degrees of freedom
    assert error[-1] == pytest.approx((-0.5 * duration,) * 2, rel=0.1)
    assert np.sqrt(covariance[-1, 0, 0]) == pytest.approx(0.5 * duration, rel=0.1)


def test_followers_find_the_current():
    """Short form: after 400 s the error is that of metres, not the 280 m of dead reckoning, and so says the filter."""
    log = run(plan(400.0), seed=8)
    times, error, covariance = errors(log)
    late = times > 300.0
    assert np.hypot(*error[late].T).max() < 30.0
    normalised = [e @ np.linalg.solve(P, e) / 2 for e, P in zip(error[late], covariance[late], strict=True)]
    assert np.mean(normalised) < 4.6  # 99 % of two degrees of freedom, of errors that stay alike for 100 s
    assert log.vehicle("follower")["estimate"]["current"][-1] == pytest.approx((0.5, 0.5), abs=0.1)


def test_bad_packets_are_refused_counted_and_named():
    """A leader whose clock leaps back by 0.5 s at 40 s: the follower says so once, and uses none of its packets."""
    values = plan(80.0, network={"dropout_probability": 0.0, "fading": 0.0})
    leader = values.vehicles["leader"]
    leapt = leader.model_copy(update={"clock": leader.clock.model_copy(update={"jump": -0.5, "jump_time": 40.0})})
    log = run(values.model_copy(update={"vehicles": {**values.vehicles, "leader": leapt}}), seed=9)
    events, fates = log.vehicle("follower")["event"], log.vehicle("follower")["measurements"]
    assert "messages of leader: clock jump" in events["text"].tolist()
    refused = fates["reason"] == "clock_jump"
    assert refused.sum() == len(log.vehicle("follower")["received"]["time"]) - 4  # from its first fix to 36 s
    assert set(fates["sensor"][refused].tolist()) == {"leader"}


def test_a_range_filter_without_modem_or_log_is_refused():
    values = plan()
    follower = values.vehicles["follower"]
    for update, text in (
        ({"modem": None}, r"estimator 'range_ekf' of 'follower': needs a modem"),
        ({"sensors": {"dvl": {"enabled": False}}}, r"estimator 'range_ekf' of 'follower': needs a DVL"),
    ):
        whole = values.model_dump(mode="json")
        whole["vehicles"]["follower"] = scenario.to_yaml(values) and {**follower.model_dump(mode="json"), **update}
        with pytest.raises(InputError, match=text):
            Simulation(scenario.parse(whole), seed=0)


def test_a_follower_with_nobody_to_hear_is_refused():
    with pytest.raises(
        InputError,
        match=r"'follower': needs another vehicle, a structure or a beacon with a modem .*, of which there is none",
    ):
        Simulation(plan(vehicles={"leader": {"modem": None}}), seed=0)


def test_a_beacon_over_the_horizon_is_out_of_reach():
    """80 km away nothing is received, and the reason is noise."""
    values = plan(70.0).model_dump(mode="json")
    values["vehicles"]["leader"]["start"]["north"] = -80_000.0
    log = run(scenario.parse(values), seed=2)
    rows = log.groups["network/messages"]
    assert set(rows["fate"].tolist()) <= {"noise", "under way"}
    assert math.isnan(rows["received"][0])
