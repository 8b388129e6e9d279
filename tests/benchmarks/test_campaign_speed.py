"""Speed of a campaign with one worker and with two.

Run with `pytest tests/benchmarks/test_campaign_speed.py --benchmark-enable`: the ratio of the two times is the
efficiency, if nothing else runs; `extra_info` has it by the workers' CPU time too, which other load hardly touches.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import pytest

from auvsim.campaign import execution, plan
from auvsim.campaign.folder import Folder
from auvsim.campaign.local import Pool

TRIALS = 60
busy: dict[int, float] = {}  # median CPU time of a trial by the number of workers [s]


@pytest.fixture(params=[1, 2], ids=["one worker", "two workers"])
def pool(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Pool]:
    """Processes that have run trials before."""
    with Pool(request.param) as started:
        execution.run(plan.parse({"trials": 2 * started.jobs, "base": {"duration": 30.0}}), tmp_path / "warm", started)
        yield started


@pytest.mark.benchmark(group=f"{TRIALS} trials")
def test_campaign(benchmark, pool: Pool, tmp_path: Path) -> None:
    """Whole docking trials of the default plan; without --benchmark-enable only a taste of them."""
    keys = {"trials": TRIALS} if benchmark.enabled else {"trials": 4, "base": {"duration": 20.0}}
    done: Folder = benchmark.pedantic(execution.run, (plan.parse({"seed": 31, **keys}), tmp_path / "c", pool), rounds=1)
    records = list(done.records())
    assert len(records) == keys["trials"]
    assert [record["error"] for record in records] == [None] * len(records)
    simulated, wall = sum(record["summary"]["time"] for record in records), done.state["wall_time"]
    busy[pool.jobs] = median(record["run"]["cpu_time"] for record in records)
    benchmark.extra_info |= {
        "CPU time of a trial [s]": round(busy[pool.jobs], 3),
        "times real time in all": round(simulated / wall),
        "minutes for 1000 trials": round(1000.0 * wall / len(records) / 60.0, 2),
    }
    if len(busy) == 2:
        benchmark.extra_info["efficiency by CPU time"] = round(busy[1] / busy[2], 3)
    if benchmark.enabled:
        print("\n" + json.dumps(benchmark.extra_info))
