"""`auvsim reproduce paper5`: navigation by Bayes filtering of sonar frames, as tables, CSV and pictures."""

import math
import sys
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.base.errors import InputError
from auvsim.cli.papers import verdicts
from auvsim.cli.report import StudyProgress
from auvsim.cli.run import output_folder
from auvsim.reproduce.paper5 import acceptance, products
from auvsim.reproduce.paper5 import study as paper5
from auvsim.reproduce.paper5.methods import TITLES
from auvsim.reproduce.paper5.study import ROWS, Study

WIDTH = 140  # of the widest table [columns]
LEGEND = (
    "Ratios are rms position errors relative to dead reckoning in the same runs, with half their 95 % interval. "
    "Odometry errs by a bias and white noise, both uniform: 0.2 and 0.1 m/s, 0.7 and 0.3 deg/s. The pose at the "
    "start is known; a compass bias would turn path and map together, and no sonar sees it. NEES is of the pose at "
    "the end, 1 if consistent. Rows with rocks, or rough without any, have frames of the ray-cast imaging sonar."
)


def run(*, quick: bool, seed: int, out: Path, jobs: int | None, truth: str | None = None) -> int:
    """Runs the study, prints it and fills the folder.

    Returns:
        The exit code.

    Raises:
        InputError: For MuJoCo's truth, which this study does not have, or a folder that cannot be written to.
    """
    if truth not in (None, "planar"):
        raise InputError(f"command line: --truth {truth}: paper 5 has its own synthetic frames only, --truth planar")
    with output_folder(out):
        with StudyProgress() as progress:
            study = paper5.reproduce(seed, quick=quick, jobs=jobs, progress=progress)
        written = products.write(study, out)
    show(study)
    print(f"written: {', '.join(str(path) for path in written)}", file=sys.stderr)
    return 0


def show(study: Study) -> None:
    """Prints the study's tables."""
    console = Console(markup=False, width=max(WIDTH, Console().width))
    judged = acceptance.verdicts(study)
    console.print(study_table(study))
    console.print(LEGEND)
    if "drift" in study.results:
        console.print(growth_table(study))
    console.print(verdicts.table("paper 5", judged, {name: row.title for name, row in ROWS.items()}))
    console.print(verdicts.count(judged))


def study_table(study: Study) -> Table:
    """One line for each row and method."""
    form = "quick" if study.quick else "full"
    table = Table(title=f"paper 5: the study, {form}, seed {study.seed}", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("row", "method"):
        table.add_column(heading, no_wrap=True)
    for heading in ("runs", "rms [m]", "end [m]", "heading [deg]", "ratio", "NEES", "x real time", "refused"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, results in study.results.items():
        for k, (method, r) in enumerate(results.items()):
            head = (ROWS[name].title, TITLES[method], str(study.runs[name])) if k == 0 else ("", TITLES[method], "")
            half = "" if math.isnan(r.ratio_deviation) else f"±{1.96 * r.ratio_deviation:.3f}"
            numbers = (f"{r.rms:.2f}", f"{r.end:.2f}", f"{math.degrees(r.heading):.2f}", f"{r.ratio:.3f}{half}")
            rest = (_number(r.nees), "-" if math.isnan(r.speed) else f"{r.speed:.0f}", str(sum(r.refused.values())))
            table.add_row(*head, *numbers, *rest)
        table.add_section()
    return table


def growth_table(study: Study) -> Table:
    """How errors grow with time."""
    title = "paper 5: growth of the rms error with time t, from 30 to 240 s"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("system")
    table.add_column("as t to the power", justify="right")
    table.add_column("after 240 s [m]", justify="right")
    _, *lines = products.growth_rows(study)
    for name, exponent, end in lines:
        table.add_row(name, f"{exponent:.2f}", f"{end:.1f}")
    return table


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.2f}" if value < 9.995 else f"{value:.3g}"
