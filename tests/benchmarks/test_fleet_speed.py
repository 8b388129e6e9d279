"""Speed of runs of 1, 2, 4 and 8 vehicles, each with its own USBL, estimator and mission.

Run with `pytest tests/benchmarks/test_fleet_speed.py --benchmark-enable --benchmark-timer=time.process_time`:
`real_time_factor` in `extra_info` is simulated time over CPU time, of all vehicles together in one run.
"""

import pytest

from auvsim.simulation import scenario
from auvsim.simulation.run import run

SECONDS = 120.0
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
