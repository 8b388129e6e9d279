"""Fleets beyond a leader and a follower, in whole runs: what each further source of ranges does to estimates."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from auvsim import load_scenario
from auvsim.missions.track.mission import Track
from auvsim.simulation import scenario
from auvsim.simulation.run import run

SEEDS = (0, 1)
SLOTS = {"access": {"kind": "tdma", "slot": 2.0, "reach": 1500.0}}
LATE = 250.0  # from when on a follower knows its current [s]


def plan(duration: float = 600.0, vehicles: dict[str, Any] | None = None, **changes: Any) -> scenario.Scenario:
    """The shipped scenario with changes, and more vehicles or other ones."""
    whole = load_scenario("leader_follower", duration=duration, **changes).model_dump(mode="json")
    return scenario.parse(layered(whole, {"vehicles": vehicles or {}}))


def layered(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """A mapping with changes, that go into its mappings unless they are of another kind."""
    found = dict(base)
    for key, value in changes.items():
        inside = isinstance(value, dict) and isinstance(found.get(key), dict) and "kind" not in value
        found[key] = layered(found[key], value) if inside else value
    return found


def copy(name: str, **changes: Any) -> dict[str, Any]:
    """A vehicle like one of the shipped scenario's, with changes."""
    return {**plan().vehicles[name].model_dump(mode="json"), **changes}


def at(north: float, east: float, heading_deg: float, depth: float) -> dict[str, float]:
    return {"north": north, "east": east, "heading_deg": heading_deg, "depth": depth, "speed": 2.0}


def errors(log, name: str, since: float = LATE):
    """Errors (n, 2) [m] of an estimate and its NEES a degree of freedom (n,), from a time on."""
    estimate, truth = log.vehicle(name)["estimate"], log.vehicle(name)["truth"]
    there = np.array([np.interp(estimate["time"], truth["time"], truth["position"][:, k]) for k in range(2)]).T
    late = estimate["time"] > since
    error, P = (estimate["position"][:, :2] - there)[late], estimate["covariance"][late, :2, :2]
    return error, np.einsum("ni,ni->n", error, np.linalg.solve(P, error[..., None])[..., 0]) / 2.0


def judged(logs, name: str, since: float = LATE) -> tuple[float, float]:
    """Rms [m] and mean NEES a degree of freedom over runs."""
    found = [errors(log, name, since) for log in logs]
    rms = math.sqrt(np.mean([np.sum(e**2, axis=1).mean() for e, _ in found]))
    return rms, float(np.mean([n.mean() for _, n in found]))


def logs_of(seeds: Sequence[int] = SEEDS, **changes: Any):
    return [run(plan(**changes), seed=seed) for seed in seeds]


def test_a_second_leader_helps():
    second = copy("leader", start=at(-60.0, 180.0, 8.0, 14.0))
    pair = logs_of(vehicles={"leader_2": second}, network=SLOTS)
    alone = logs_of(network=SLOTS)
    (with_two, nees), (with_one, _) = judged(pair, "follower"), judged(alone, "follower")
    assert with_two < 0.9 * with_one
    assert 0.2 < nees < 3.0
    assert {*pair[0].vehicle("follower")["received"]["source"].tolist()} == {"leader", "leader_2"}


@pytest.mark.slow
def test_ranges_between_followers_help_the_one_that_hardly_hears_the_leader():
    """Few packets get through from 800 m in this noise; a follower between them carries its knowledge on.

    What it tells of is mostly errors of its own, which last: taken for independent they make NEES hundreds.
    """
    bank = {"kind": "motion_radius"}
    quiet = copy("follower", estimator=bank, start=at(60.0, -900.0, 48.0, 11.0))
    network = SLOTS | {"noise_level": 107.0, "fading": 0.0}
    found = {}
    for tells in (False, True):
        modem = {"preset": "micromodem_psk"} | ({"tell": {"period": 8.0}} if tells else {})
        vehicles = {
            "follower": {"start": at(10.0, -450.0, 48.0, 10.0), "modem": modem, "estimator": bank},
            "far": quiet,
        }
        found[tells] = logs_of(range(4), vehicles=vehicles, network=network)
    heard = [{*log.vehicle("far")["received"]["source"].tolist()} for log in found[True]]
    assert all("follower" in names for names in heard)
    (with_it, nees), (without, _) = judged(found[True], "far"), judged(found[False], "far")
    assert with_it < 0.5 * without
    assert nees < 5.0  # the sender's own is 2: it ranges from 450 m, through the noise


def told_by_all(kind: str, tells: bool, **changes: Any) -> scenario.Scenario:
    """A leader and three followers, of which all tell, or the leader alone."""
    modem = {"preset": "micromodem_psk"} | ({"tell": {"period": 8.0}} if tells else {})
    own = {"modem": modem, "estimator": {"kind": kind}}
    starts = {"f1": at(-60.0, -190.0, 48.0, 11.0), "f2": at(-130.0, -280.0, 48.0, 12.0)}
    return plan(
        vehicles={"follower": own, **{name: copy("follower", start=start, **own) for name, start in starts.items()}},
        network=SLOTS, **changes,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["range_ekf", "motion_radius"])
