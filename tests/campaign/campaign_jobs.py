"""What worker processes do in the tests; light, so that a process starts in a moment."""

import ctypes
import os
import signal
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

ENDINGS = ("kill", "crash", "exit", "hang")


def misbehave(task: Any) -> Any:
    """Returns the task, unless it is the name of an ending."""
    match task:
        case "kill":
            os.kill(os.getpid(), 9)
        case "crash":
            ctypes.string_at(0)
        case "exit":
            sys.exit(3)
        case "hang":
            while True:
                time.sleep(1.0)
        case "stop":
            os.kill(os.getpid(), signal.SIGSTOP)
        case ("sleep", seconds):
            time.sleep(seconds)
        case ("minder", marks, number):  # kills, once for each number, who minds this process
            mark = Path(marks, str(number))
            if not mark.exists():
                mark.touch()
                os.kill(os.getppid(), 9)
                time.sleep(60.0)
        case ("process",):
            return os.getpid(), {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    return task


def nothing(tasks: Any) -> None:
    """In the place of `trials.prepare`."""


def trial(task: Any) -> SimpleNamespace:
    """In the place of `trials.run`: at once, and docked in two of three trials.

    Settings of an estimator of one's own say which trial is to end how, and where to leave marks of attempts.
    """
    values = task.values
    settings = values["estimator"]["settings"]
    name, numbers, folder = settings["ending"], settings["trials"], settings["marks"]
    number = task.trial
    if Path(folder).is_dir():
        with open(Path(folder, f"{task.variant}-{number}"), "a") as marks:
            marks.write("x")
    if number in numbers:
        if name == "once":  # a stranger kills the process, the first time
            if Path(folder, f"{task.variant}-{number}").stat().st_size == 1:
                os.kill(os.getpid(), 9)
        elif name == "slow":
            time.sleep(0.3)
        else:
            misbehave(name)
    speed = values["current"]["speed"]
    docked = number % 3 != 2
    quality = {"samples": 10, "position_rms": speed, "nees_per_dof": 1.0, "coverage_95": 0.95}
    quality |= dict.fromkeys(("heading_rms_deg", "velocity_rms", "current_rms"))
    summary = {
        "status": "complete", "docked": docked, "docked_first": docked and number % 2 == 0, "time": 100.0 + speed,
        "failure_reason": None if docked else "timeout", "failure_text": None if docked else "too late",
        "attempts": 1 + number % 2, "miss_distance": speed / 3.0, "cross_track": None, "vertical": None,
        "heading_error_deg": 0.1, "crossings": [], "contact_impulse": 0.0, "peak_contact_force": 0.0,
        "estimate": {"all": quality}, "fixes_sent": 9, "fixes_lost": 1, "fixes_outliers": 0, "fixes_refused": 0,
    }  # fmt: skip
    run = {"wall_time": time.monotonic(), "cpu_time": 0.0, "host": "here", "process": os.getpid()}
    return SimpleNamespace(summary=summary, error=None, run=run, log=b"log" * 1000 if task.keep == "all" else None)
