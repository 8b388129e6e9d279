"""Speed of a whole closed-loop trial, without video, and of its parts.

Run with `pytest tests/benchmarks/test_trial_speed.py --benchmark-enable`: every part of the first group is what one
trial spends on it, so the ratios that are printed in brackets are shares; `extra_info` has how many times faster than
real time that is.
"""

from collections.abc import Iterator
from functools import cache
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import pytest

from auvsim.analysis.summary import summarise
from auvsim.base.reading import Reading
from auvsim.data import log
from auvsim.data.log import Log
from auvsim.navigation.estimate import Estimate
from auvsim.physics import planar_fit
from auvsim.physics.truth import Truth
from auvsim.simulation import sampling, scenario
from auvsim.simulation.run import Simulation, run
from auvsim.vehicles.actuation import Commands

SEED = 7
ROUNDS = 5


class Recording(Simulation):
    """A run that keeps what its parts were given."""

    def __init__(self) -> None:
        super().__init__(plan(), SEED)
        self.kept_truths: list[Truth] = []
        self.readings: list[list[Reading]] = []
        self.estimates: list[Estimate | None] = []
        self._act, self.agents[0].act = self.agents[0].act, self._keep  # type: ignore[method-assign]

    def _keep(self, time: float, latched: str | None, log: Any) -> Any:
        agent = self.agents[0]
        self.kept_truths.append(self.truths[agent.name])
        self.readings.append(agent._readings)
        self.estimates.append(agent.estimate)
        return self._act(time, latched, log)


@cache
def plan(factory: str = "augmented_ekf") -> scenario.Scenario:
    """The trial that is timed."""
    values = sampling.merge(sampling.default_plan(), {"estimator": {"kind": factory}})
    return scenario.parse(sampling.draw(values, SEED))


@pytest.fixture(scope="module")
def recording() -> Recording:
    """The trial, run once; everything is compiled by then."""
    loop = Recording()
    while not loop.over:
        loop.step()
    return loop


@pytest.fixture(scope="module")
def finished(recording: Recording) -> Log:
    """Its log."""
    return recording.log.finish("complete", wall_time=1.0)


@pytest.fixture
def report(benchmark, recording: Recording) -> Iterator[None]:
    """Notes how many times faster than real time it was."""
    yield
    if benchmark.stats:  # none with --benchmark-disable
        benchmark.extra_info["real_time_factor"] = round(recording.time / benchmark.stats["min"])


@pytest.mark.benchmark(group="one trial")
def test_whole_trial(benchmark, report, recording: Recording) -> None:
    trial = benchmark.pedantic(run, (plan(),), {"seed": SEED}, rounds=ROUNDS, warmup_rounds=1)
    assert summarise(trial.vehicle())["docked"]
    assert trial.vehicle()["truth"]["time"][-1] == recording.time


@pytest.mark.benchmark(group="one trial")
def test_setting_up(benchmark, report) -> None:
    """Models read and compiled, estimator made."""
    assert benchmark.pedantic(Simulation, (plan(), SEED), rounds=ROUNDS).ticks == 0


@pytest.mark.benchmark(group="one trial")
def test_physics_alone(benchmark, report, recording: Recording) -> None:
    """The same number of steps, straight ahead."""
    world = Simulation(plan(), SEED).world
    per_tick = round(plan().rates.physics / plan().rates.control)

    def steps() -> None:
        for _ in range(recording.ticks):
            world.advance(per_tick)

    benchmark.pedantic(steps, rounds=ROUNDS)
    assert world.time > 0.0


