"""Speed of a whole closed-loop trial, without video, and of its parts.

Run with `pytest tests/benchmarks/test_trial_speed.py --benchmark-enable`: every part of the first group is what one
trial spends on it, so the ratios that are printed in brackets are shares; `extra_info` has how many times faster than
real time that is.
"""

from collections.abc import Iterator
from functools import cache
from itertools import chain, pairwise
from pathlib import Path

import pytest

from auvsim.base.reading import Reading
from auvsim.data import log
from auvsim.data.log import TrialLog
from auvsim.missions.docking import metrics
from auvsim.navigation.navigator import Commands, Estimate
from auvsim.physics import planar_fit
from auvsim.physics.truth import Truth
from auvsim.simulation import sampling, scenario
from auvsim.simulation.trial import Loop, run_trial

SEED = 7
ROUNDS = 5


class Recording(Loop):
    """A trial that keeps what its parts were given."""

    def __init__(self) -> None:
        super().__init__(plan(), SEED, 0)
        self.truths: list[Truth] = []
        self.readings: list[list[Reading]] = []
        self.estimates: list[Estimate | None] = []

    def _sense(self, previous: Truth, now: Truth) -> list[Reading]:
        readings = super()._sense(previous, now)
        self.truths.append(now)
        self.readings.append(readings)
        return readings

    def _act(self) -> None:
        self.estimates.append(self._estimate)
        super()._act()


@cache
def plan(factory: str = "augmented_ekf") -> scenario.Scenario:
    """The trial that is timed."""
    values = sampling.merge(sampling.default_plan(), {"estimator": {"factory": factory}})
    return scenario.parse(sampling.draw(values, SEED))


@pytest.fixture(scope="module")
def recording() -> Recording:
    """The trial, run once; everything is compiled by then."""
    loop = Recording()
    while not loop.over:
        loop.step()
    return loop


@pytest.fixture(scope="module")
def finished(recording: Recording) -> TrialLog:
    """Its log."""
    return recording.finish("complete", 1.0)


@pytest.fixture
def report(benchmark, recording: Recording) -> Iterator[None]:
    """Notes how many times faster than real time it was."""
    yield
    if benchmark.stats:  # none with --benchmark-disable
        benchmark.extra_info["real_time_factor"] = round(recording.time / benchmark.stats["min"])


@pytest.mark.benchmark(group="one trial")
def test_whole_trial(benchmark, report, recording: Recording) -> None:
    trial = benchmark.pedantic(run_trial, (plan(),), {"seed": SEED}, rounds=ROUNDS, warmup_rounds=1)
    assert metrics.summarise(trial).docked
    assert trial["truth"]["time"][-1] == recording.time


@pytest.mark.benchmark(group="one trial")
def test_setting_up(benchmark, report) -> None:
    """Models read and compiled, estimator made."""
    assert benchmark.pedantic(Loop, (plan(), SEED, 0), rounds=ROUNDS).ticks == 0


@pytest.mark.benchmark(group="one trial")
def test_physics_alone(benchmark, report, recording: Recording) -> None:
    """The same number of steps, straight ahead."""
    world = Loop(plan(), SEED, 0).world
    per_tick = round(plan().rates.physics / plan().rates.control)

    def steps() -> None:
        for _ in range(recording.ticks):
            world.advance(per_tick)

    benchmark.pedantic(steps, rounds=ROUNDS)
    assert world.time > 0.0


@pytest.mark.benchmark(group="one trial")
def test_truth_and_sensors(benchmark, report, recording: Recording) -> None:
    """The truth of every tick, and what is measured and sent of it."""
    loops = []

    def fresh() -> tuple[tuple[Loop], dict]:
        loops.append(Loop(plan(), SEED, 0))
        return (loops[-1],), {}

    def sense(loop: Loop) -> int:
        count = 0
        for previous, now in pairwise(recording.truths):
            loop.world.truth()
            loop.ticks += 1
            count += len(loop._sense(previous, now))
        return count

    assert benchmark.pedantic(sense, setup=fresh, rounds=ROUNDS) > 3 * recording.ticks - 10


@pytest.mark.benchmark(group="one trial")
@pytest.mark.parametrize("factory", ["augmented_ekf", "imm"])
def test_estimator(benchmark, report, recording: Recording, factory: str) -> None:
    """All its updates, late fixes inserted and replayed."""
    every = round(plan().rates.control / plan().rates.filter)
    starts = range(0, recording.ticks - every + 1, every)
    batches = [list(chain.from_iterable(recording.readings[k : k + every])) for k in starts]
    navigator = Loop(plan(factory), SEED, 0).navigator

    def updates() -> Estimate:
        navigator.reset()
        for k, batch in enumerate(batches, start=1):
            last = navigator.update(k / plan().rates.filter, batch, Commands(0.0, 0.0, 0.0))
        return last

    assert benchmark.pedantic(updates, rounds=ROUNDS).initialised


@pytest.mark.benchmark(group="one trial")
def test_guidance_and_control(benchmark, report, recording: Recording) -> None:
    """Every tick: readings observed, a heading and a depth wanted, fins and shaft commanded."""
    period = 1.0 / plan().rates.control

    def act(loop: Loop) -> Commands:
        guidance, autopilot = loop.guidance, loop.autopilot
        for k, (readings, estimate) in enumerate(zip(recording.readings, recording.estimates, strict=True), start=1):
            guidance.observe(readings)
            autopilot.observe(readings)
            heading, depth = autopilot.heading, autopilot.depth
            if heading is not None and depth is not None:
                commands = autopilot.command(*guidance.update(k * period, estimate, heading, depth, False))
                loop.world.command(*commands)
        return commands

    fresh = benchmark.pedantic(act, setup=lambda: ((Loop(plan(), SEED, 0),), {}), rounds=ROUNDS)
    assert fresh.shaft_speed > 0.0


@pytest.mark.benchmark(group="one trial")
def test_making_the_log(benchmark, report, recording: Recording) -> None:
    """Rows to arrays, at the end."""
    trial = benchmark.pedantic(recording.log.finish, ("complete",), rounds=ROUNDS)
    assert len(trial["truth"]["time"]) == recording.ticks + 1


@pytest.mark.benchmark(group="round a trial")
def test_condense(benchmark) -> None:
    """The planar model of the vehicle, once a process."""

    def anew() -> planar_fit.PlanarFit:
        planar_fit._fit_model.cache_clear()
        return planar_fit.fit_planar_model("remus100", 1.0, plan().world.water_density)

    assert benchmark.pedantic(anew, rounds=ROUNDS).shaft_speed > 0.0


@pytest.mark.benchmark(group="round a trial")
def test_writing_the_log(benchmark, finished: TrialLog, tmp_path: Path) -> None:
    benchmark.pedantic(log.write, (finished, tmp_path / "trial.nc"), rounds=ROUNDS)
    assert (tmp_path / "trial.nc").stat().st_size > 100_000


@pytest.mark.benchmark(group="round a trial")
def test_summary(benchmark, finished: TrialLog) -> None:
    assert benchmark.pedantic(metrics.summarise, (finished,), rounds=ROUNDS).docked
