"""Runs the trials that searches want: each once, kept on disk by its content, up to a budget."""

import hashlib
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from auvsim.base.errors import InputError
from auvsim.campaign import columns, execution, folder, table, trials
from auvsim.campaign.execution import Engine, Progress
from auvsim.campaign.folder import PLAN
from auvsim.campaign.plan import missions
from auvsim.campaign.task import Task
from auvsim.stress.plan import Point, StressPlan

STATE = "stress.json"


class BudgetSpentError(Exception):
    """The trials that are wanted next are more than the budget leaves."""


class Outcome(NamedTuple):
    """What became of a trial."""

    point: Point
    success: bool
    vehicles: tuple[Mapping[str, Any], ...]  # rows of the table

    def score(self, metric: str) -> float:
        """The largest value of a metric over the vehicles; infinite if none has one."""
        known = [float(row[metric]) for row in self.vehicles if row.get(metric) is not None]
        return max(known, default=math.inf)


@dataclass
class Bench:
    """Calls for outcomes of trials; what is on disk does not run again.

    Args:
        plan: Of the trials.
        path: Folder of their records.
        engine: Where they run.
        budget: Most trials, those on disk included; none: as many as are wanted.
        progress: Called after each trial.
    """

    plan: StressPlan
    path: Path
    engine: Engine
    budget: int | None = None
    progress: Callable[[Progress], None] | None = None
    planned: int = 0  # trials that the searches will want, about

    def __post_init__(self) -> None:
        self._counted: set[str] = set()
        self._successes = self._errors = self._here = 0
        self._started = time.monotonic()

    @property
    def trials(self) -> int:
        """Trials that count."""
        return len(self._counted)

    def __call__(self, points: Sequence[Point]) -> list[Outcome]:
        """The outcome of each point.

        Raises:
            BudgetSpentError: The new ones are more than the budget leaves; none of them has run.
            InputError: A record cannot be written.
        """
        keys = [_key(self.plan.plan.settings.seed, point) for point in points]
        new = {key: point for key, point in zip(keys, points, strict=True) if key not in self._counted}
        if self.budget is not None and self.trials + len(new) > self.budget:
            raise BudgetSpentError
        records = {key: self._read(key) for key in dict.fromkeys(keys)}
        tasks = (self._task(key, point) for key, point in new.items() if records[key] is None)
        for key in new:
            if (known := records[key]) is not None:
                self._count(key, known)
        for task, result, retries in execution.results(self.engine, tasks, self.plan.plan.settings.timeout):
            record = trials.record(task, result, (), retries)
            folder.write(self._place(task.variant), folder.as_json({**record, "values": task.values}))
            records[task.variant] = record
            self._here += 1
            self._count(task.variant, record)
            self._tell()
        return [self._outcome(point, records[key]) for key, point in zip(keys, points, strict=True)]

    def _outcome(self, point: Point, record: Any) -> Outcome:
        kinds, summary, error = table.parts(record)
        rows = tuple(
            columns.values_of(kind, None if summary is None else trials.vehicle_summary(summary, name), error)
            for name, kind in kinds.items()
        )
        return Outcome(point, self._succeeded(record), rows)

    def _succeeded(self, record: Any) -> bool:
        return trials.succeeded(*table.parts(record), self.plan.plan.settings.success)

    def _count(self, key: str, record: Any) -> None:
        self._counted.add(key)
        self._successes += self._succeeded(record)
        self._errors += record["error"] is not None

    def _tell(self) -> None:
        if self.progress:
            rate = self._here / max(time.monotonic() - self._started, 1e-9)
            total = max(min(self.planned, self.budget or self.planned), self.trials)
            self.progress(
                Progress(
                    done=self.trials, total=total, successes=self._successes, errors=self._errors, rate=rate,
                    remaining=(total - self.trials) / rate,
                )
            )  # fmt: skip

    def _task(self, key: str, point: Point) -> Task:
        s = self.plan.plan.settings
        return Task(
            variant=key, trial=point.trial, seed=s.seed, values=point.values, missions=missions(point.values),
            criterion=s.success,
        )  # fmt: skip

    def _place(self, key: str) -> Path:
        return self.path / "trials" / key[:2] / f"{key}.json"

    def _read(self, key: str) -> dict[str, Any] | None:
        try:
            record = json.loads(self._place(key).read_bytes())
        except (FileNotFoundError, ValueError):  # not done, or a power cut left less than the whole file
            return None
        return record if isinstance(record, dict) and record.get("variant") == key else None


@contextmanager
def claimed(plan: StressPlan, path: Path) -> Iterator[None]:
    """The folder of a stress test that is to run or to go on, also with another plan, for this process alone.

    Raises:
        InputError: If it holds something else or results of other versions, if another process runs in it, or if it
            cannot be written to.
    """
    state = path / STATE
    names = [entry.name for entry in path.iterdir()] if path.is_dir() else []
    if state.is_file():
        try:
            known = json.loads(state.read_bytes())["versions"]
        except (ValueError, KeyError, TypeError):
            known = trials.versions()
        folder.check_versions(path, known, trials.versions())
    elif any(name != folder.LOCK and ".partial" not in name for name in names):
        raise InputError(f"{path}: holds something else than a stress test; give another folder with --out")
    with folder.locked(path):
        folder.write(state, folder.as_json({"name": plan.plan.settings.name, "versions": trials.versions()}))
        folder.write(path / PLAN, plan.plan.to_yaml().encode())
        yield


def _key(seed: int, point: Point) -> str:
    """What names a trial: all that it depends on."""
    text = json.dumps([seed, point.trial, point.values], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:24]
