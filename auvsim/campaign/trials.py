"""One trial of a campaign: what a worker does with it, and what becomes of it."""

import os
import platform
import re
import time
import traceback
from collections.abc import Mapping, Sequence
from typing import Any

from auvsim.base.errors import InputError
from auvsim.campaign.task import Result, Task
from auvsim.data.log import VERSIONS, TrialLog, pack
from auvsim.data.recorder import version as installed
from auvsim.missions.docking import metrics
from auvsim.simulation import scenario

WARM_UP = 30.0  # simulated time in which all is called, and so compiled, that a whole trial calls [s]
ADDRESS = re.compile(r"0x[0-9a-fA-F]{6,}")  # of an object in memory: other in every process


def run(task: Task) -> Result:
    """Runs a trial; whatever it raises becomes part of the result."""
    started, busy = time.perf_counter(), time.process_time()
    log, summary, error = None, None, None
    try:
        log = _simulate(task.values, task.seed, task.trial)
        summary = metrics.summarise(log).to_dict()
        summary.pop("real_time_factor")
    except Exception as raised:
        error = {
            "type": type(raised).__name__,
            "message": _same_each_time(str(raised)),
            "traceback": _same_each_time(traceback.format_exc()),
        }
    failed = summary is None or not summary["docked"]
    wanted = log is not None and (task.keep == "all" or (task.keep == "failures" and failed))
    return Result(
        summary=summary,
        error=error,
        run={
            "wall_time": time.perf_counter() - started,
            "cpu_time": time.process_time() - busy,
            "host": platform.node(),
            "process": os.getpid(),
        },
        log=pack(log) if wanted and log is not None else None,
    )


def prepare(what: tuple[Sequence[Task], Mapping[str, str]]) -> str | None:
    """Sees that trials can be set up, and compiles what is not compiled yet, so that it is done once.

    Args:
        what: The trials, and the versions of packages that there must be.

    Returns:
        What is wrong with a vehicle, dock, estimator, number or version; None if nothing is.
    """
    from auvsim.navigation import navigator as navigation
    from auvsim.physics import fluid
    from auvsim.simulation.trial import Loop

    tasks, wanted = what
    for package, version in versions().items():
        if version != wanted[package]:
            return f"the workers have {package} {version}, and this is {wanted[package]}; install the same"
    cold = not fluid.is_warm()
    for task in tasks:
        parsed = scenario.parse(task.values)
        try:
            Loop(parsed, task.seed, task.trial)
        except InputError as error:
            return f"variant '{task.variant}': {error}"
        if cold and parsed.estimator.factory in navigation.FACTORIES:  # not what may do anything
            _simulate(task.values, task.seed, task.trial, WARM_UP)
    return None


def record(task: Task, result: Result, keys: Sequence[str], retries: int) -> dict[str, Any]:
    """What the file of a finished trial holds.

    Args:
        task: The trial.
        result: What became of it.
        keys: Dotted keys of its scenario that are worth a column.
        retries: How often it was run again, because its process had died.
    """
    return {
        "variant": task.variant,
        "trial": task.trial,
        "seed": task.seed,
        "scenario": {key: _at(task.values, key) for key in keys},
        "summary": result.summary,
        "error": result.error,
        "run": {**result.run, "retries": retries},
    }


def versions() -> dict[str, str]:
    """Of the packages on which results depend."""
    return {package: installed(package) for package in VERSIONS.values()}


def _simulate(values: Mapping, seed: int, trial: int, duration: float | None = None) -> TrialLog:
    from auvsim.simulation.trial import run_trial

    parsed = scenario.parse(values)
    if duration is not None:
        parsed = parsed.model_copy(update={"duration": min(duration, parsed.duration)})
    return run_trial(parsed, seed=seed, trial=trial)


def _same_each_time(text: str) -> str:
    """Text of an error without what is of one process only, and fit for any file."""
    return ADDRESS.sub("0x...", text).encode(errors="replace").decode()


def _at(values: Any, key: str) -> Any:
    """The value of a dotted key; None where there is no such key."""
    for part in key.split("."):
        if isinstance(values, Mapping):
            values = values.get(part)
        elif isinstance(values, list | tuple) and part.isdigit() and int(part) < len(values):
            values = values[int(part)]
        else:
            return None
    return values
