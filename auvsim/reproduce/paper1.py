"""The study of paper 1, whole: every row and filter over paired seeds, on all cores."""

import math
import multiprocessing
import os
import signal
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from typing import Any

import numpy as np

from auvsim.reproduce.paper1_runs import Conditions, in_order, simulate, track
from auvsim.reproduce.paper1_study import FILTERS, ROWS, Result, Row, Score, bound, score, summarise
from estimators.types import Array

REFERENCE = "paper"
SETTLED = tuple(name for name in ROWS if name.startswith("settled"))
CURVES = ("regular_best", "paper", "imm_biases")  # of figures 6 and 7
CURVE_RUNS = 20
QUICK_BOUND = 1500.0  # the bound settles sooner than the errors' mean does [s]
SEEDS_APART = 1_000_000  # more than any row has runs: no two seeds of a study share a run


@dataclass(frozen=True, kw_only=True, slots=True)
class Curves:
    """Error curves of figures 6 and 7, in which the current turns. Of the first of the runs, the current as well."""

    times: Array  # (k,) [s]
    errors: Mapping[str, Array]  # by filter: horizontal (runs, k) [m]; NaN before the first fix
    current: Array  # (k, 2) true north, east [m/s]
    currents: Mapping[str, Array]  # by filter: estimated (k, 2) [m/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """What the study came to."""

    seed: int
    quick: bool
    runs: Mapping[str, int]  # by row
    results: Mapping[str, Mapping[str, Result]]  # by row and filter
    bounds: Mapping[str, float]  # rms [m] of the posterior Cramér-Rao bound, by settled row
    worst_delivery: float  # largest difference of states, late and out-of-order delivery from prompt delivery
    curves: Curves


@dataclass(frozen=True, kw_only=True, slots=True)
class _Task:
    key: tuple
    work: Callable[[], Any]
    weight: float  # what it takes, in simulated seconds of all filters


