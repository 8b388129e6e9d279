"""One trial of a campaign: what a worker does with it, and what becomes of it."""

import json
import os
import platform
import time
import traceback
from collections.abc import Mapping, Sequence
from typing import Any

from auvsim.analysis.summary import summarise_all
from auvsim.base import plugins
from auvsim.base.errors import InputError
from auvsim.campaign import columns
from auvsim.campaign.criterion import Criterion
from auvsim.campaign.task import Result, Task
from auvsim.data.attributes import VERSIONS
from auvsim.data.log import Log, VehicleLog, pack
from auvsim.data.recorder import version as installed
from auvsim.simulation import scenario

WARM_UP = 30.0  # simulated time in which all is called, and so compiled, that a whole trial calls [s]
ENDS = ("timeout", "diverged")  # kinds of event that end a run


def run(task: Task) -> Result:
    """Runs a trial; whatever it raises becomes part of the result."""
    started, busy = time.perf_counter(), time.process_time()
    log, summary, error = None, None, None
    try:
        log = _simulate(task.values, task.seed, task.trial)
        summary = summarised(log)
    except Exception as raised:
        error = {
            "type": type(raised).__name__,
            "message": _same_each_time(str(raised)),
            "traceback": _same_each_time(traceback.format_exc()),
        }
    failed = not succeeded(task.missions, summary, error, task.criterion)
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
    from auvsim.physics import fluid
    from auvsim.simulation.run import Simulation

    tasks, wanted = what
    for package, version in versions().items():
        if version != wanted[package]:
            return f"the workers have {package} {version}, and this is {wanted[package]}; install the same"
    cold = not fluid.is_warm()
    for task in tasks:
        parsed = scenario.parse(task.values)
        try:
            Simulation(parsed, task.seed, task.trial)
        except InputError as error:
            return f"variant '{task.variant}': {error}"
        if cold and not _has_own_part(task.values):  # such a part may do anything
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
        "missions": dict(task.missions),
        "scenario": {key: _at(task.values, key) for key in keys},
        "summary": result.summary,
        "error": result.error,
        "run": {**result.run, "retries": retries},
    }


def versions() -> dict[str, str]:
    """Of the packages on which results depend."""
    return {package: installed(package) for package in VERSIONS.values()}


def summarised(log: Log) -> dict[str, Any]:
    """The summary of a run as plain values, without what depends on the machine.

    Raises:
        InputError: A mission did not give what it declares.
    """
    # As plain values: a user's own mission may give those of NumPy.
    summary = json.loads(json.dumps(summarise_all(log), default=lambda value: value.item(), allow_nan=False))
    for name in log.vehicles:
        of_vehicle, kind = vehicle_summary(summary, name), log.vehicle(name).mission
        of_vehicle.pop("real_time_factor")
        columns.check(kind, of_vehicle)
        if "failure" not in columns.metrics_of(kind):
            of_vehicle["failure_reason"], of_vehicle["failure_text"] = _failure(log.vehicle(name))
    return summary


def vehicle_summary(summary: Mapping[str, Any], vehicle: str) -> dict[str, Any]:
    """One vehicle's part of a run's summary."""
    return summary["vehicles"][vehicle] if "vehicles" in summary else summary  # pyright: ignore[reportReturnType]


def succeeded(
    missions: Mapping[str, str],
    summary: Mapping[str, Any] | None,
    error: Mapping[str, str] | None,
    criterion: Criterion | None,
) -> bool:
    """Whether a trial had success: all of its vehicles of which the criterion asks.

    Args:
        missions: Kind of each vehicle's mission.
        summary: Of the run, None if it raised.
        error: What it raised.
        criterion: Of the plan.
    """
    answers = []
    for name, kind in missions.items():
        values = columns.values_of(kind, None if summary is None else vehicle_summary(summary, name), error)
        answers.append(columns.judged(kind, criterion, values))
    return all(answer for answer in answers if answer is not None)


def _failure(log: VehicleLog) -> tuple[str | None, str | None]:
    """What ended a vehicle's run before its mission was finished, and what the log says of it."""
    ends = [end for end in zip(log["event"]["kind"], log["event"]["text"], strict=True) if end[0] in ENDS]
    return (str(ends[-1][0]), str(ends[-1][1])) if ends else (None, None)


def _has_own_part(values: Any) -> bool:
    """Whether a part of the user's own is anywhere in a scenario."""
    if isinstance(values, Mapping):
        return plugins.is_own(str(values.get("kind", ""))) or any(map(_has_own_part, values.values()))
    return False


def _simulate(values: Mapping, seed: int, trial: int, duration: float | None = None) -> Log:
    from auvsim.simulation.run import run as simulate

    parsed = scenario.parse(values)
    if duration is not None:
        parsed = parsed.model_copy(update={"duration": min(duration, parsed.duration)})
    return simulate(parsed, seed=seed, trial=trial)


def _same_each_time(text: str) -> str:
    """Text of an error without what is of one process only, and fit for any file."""
    return plugins.same_each_time(text).encode(errors="replace").decode()


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