@pytest.mark.benchmark(group="one trial")
def test_truth_and_sensors(benchmark, report, recording: Recording) -> None:
    """The truth of every tick, and what is measured and sent of it."""
    truths = recording.kept_truths

    def sense(simulation: Simulation) -> int:
        (agent,), count = simulation.agents, 0
        for tick, (previous, now) in enumerate(pairwise(truths), start=1):
            simulation.world.truth(agent.name)
            agent.sense(tick, now, simulation.world, simulation.log)
            simulation.network.poll({agent.name: previous}, {agent.name: now})
            agent.receive(simulation.network.deliver(agent.name, now.time), now.time, simulation.log)
            count += len(agent._readings)
        return count

    fresh = {"setup": lambda: ((Simulation(plan(), SEED),), {}), "rounds": ROUNDS}
    assert benchmark.pedantic(sense, **fresh) > 3 * recording.ticks - 10


@pytest.mark.benchmark(group="one trial")
@pytest.mark.parametrize("factory", ["augmented_ekf", "imm"])
def test_estimator(benchmark, report, recording: Recording, factory: str) -> None:
    """All its updates, late fixes inserted and replayed."""
    every = round(plan().rates.control / plan().rates.filter)
    starts = range(0, recording.ticks - every + 1, every)
    batches = [list(chain.from_iterable(recording.readings[k : k + every])) for k in starts]
    navigator = Simulation(plan(factory), SEED).agents[0].navigator

    def updates() -> Estimate:
        navigator.reset()
        for k, batch in enumerate(batches, start=1):
            last = navigator.update(k / plan().rates.filter, batch, (), Commands(0.0, 0.0, 0.0))
        return last

    assert benchmark.pedantic(updates, rounds=ROUNDS).initialised


@pytest.mark.benchmark(group="one trial")
def test_guidance_and_control(benchmark, report, recording: Recording) -> None:
    """Every tick: readings observed, a heading and a depth wanted, fins and shaft commanded."""
    period = 1.0 / plan().rates.control

    def act(simulation: Simulation) -> Commands:
        (agent,) = simulation.agents
        for k, (readings, estimate) in enumerate(zip(recording.readings, recording.estimates, strict=True), start=1):
            agent.controller.observe(readings)
            agent.estimate, agent._to_mission = estimate, readings
            commands = agent.act(k * period, None, simulation.log)
            if commands is not None:
                simulation.world.command(agent.name, agent.vehicle.actuation.allocate(commands))
        return agent.commands

    fresh = benchmark.pedantic(act, setup=lambda: ((Simulation(plan(), SEED),), {}), rounds=ROUNDS)
    assert fresh.shaft_speed > 0.0


@pytest.mark.benchmark(group="one trial")
def test_making_the_log(benchmark, report, recording: Recording) -> None:
    """Rows to arrays, at the end."""
    found = benchmark.pedantic(lambda made: made.log.finish("complete"), setup=lambda: ((_run(),), {}), rounds=ROUNDS)
    assert len(found.vehicle()["truth"]["time"]) == recording.ticks + 1


def _run() -> Simulation:
    """The trial, run and not yet finished."""
    simulation = Simulation(plan(), SEED)
    while not simulation.over:
        simulation.step()
    return simulation


@pytest.mark.benchmark(group="round a trial")
def test_planar_fit(benchmark) -> None:
    """The planar model of the vehicle, once a process."""

    def anew() -> planar_fit.PlanarFit:
        planar_fit._fit_model.cache_clear()
        return planar_fit.fit_planar_model("remus100", 1.0, plan().water.density)

    assert benchmark.pedantic(anew, rounds=ROUNDS).shaft_speed > 0.0


@pytest.mark.benchmark(group="round a trial")
def test_writing_the_log(benchmark, finished: Log, tmp_path: Path) -> None:
    benchmark.pedantic(log.write, (finished, tmp_path / "trial.nc"), rounds=ROUNDS)
    assert (tmp_path / "trial.nc").stat().st_size > 100_000


@pytest.mark.benchmark(group="round a trial")
def test_summary(benchmark, finished: Log) -> None:
    assert benchmark.pedantic(summarise, (finished.vehicle(),), rounds=ROUNDS)["docked"]
