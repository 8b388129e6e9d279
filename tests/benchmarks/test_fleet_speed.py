"""Speed of runs of 1, 2, 4 and 8 vehicles, each with its own USBL, estimator and mission; of a leader with followers.

Run with `pytest tests/benchmarks/test_fleet_speed.py --benchmark-enable --benchmark-timer=time.process_time`:
`real_time_factor` in `extra_info` is simulated time over CPU time, of all vehicles together in one run.
"""

import pytest

from auvsim import load_scenario
from auvsim.simulation import scenario
from auvsim.simulation.run import run

SECONDS = 120.0
LONG = 2500.0  # of the leader with its followers
ROUNDS = 5


def fleet(vehicles: int) -> scenario.Scenario:
    """Lawn-mower tracks, 60 m from each other, within reach of one dock's USBL."""
    track = {"kind": "lawn_mower", "length": 400.0, "spacing": 20.0, "lanes": 3}
    return scenario.parse(
        {
            "duration": SECONDS,
            "structures": {"dock": {"north": 200.0, "east": -40.0}},
            "water": {"current": {"kind": "uniform", "speed": 0.2, "direction_deg": 70.0}},
            "vehicles": {
                f"auv_{k}": {
                    "start": {"north": 0.0, "east": 60.0 * k, "heading_deg": 0.0, "depth": 10.0, "speed": 1.5},
                    "mission": {
                        "kind": "track",
                        "pattern": track | {"corner": [20.0, 60.0 * k]},
                        "depth": 10.0,
                        "speed": 1.5,
                    },
                }
                for k in range(vehicles)
            },
        }
    )


@pytest.mark.benchmark(group="a fleet")
@pytest.mark.parametrize("vehicles", [1, 2, 4, 8])
def test_fleet(benchmark, vehicles: int) -> None:
    plan = fleet(vehicles)
    log = benchmark.pedantic(run, (plan,), {"seed": 3}, rounds=ROUNDS, warmup_rounds=1)
    for name in log.vehicles:
        assert log.vehicle(name)["truth"]["time"][-1] == SECONDS
        assert len(log.vehicle(name)["usbl"]["time"]) > 10
    if benchmark.stats:  # none with --benchmark-disable
        benchmark.extra_info["real_time_factor"] = round(SECONDS / benchmark.stats["min"])


def cooperation(seconds: float) -> scenario.Scenario:
    """The shipped leader with three followers that hear it, all weaving."""
    whole = load_scenario("leader_follower", duration=seconds).model_dump(mode="json")
    vehicles = whole["vehicles"]
    for k in (1, 2):
        start = {"north": 10.0 - 60.0 * k, "east": -100.0 - 80.0 * k, "depth": 10.0 + k}
        vehicles[f"follower_{k + 1}"] = vehicles["follower"] | {"start": vehicles["follower"]["start"] | start}
    for vehicle in vehicles.values():
        vehicle["mission"] = vehicle["mission"] | {"lasts": seconds}
    return scenario.parse(whole)


@pytest.mark.slow
@pytest.mark.benchmark(group="leader and three followers")
def test_leader_and_three_followers(benchmark) -> None:
    """2500 s of a mission, which is to take no more than a 150th of that on one core."""
    plan = cooperation(LONG)
    log = benchmark.pedantic(run, (plan,), {"seed": 3}, rounds=1, warmup_rounds=1)
    assert len(log.vehicles) == 4
    assert log.vehicle("follower_3")["truth"]["time"][-1] == LONG
    assert len(log.vehicle("follower_2")["received"]["time"]) > 0.8 * LONG / 8.0
    if benchmark.stats:
        benchmark.extra_info["real_time_factor"] = round(LONG / benchmark.stats["min"])
