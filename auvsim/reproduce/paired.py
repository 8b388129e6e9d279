"""Paired runs of a study: every filter follows the same runs, which rows of the same conditions share, on all cores."""

from collections.abc import Callable, Mapping
from functools import partial
from itertools import groupby
from typing import Any

from auvsim.base.tasks import Task
from auvsim.reproduce.paper1.runs import Track, Trajectory
from auvsim.reproduce.paper1.study import Result, Row, Score, score, summarise

REFERENCE = "paper"  # the filter by which the others' errors are divided
SEEDS_APART = 1_000_000  # more than any row has runs: no two seeds of a study share a run


def run_seed(seed: int, number: int) -> int:
    """Seed of a run of the study; the rows share it, so that they too are paired."""
    return SEEDS_APART * seed + number


def score_tasks(
    rows: Mapping[str, Row], counts: Mapping[str, int], seed: int, scores: Callable[[Mapping[str, Row], int], Any]
) -> list[Task]:
    """One task for each run of each conditions.

    Args:
        rows: All there are.
        counts: Runs, of the rows to do.
        seed: Of the study.
        scores: Gives the scores by row and filter, of rows of the same conditions in the run of a seed; what is given
            to it, and itself, must go to another process.
    """

    def conditions(name: str) -> str:
        return conditions_key(rows, name)

    tasks = []
    for key, group in groupby(sorted(counts, key=conditions), key=conditions):
        alike = {name: rows[name] for name in group}
        for k in range(max(counts[name] for name in alike)):
            work = partial(scores, alike, run_seed(seed, k))
            tasks.append(Task(key=("scores", key, k), work=work, weight=rows[key].conditions.duration))
    return tasks


def scores(rows: Mapping[str, Row], run: Trajectory, tracks: Mapping[str, Track]) -> dict[str, dict[str, Score]]:
    """By row and filter, of tracks by filter, of one run."""
    return {name: {key: score(row, run, followed) for key, followed in tracks.items()} for name, row in rows.items()}


def results(
    done: Mapping[tuple, Any], rows: Mapping[str, Row], counts: Mapping[str, int]
) -> dict[str, dict[str, Result]]:
    """By row and filter, of what `run_tasks` did of `score_tasks`."""
    found = {}
    for name, count in counts.items():
        runs: list[dict[str, Score]] = [done["scores", conditions_key(rows, name), k][name] for k in range(count)]
        reference = [run[REFERENCE] for run in runs]
        found[name] = {key: summarise([run[key] for run in runs], reference) for key in runs[0]}
    return found


def conditions_key(rows: Mapping[str, Row], name: str) -> str:
    """The first row that has the conditions of this one: the same runs, seen through another window."""
    return next(other for other, row in rows.items() if row.conditions == rows[name].conditions)
