"""Runs a campaign: what its folder lacks, block by block, each death charged to the trial that it belongs to."""

import os
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from auvsim.analysis.statistics import wilson
from auvsim.base.errors import InputError
from auvsim.campaign import design, table, trials
from auvsim.campaign.folder import Folder, Record, claimed
from auvsim.campaign.local import Death, Pool
from auvsim.campaign.plan import Plan, missions
from auvsim.campaign.task import Result, Task

PREPARATION = 600.0  # in which everything must be set up and compiled once [s]


class Engine(Protocol):
    """What calls functions in other processes: `local.Pool` or `cluster.Cluster`."""

    name: str
    jobs: int

    def run(self, function: Callable[[Any], Any], tasks: Iterable[Any], *, timeout: float) -> Iterator[tuple[Any, Any]]:
        """Each task with what the function returns for it, or a Death, in the order in which they end."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class Progress:
    """How far a campaign is."""

    done: int
    total: int  # at most, if there is a stopping rule
    successes: int
    errors: int  # that raised, died or hung
    rate: float  # trials a second of this run
    remaining: float  # until all are done [s]


def run(
    plan: Plan, path: Path, engine: Engine | None = None, progress: Callable[[Progress], None] | None = None
) -> Folder:
    """Runs all trials of a plan that its folder does not hold yet, and writes the tables.

    Args:
        plan: What to run.
        path: The folder, new or of the same plan.
        engine: Where; on all cores of this machine if None.
        progress: Called after each trial.

    Raises:
        InputError: For a plan or folder that cannot be used; nothing has run then.
    """
    if engine is None:
        with Pool(cores()) as pool:
            return run(plan, path, pool, progress)
    with claimed(path, plan, trials.versions()) as folder:
        prepare(plan, engine)
        started, before = time.monotonic(), folder.state.get("wall_time", 0.0)
        folder.state.update(_description(plan, engine))
        folder.save_state()
        folder.save_plan()
        tally = _Tally(plan, progress)
        try:
            folder.state["stopped"] = _run_blocks(folder, engine, tally)
            folder.state["complete"] = True
        finally:
            folder.state["wall_time"] = round(before + time.monotonic() - started, 3)
            folder.save_state()
        table.write(folder)
    return folder


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def task(plan: Plan, variant: str, trial: int) -> Task:
    """One trial of a plan."""
    settings = plan.settings
    values = plan.values(variant, trial)
    return Task(
        variant=variant,
        trial=trial,
        seed=settings.seed,
        values=values,
        missions=missions(values),
        criterion=settings.success,
        keep=settings.keep,
    )


def prepare(plan: Plan, engine: Engine) -> None:
    """Sets up, in a process of its own, the first trial of each variant and point of the grid.

    Raises:
        InputError: For what cannot be set up.
    """
    count = min(len(plan.cells), plan.settings.trials)
    first = tuple(task(plan, variant, trial) for variant in plan.variants for trial in range(count))
    for _, wrong in engine.run(trials.prepare, [(first, trials.versions())], timeout=PREPARATION):
        if isinstance(wrong, Death):
            last = wrong.output.strip().splitlines()[-1:]
            raise InputError(": ".join(["the first trials cannot be set up: the process " + wrong.reason, *last]))
        if wrong is not None:
            raise InputError(wrong)


def _run_blocks(folder: Folder, engine: Engine, tally: "_Tally") -> int | None:
    """Runs block after block; the trials of each variant after which the stopping rule was met, or None."""
    settings = folder.plan.settings
    for block in design.blocks(settings.trials, settings.stop.block if settings.stop else None):
        for record, log in _finished(folder.plan, engine, tally.missing(folder, block)):
            folder.save(record, log)
            tally.add(record)
        if settings.stop and block.stop < settings.trials and tally.narrow(settings.stop.width, block.stop):
            return block.stop
    return None


def _finished(plan: Plan, engine: Engine, places: Iterable[tuple[str, int]]) -> Iterator[tuple[Record, bytes | None]]:
    """Runs trials and gives the record and log of each."""
    keys, tasks = (*plan.drawn, *plan.compared), (task(plan, *place) for place in places)
    for each, result, retries in results(engine, tasks, plan.settings.timeout):
        yield trials.record(each, result, keys, retries), result.log


def results(engine: Engine, tasks: Iterable[Task], timeout: float) -> Iterator[tuple[Task, Result, int]]:
    """Runs trials; gives each with its result, and how often it ran again, in the order in which they end.

    A trial whose process died or hung runs a second time: nobody knows yet whether it was its own doing, a hungry
    neighbour's or the machine's. Those that died do so alone. What happens again is charged to it.
    """
    hung: list[Task] = []
    died: list[Task] = []
    for each, outcome in engine.run(trials.run, tasks, timeout=timeout):
        if isinstance(outcome, Death):
            (hung if outcome.hung else died).append(each)
        else:
            yield each, outcome, 0
    for again in ([hung] if hung else []) + [[each] for each in died]:
        for each, outcome in engine.run(trials.run, again, timeout=timeout):
            yield each, charged(outcome) if isinstance(outcome, Death) else outcome, 1


def charged(death: Death) -> Result:
    """The result of a trial that ended its process twice."""
    error = {
        "type": "Hung" if death.hung else "Died",
        "message": f"its process {death.reason}; it had not finished the first time either",
        "traceback": "",
    }
    return Result(summary=None, error=error, run={"output": death.output})


class _Tally:
    """Counts what is done."""

    def __init__(self, plan: Plan, progress: Callable[[Progress], None] | None) -> None:
        self._variants, self._trials, self._progress = plan.variants, plan.settings.trials, progress
        self._criterion = plan.settings.success
        self._successes = dict.fromkeys(plan.variants, 0)
        self._done = self._errors = self._here = 0
        self._started = time.monotonic()

    def missing(self, folder: Folder, block: range) -> Iterator[tuple[str, int]]:
        """What of a block is not done yet, one at a time; what is done already is counted on the way."""
        for trial in block:  # variants side by side: a campaign that is cut short has compared the same trials
            for variant in self._variants:
                record = folder.read(variant, trial)
                if record is None:
                    yield variant, trial
                else:
                    self._count(record)

    def add(self, record: Record) -> None:
        """Counts a trial that has just finished."""
        self._count(record)
        self._here += 1
        if self._progress:
            total = self._trials * len(self._variants)
            rate = self._here / max(time.monotonic() - self._started, 1e-9)
            self._progress(
                Progress(
                    done=self._done,
                    total=total,
                    successes=sum(self._successes.values()),
                    errors=self._errors,
                    rate=rate,
                    remaining=(total - self._done) / rate,
                )
            )

    def narrow(self, width: float, trials: int) -> bool:
        """Whether the interval of each variant's success rate over so many trials is narrower than that."""
        intervals = [wilson(successes, trials) for successes in self._successes.values()]
        return all(high - low < width for low, high in intervals)

    def _count(self, record: Record) -> None:
        self._done += 1
        self._errors += record["error"] is not None
        self._successes[record["variant"]] += trials.succeeded(*table.parts(record), self._criterion)


def _description(plan: Plan, engine: Engine) -> dict[str, Any]:
    """What campaign.json says of a campaign that runs."""
    return {
        "name": plan.settings.name,
        "seed": plan.settings.seed,
        "trials": plan.settings.trials,
        "variants": list(plan.variants),
        "engine": engine.name,
        "jobs": engine.jobs,
        "versions": trials.versions(),
        "complete": False,
        "stopped": None,
    }
