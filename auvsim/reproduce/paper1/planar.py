"""The study of paper 1, whole: every row and filter over paired seeds, on all cores."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from auvsim.base.tasks import Progress, Task, run_tasks
from auvsim.reproduce.paired import results, run_seed, score_tasks, scores
from auvsim.reproduce.paper1.runs import Conditions, in_order, simulate, track
from auvsim.reproduce.paper1.study import FILTERS, ROWS, Result, Row, Score
from auvsim.reproduce.paper1.yardsticks import batch_and_filter, bound
from estimators.core.types import Array

SETTLED = tuple(name for name in ROWS if name.startswith("settled"))
CURVES = ("regular_best", "paper", "imm_biases")  # of figures 6 and 7
CURVE_RUNS = 20
QUICK_BOUND = 1500.0  # the bound settles sooner than the errors' mean does [s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Curves:
    """Error curves of figures 6 and 7, in which the current turns. Of the first of the runs, the current as well."""

    times: Array  # (k,) [s]
    errors: Mapping[str, Array]  # by filter: horizontal (runs, k) [m]; NaN before the first fix
    current: Array  # (k, 2) true north, east [m/s]
    currents: Mapping[str, Array]  # by filter: estimated (k, 2) [m/s]


@dataclass(frozen=True, kw_only=True, slots=True)
class Study:
    """Results of the study."""

    seed: int
    quick: bool
    runs: Mapping[str, int]  # by row
    results: Mapping[str, Mapping[str, Result]]  # by row and filter
    bounds: Mapping[str, float]  # rms [m] of the posterior Cramér-Rao bound, by settled row
    batches: Mapping[str, float]  # rms of the batch estimate relative to the augmented filter, by settled row
    worst_delivery: float  # largest difference of states, late and out-of-order delivery from prompt delivery
    curves: Curves


def reproduce(
    seed: int = 0,
    *,
    quick: bool = False,
    jobs: int | None = None,
    rows: Sequence[str] = tuple(ROWS),
    runs: int | None = None,
    progress: Progress | None = None,
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
    done = run_tasks(_tasks(seed, quick, counts), jobs, progress)
    bounds, batches = {}, {}
    for name in rows:
        if name in SETTLED:
            bounds[name] = math.sqrt(np.mean([value for key, value in done.items() if key[:2] == ("bound", name)]))
            pairs = [value for key, value in done.items() if key[:2] == ("batch", name)]
            of_batch, of_filter = np.sum(pairs, axis=0)
            batches[name] = math.sqrt(of_batch / of_filter)
    return Study(
        seed=seed,
        quick=quick,
        runs=counts,
        results=results(done, ROWS, counts),
        bounds=bounds,
        batches=batches,
        worst_delivery=done["delivery",],
        curves=done["curves",],
    )


def _tasks(seed: int, quick: bool, counts: Mapping[str, int]) -> list[Task]:
    tasks = score_tasks(ROWS, counts, seed, _scores)
    for name in counts:
        if name not in SETTLED:
            continue
        for k in range(counts[name]):
            work = partial(batch_and_filter, ROWS[name], run_seed(seed, k))
            tasks.append(Task(key=("batch", name, k), work=work, weight=300.0))
        row, number = ROWS[name], 1 if quick else counts[name]
        if quick:
            conditions = replace(row.conditions, duration=QUICK_BOUND)
            row = replace(row, conditions=conditions, window=(row.window[0], QUICK_BOUND))
        for k in range(number):
            work = partial(bound, row, run_seed(seed, k))
            tasks.append(Task(key=("bound", name, k), work=work, weight=1.6 * row.conditions.duration))
    tasks.append(Task(key=("delivery",), work=partial(_delivery, run_seed(seed, 0)), weight=300.0))
    tasks.append(Task(key=("curves",), work=partial(_curves, seed), weight=0.25 * CURVE_RUNS * 300.0))
    return tasks


def _scores(rows: Mapping[str, Row], seed: int) -> dict[str, dict[str, Score]]:
    """The scores of all filters in one run, through the window of each row."""
    run = simulate(next(iter(rows.values())).conditions, seed)
    return scores(rows, run, {key: track(run, c.make(), **c.options) for key, c in FILTERS.items()})


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