def test_followers_that_all_tell_do_not_talk_each_other_into_a_wrong_place(kind):
    """Each hears of its own errors again by way of the others: as independent ranges they lead 200 to 400 m astray."""
    loud, quiet = ([run(told_by_all(kind, tells), seed=s) for s in range(6)] for tells in (True, False))
    squares = []
    for name in ("follower", "f1", "f2"):
        (rms, nees), (alone, own) = judged(loud, name), judged(quiet, name)
        # NEES of six runs, in each of which errors last, varies by itself; what is shared is bounded, not known.
        assert 0.3 < nees < max(1.5, 1.05 * own)
        assert rms < 1.05 * alone
        squares.append((rms / alone) ** 2)
    assert np.mean(squares) < 0.7


def test_a_follower_refuses_ranges_to_one_that_knows_no_better():
    """Short form: two followers that know their places alike have nothing to tell each other."""
    log = run(told_by_all("range_ekf", True, duration=120.0), seed=1)
    for name in ("follower", "f1", "f2"):
        fates = log.vehicle(name)["measurements"]
        reasons = {source: {*fates["reason"][fates["sensor"] == source].tolist()} for source in ("leader", "f1", "f2")}
        assert "less_certain" not in reasons["leader"]
        assert any("less_certain" in reasons[other] for other in ("f1", "f2") if other != name)
        assert judged([log], name, 60.0)[1] < 4.6  # 99 % of two degrees of freedom, of errors that last


@pytest.mark.slow
@pytest.mark.parametrize(("begins", "least", "most"), [(0.0, 3.0, 30.0), (300.0, 0.0, 3.0)])
def test_a_leader_that_surfaces_for_gps_helps_its_follower_too(monkeypatch, begins, least, most):
    """Its position is known at the surface alone; without coming up again it drifts by the errors of its DVL."""
    steered = Track.update

    def update(self, now):
        asked = steered(self, now)
        up = now.time < 60.0 or begins < now.time < begins + 90.0
        return asked._replace(depth=0.3) if up and asked.depth == 12.0 else asked

    monkeypatch.setattr(Track, "update", update)
    gps = {"kind": "fix", "rate": 1.0, "noise": 1.0, "deepest": 1.0}
    dvl = {"scale_error": 0.01, "misalignment_deg": 1.0}
    start = at(-100.0, -100.0, 8.0, 1.0)
    leader = {"start": start, "sensors": {"ship": {**gps, "enabled": False}, "gps": gps, "dvl": dvl}}
    leader["estimator"] = {"kind": "dead_reckoning", "position_noise": 0.05}
    logs = logs_of(vehicles={"leader": leader})
    for log in logs:
        fixes, truth = log.vehicle("leader")["gps"]["time"], log.vehicle("leader")["truth"]
        assert np.interp(fixes, truth["time"], truth["position"][:, 2]).max() <= 1.0 + 0.3  # none under water
        assert ((fixes > 320.0).sum() > 30) == (begins > 0.0)
    own, follower = judged(logs, "leader", 400.0), judged(logs, "follower", 400.0)
    assert least < own[0] < most
    assert least < follower[0] < most
    assert 0.05 < own[1] < 3.0
    assert 0.1 < follower[1] < 6.0


def test_a_leader_goes_to_dock_while_it_leads():
    """It still tells where it is from inside the dock; the follower, that goes on, stays consistent."""
    dock = {"north": 150.0, "east": -100.0, "depth": 15.0, "heading_deg": 8.0}
    leader = copy("leader")
    leader["mission"] = {"kind": "docking", "dock": "home", "gate_distance": 60.0}
    leader["estimator"] = {"kind": "robust"}
    leader["sensors"]["usbl"] = {"enabled": True, "dock": "home"}
    leader["sensors"].pop("ship")
    whole = plan().model_dump(mode="json")
    whole["structures"] = {"home": dock}
    whole["water"]["current"] = {"kind": "uniform", "speed": 0.2, "direction_deg": 45.0}
    whole["vehicles"]["leader"] = leader
    whole["vehicles"]["follower"]["estimator"] = {"kind": "motion_radius"}
    logs = [run(scenario.parse(whole), seed=seed) for seed in SEEDS]
    for log in logs:
        events, rows = log.vehicle("leader")["event"], log.groups["network/messages"]
        docked = float(events["time"][events["kind"] == "docked"][0])
        told = (rows["source"] == "leader") & (rows["fate"] == "delivered")
        assert (rows["time"][told] > docked + 20.0).sum() > 5
    rms, nees = judged(logs, "follower")
    assert rms < 8.0
    assert 0.05 < nees < 3.0  # low: the leader in its dock errs less than it says
