"""`auvsim reproduce paper3`: cooperative localisation with late packets, as tables, CSV and pictures."""

import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.cli.papers import verdicts
from auvsim.cli.report import StudyProgress
from auvsim.cli.run import output_folder
from auvsim.reproduce.paper3 import acceptance, claims, figures, products
from auvsim.reproduce.paper3 import study as paper3
from auvsim.reproduce.paper3.methods import METHODS
from auvsim.reproduce.paper3.study import MUJOCO, ROWS

WIDTH = 150  # of the widest table [columns]
SHOWN = ("dr", "ekf", "dekf", "iiru", "sc", "rt", "choosing", "oracle")
LEGEND = (
    "rms of the position at the end [m]. EKF ignores the delay (E2); DEKF goes back to where the range was taken; IIRU "
    "is the paper's; SC-EKF clones the pose at each pulse; SC-RT uses a pulse at once and puts it right later; oracle "
    "is SC-EKF without delay. NEES is of the position per axis, 1 if consistent. Bound: posterior Cramér-Rao."
)
NORMS = (
    "The paper's d is the norm of its listed x and y, whose signs differ: they are means over runs (or one run), not "
    "rms. A signed mean of 50 runs varies by the rms over 7, so none is judged."
)


def run(*, quick: bool, seed: int, out: Path, jobs: int | None, truth: str | None = None) -> int:
    """Runs the study on the truth asked for, or on both; prints it and fills the folder.

    Returns:
        The exit code.

    Raises:
        InputError: For a folder that cannot be written to.
    """
    rows = [name for name in ROWS if truth is None or name.startswith(MUJOCO) == (truth == "mujoco")]
    with output_folder(out):
        with StudyProgress() as progress:
            study = paper3.reproduce(seed, quick=quick, jobs=jobs, rows=rows, progress=progress)
        written = products.write(study, out)
    show(study)
    print(f"written: {', '.join(str(path) for path in written)}", file=sys.stderr)
    return 0


def show(study: paper3.Study) -> None:
    """Prints the study's tables."""
    console = Console(markup=False, width=max(WIDTH, Console().width))
    judged = acceptance.verdicts(study)
    console.print(study_table(study))
    console.print(LEGEND)
    console.print(csv_table("paper 3, table 1: error of the leader at 1000 s", products.table1_rows(study)))
    console.print(csv_table("paper 3, table 2: error of the follower at 1000 s", products.table2_rows(study)))
    console.print(NORMS)
    console.print(claims_table(study))
    for line in loss_lines(study):
        console.print(line)
    if math.isfinite(limit := figures.threshold(study)):
        console.print(f"A delay of packets counts as noise up to {limit:.1f} s: then ignoring it costs 10 %.")
    console.print(verdicts.table("paper 3", judged, {name: row.title for name, row in ROWS.items()}))
    console.print(verdicts.count(judged))


def study_table(study: paper3.Study) -> Table:
    """One line for each row of the study."""
    form = "quick" if study.quick else "full"
    table = Table(title=f"paper 3: the study, {form}, seed {study.seed}", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("row", no_wrap=True)
    headings = [METHODS[key].title for key in SHOWN]
    for heading in ("runs", *headings, "bound", "NEES IIRU", "NEES SC", "NEES RT"):
        table.add_column(heading, justify="right", min_width=max(map(len, (*heading.split(), "1234"))))
    for name, results in study.results.items():
        cells = [_number(results[key].rms) if key in results else "-" for key in SHOWN]
        cells.append(_number(study.bounds[name][-1]) if name in study.bounds else "-")
        cells += [_number(float(results[k].nees.mean())) if k in results else "-" for k in ("iiru", "sc", "rt")]
        count = len(next(iter(results.values())).final)
        table.add_row(ROWS[name].title, str(count), *cells)
    return table


def loss_lines(study: paper3.Study) -> Iterator[str]:
    """What the loss of 60 % of the packets costs, for each noise set that was run."""
    for noise in ("fine", "paper"):
        if {f"loss_{noise}_60%", f"loss_{noise}_0%"} <= study.results.keys():
            lossy, whole = (study.results[f"loss_{noise}_{loss}"] for loss in ("60%", "0%"))
            found = (f"{METHODS[key].title} {lossy[key].rms / whole[key].rms:.2f}" for key in ("sc", "rt"))
            yield f"60 % of packets lost, {noise} noise, rms over that without loss: {', '.join(found)}."


def _number(value: float) -> str:
    """With three digits, or whole."""
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def csv_table(title: str, rows: Iterable[Sequence[Any]]) -> Table:
    """The lines of a CSV file, as printed."""
    heading, *lines = rows
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in heading:
        text = name.removesuffix("_m").replace("_", " ") + (" [m]" if name.endswith("_m") else "")
        table.add_column(text, justify="left" if name in ("scene", "quantity", "method") else "right")
    for line in lines:
        table.add_row(*(f"{v:.1f}" if isinstance(v, float | np.floating) else str(v) for v in line))
    return table


def claims_table(study: paper3.Study) -> Table:
    """One line for each claim of the paper."""
    table = Table(title="paper 3: what it claims", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("claim", "measured", "holds"):
        table.add_column(heading, overflow="fold")
    for claim in claims.claims(study):
        table.add_row(claim.claim, claim.measured, "yes" if claim.holds else "NO")
    return table
