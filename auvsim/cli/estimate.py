"""`auvsim estimate`: any log through any estimators, side by side: one table, and a page and files for each log."""

import csv
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.cli.run import output_folder
from auvsim.data import log as logs
from auvsim.identification import readers
from auvsim.replay import judgement, page, tables, trial_logs
from auvsim.replay.judgement import Judgement
from auvsim.replay.recording import Recording
from auvsim.replay.run import Replayed, replay
from auvsim.replay.what_if import WhatIf, changed

SUMMARY = "estimators.csv"


def run(
    paths: Sequence[Path],
    *,
    estimators: Sequence[str] = (),
    what_if: WhatIf,
    smooth: bool = False,
    out: Path | None = None,
    columns: Path | None = None,
    vehicle: str = "remus100",
) -> int:
    """Replays, prints one table, fills the folder if one is given, and returns the exit code.

    Raises:
        InputError: What is wrong in a log or an argument, in one line; then nothing is written.
    """
    if not paths:
        raise InputError("command line: no log; give trial logs, or CSV or NetCDF files with named columns")
    found, notes = [], []
    for path in paths:
        more, remarks = read(path, columns=columns, vehicle=vehicle)
        found += more
        notes += remarks
    judged = []
    for recording in found:
        given = changed(recording, what_if)
        replays = [one for kind in (estimators or (None,)) for one in replay(given, kind, smooth=smooth)]
        judged.append([judgement.judge(one) for one in replays])
    show([one for several in judged for one in several], notes)
    if out is not None:
        with output_folder(out):
            written = write(judged, out)
        print(f"written: {', '.join(map(str, written))}", file=sys.stderr)
    return 0


def read(path: Path, *, columns: Path | None, vehicle: str) -> tuple[list[Recording], list[str]]:
    """The recordings of a file, and notes on it.

    Raises:
        InputError: In one line, if it cannot be used.
    """
    if readers.is_trial_log(path):
        return trial_logs.recordings(path), []
    return tables.recordings(path, columns=columns, vehicle=vehicle)


def share(text: str, option: str) -> float:
    """A share given as `40%` or `0.4`.

    Raises:
        InputError: It is neither.
    """
    try:
        value = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1.0:
        raise InputError(f"command line: {option} {text}: give a share such as 40% or 0.4")
    return value


def delay(text: str) -> float:
    """A delay given as `+5` [s].

    Raises:
        InputError: It is no number of seconds, 0 or more.
    """
    try:
        value = float(text.removesuffix("s"))
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise InputError(f"command line: --delay {text}: give seconds by which readings come later, such as +5")
    return value


def show(judgements: Sequence[Judgement], notes: Sequence[str] = ()) -> None:
    """Prints notes, a table of the estimators, and one of what each made of its sensors."""
    console = Console(markup=False, highlight=False)
    for note in notes:
        console.print(note, style="dim", soft_wrap=True)
    errors = _table("log", "estimator", "started [s]", "position rms [m]", "heading [deg]", "NEES/dof", "in 95 %")
    sensors = _table("log", "estimator", "sensor", "used", "of", "NIS/dof", "95 %", "white p")
    for one in judgements:
        q, name = one.quality, (one.replayed.recording.name, one.replayed.estimator)
        first = next((e.time for e in one.replayed.estimates if e.initialised), None)
        numbers = (None,) * 4 if q is None else (q.position_rms, q.heading_rms_deg, q.nees_per_dof, q.coverage_95)
        errors.add_row(*name, *("-" if x is None else f"{x:.2f}" for x in (first, *numbers)))
        for s in one.sensors:
            nis = (
                ("-", "-")
                if math.isnan(s.nis)
                else (f"{s.nis:.2f}", f"{s.nis_interval[0]:.2f}-{s.nis_interval[1]:.2f}")
            )
            white = "-" if math.isnan(s.whiteness) else f"{s.whiteness:.1g}"
            sensors.add_row(*name, s.sensor, str(s.readings - s.refused), str(s.readings), *nis, white)
    console.print(errors)
    console.print(sensors)


def _table(*columns: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in columns:
        table.add_column(column, justify="left" if column in ("log", "estimator", "sensor") else "right")
    return table


def write(judged: Sequence[Sequence[Judgement]], out: Path) -> list[Path]:
    """The summary, and of each recording a page and the estimates: a log of a trial, else CSV."""
    written = [out / SUMMARY]
    rows = [row for several in judged for one in several for row in _summary(one)]
    _csv(written[0], rows)
    for several in judged:
        stem = _file_name(several[0].replayed.recording.name)
        written.append(out / f"{stem}.png")
        page.draw(several, written[-1])
        for one in several:
            path = out / f"{stem}.{_file_name(one.replayed.estimator)}"
            if one.replayed.recording.vehicle is not None:
                written.append(path.with_name(path.name + ".nc"))
                logs.write(judgement.as_log(one.replayed), written[-1])
            else:
                written.append(path.with_name(path.name + ".csv"))
                _csv(written[-1], list(_estimates(one.replayed)))
    return written


def _summary(one: Judgement) -> list[dict[str, Any]]:
    """A row of each sensor, with what holds of the whole in each."""
    q = one.quality
    head = {
        "log": one.replayed.recording.name,
        "estimator": one.replayed.estimator,
        "samples": "" if q is None else q.samples,
        "position_rms_m": "" if q is None else q.position_rms,
        "heading_rms_deg": "" if q is None else q.heading_rms_deg,
        "nees_per_dof": "" if q is None else q.nees_per_dof,
        "coverage_95": "" if q is None else q.coverage_95,
    }
    return [
        head | {
            "sensor": s.sensor, "readings": s.readings, "refused": s.refused,
            "residual_rms": " ".join(f"{x:.6g}" for x in s.residual_rms), "nis_per_dof": s.nis,
            "nis_low": s.nis_interval[0], "nis_high": s.nis_interval[1], "whiteness_p": s.whiteness,
        }
        for s in one.sensors
    ] or [head]  # fmt: skip


def _estimates(replayed: Replayed) -> Any:
    """A row of each estimate: states with their units, and their standard deviations."""
    for e in replayed.estimates:
        if e.initialised:
            sigma = np.sqrt(np.maximum(np.diagonal(e.covariance), 0.0))
            states = {f"{n} [{u}]": x for (n, u), x in zip(replayed.states.items(), e.state.tolist(), strict=True)}
            bounds = {f"{n} sd [{u}]": x for (n, u), x in zip(replayed.states.items(), sigma.tolist(), strict=True)}
            yield {"time [s]": e.time, **states, **bounds, "refused": e.refused}


def _csv(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    names = list(dict.fromkeys(name for row in rows for name in row))
    with whole(path) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)


def _file_name(text: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in text.replace(", ", "."))