def reproduce(
    seed: int = 0,
    *,
    quick: bool = False,
    jobs: int | None = None,
    rows: Sequence[str] = tuple(ROWS),
    runs: int | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> Study:
    """Runs the study in processes of their own; its outcome does not depend on how many.

    Args:
        seed: Of all runs, 0 or more.
        quick: Few runs a row: a first look, with wide intervals.
        jobs: Processes; all cores if None.
        rows: Which of ROWS.
        runs: Of every row, instead of what the row says.
        progress: Called with what is done and the total of it.
    """
    counts = {name: runs or (ROWS[name].quick_runs if quick else ROWS[name].runs) for name in rows}
    done = _run(_tasks(seed, quick, counts), jobs, progress)
    results, bounds = {}, {}
    for name in rows:
        scores: list[dict[str, Score]] = [done["scores", _conditions_key(name), k][name] for k in range(counts[name])]
        reference = [each[REFERENCE] for each in scores]
        results[name] = {f: summarise([each[f] for each in scores], reference) for f in FILTERS}
        squares = [value for key, value in done.items() if key[:2] == ("bound", name)]
        if squares:
            bounds[name] = math.sqrt(float(np.mean(squares)))
    return Study(
        seed=seed,
        quick=quick,
        runs=counts,
        results=results,
        bounds=bounds,
        worst_delivery=done["delivery",],
        curves=done["curves",],
    )


def run_seed(seed: int, number: int) -> int:
    """Seed of a run of the study; the rows share it, so that they too are paired."""
    return SEEDS_APART * seed + number


def _conditions_key(name: str) -> str:
    """The first row that has the conditions of this one: the same runs, seen through another window."""
    return next(other for other, row in ROWS.items() if row.conditions == ROWS[name].conditions)


def _tasks(seed: int, quick: bool, counts: Mapping[str, int]) -> list[_Task]:
    tasks = []
    for key, group in groupby(sorted(counts, key=_conditions_key), key=_conditions_key):
        rows = {name: ROWS[name] for name in group}
        duration = ROWS[key].conditions.duration
        for k in range(max(counts[name] for name in rows)):
            tasks.append(_Task(key=("scores", key, k), work=partial(_scores, rows, run_seed(seed, k)), weight=duration))
    for name in counts:
        if name not in SETTLED:
            continue
        row, number = ROWS[name], 1 if quick else counts[name]
        if quick:
            conditions = replace(row.conditions, duration=QUICK_BOUND)
            row = replace(row, conditions=conditions, window=(row.window[0], QUICK_BOUND))
        for k in range(number):
            work = partial(bound, row, run_seed(seed, k))
            tasks.append(_Task(key=("bound", name, k), work=work, weight=1.6 * row.conditions.duration))
    tasks.append(_Task(key=("delivery",), work=partial(_delivery, run_seed(seed, 0)), weight=300.0))
    tasks.append(_Task(key=("curves",), work=partial(_curves, seed), weight=0.25 * CURVE_RUNS * 300.0))
    return sorted(tasks, key=lambda task: -task.weight)  # the long ones first, so that no core waits at the end


def _run(tasks: Sequence[_Task], jobs: int | None, progress: Callable[[float, float], None] | None) -> dict[tuple, Any]:
    total, sofar = sum(task.weight for task in tasks), 0.0
    # Spawned, not forked: BLAS and numba may hold threads and locks of this process.
    pool = ProcessPoolExecutor(
        min(jobs or os.cpu_count() or 1, len(tasks)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_die_of_interrupts,
    )
    try:
        futures: dict[Future, _Task] = {pool.submit(task.work): task for task in tasks}
        done = {}
        for future in as_completed(futures):
            task = futures[future]
            done[task.key] = future.result()
            sofar += task.weight
            if progress:
                progress(sofar, total)
        return {task.key: done[task.key] for task in tasks}
    finally:
        pool.shutdown(cancel_futures=True)


def _die_of_interrupts() -> None:
    """Ctrl-C reaches the workers too: they go at once and silently, and the parent says what happened."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _scores(rows: Mapping[str, Row], seed: int) -> dict[str, dict[str, Score]]:
    """The scores of all filters in one run, through the window of each row."""
    run = simulate(next(iter(rows.values())).conditions, seed)
    scores: dict[str, dict[str, Score]] = {name: {} for name in rows}
    for key, candidate in FILTERS.items():
        followed = track(run, candidate.make(), **candidate.options)
        for name, row in rows.items():
            scores[name][key] = score(row, run, followed)
    return scores


def _delivery(seed: int) -> float:
    """Largest difference that late, shuffled delivery makes in the end, of the filters behind the delay buffer."""
    run = simulate(replace(ROWS["late"].conditions, late=0.5), seed)
    run = replace(run, fixes=tuple(fix for fix in run.fixes if fix.received < run.times[-1]))
    prompt, worst = in_order(run), 0.0
    for key in ("paper", "augmented", "unscented", "imm", "imm_biases"):
        late, soon = (track(each, FILTERS[key].make()) for each in (run, prompt))
        worst = max(worst, float(np.abs(late.means[-1] - soon.means[-1]).max()))
        worst = max(worst, float(np.abs(late.covariances[-1] - soon.covariances[-1]).max()))
    return worst


def _curves(seed: int) -> Curves:
    conditions: Conditions = ROWS["turn_40"].conditions
    runs = [simulate(conditions, run_seed(seed, k)) for k in range(CURVE_RUNS)]
    tracks = {key: [track(run, FILTERS[key].make(), **FILTERS[key].options) for run in runs] for key in CURVES}
    return Curves(
        times=runs[0].times,
        errors={key: np.array([t.errors(r) for t, r in zip(ts, runs, strict=True)]) for key, ts in tracks.items()},
        current=runs[0].states[:, 6:8],
        currents={key: ts[0].means[:, 6:8] for key, ts in tracks.items()},
    )
