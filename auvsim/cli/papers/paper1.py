"""`auvsim reproduce paper1`: navigation to a dock by USBL, printed as tables and left as CSV and pictures."""

import math
import sys
from collections.abc import Mapping
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.cli.papers import verdicts
from auvsim.cli.report import StudyProgress
from auvsim.cli.run import output_folder
from auvsim.reproduce import paired
from auvsim.reproduce.paper1 import acceptance as paper1_acceptance
from auvsim.reproduce.paper1 import mujoco as paper1_mujoco
from auvsim.reproduce.paper1 import planar as paper1
from auvsim.reproduce.paper1 import products as paper1_products
from auvsim.reproduce.paper1 import truths as paper1_truths
from auvsim.reproduce.paper1.acceptance import SHORT
from auvsim.reproduce.paper1.mujoco import MujocoStudy
from auvsim.reproduce.paper1.study import FILTERS, ROWS, Result
from auvsim.reproduce.paper1.truths import DRAWN
from auvsim.reproduce.verdict import Verdict

WIDTH = 150  # of the widest table [columns]
LEGEND = (
    "Ratios are rms errors relative to the paper's filter in the same runs. REG same noise as the paper's filter, REG* "
    "its best, neither delay nor current; DLY delay only; CUR current only (eq. 11); A, A0 current as two states with "
    "1e-5, 1e-8 m2/s3; IMM two of A with outliers inside. NEES is of the position per axis, 1 if consistent."
)


def run(*, quick: bool, seed: int, out: Path, jobs: int | None, truth: str | None = None) -> int:
    """Runs the study on the truth asked for, or of both, only the planar one if quick; prints it and fills the folder.

    Returns:
        The exit code.

    Raises:
        InputError: For a folder that cannot be written to.
    """
    truth = truth or ("planar" if quick else "both")
    planar = mujoco = None
    with output_folder(out):
        if truth != "mujoco":
            with StudyProgress() as progress:
                planar = paper1.reproduce(seed, quick=quick, jobs=jobs, progress=progress)
        if truth != "planar":
            with StudyProgress() as progress:
                mujoco = paper1_mujoco.reproduce(seed, quick=quick, jobs=jobs, progress=progress)
        written = [] if planar is None else paper1_products.write(planar, out)
        written += [] if mujoco is None else paper1_truths.write(planar, mujoco, out)
    if planar is not None:
        show(planar)
    if mujoco is not None:
        show_mujoco(planar, mujoco)
    print(f"written: {', '.join(str(path) for path in written)}", file=sys.stderr)
    return 0


def show(study: paper1.Study) -> None:
    """Prints the study's tables."""
    # Units stand in brackets. A narrow terminal breaks lines, where rich would break numbers.
    console = Console(markup=False, width=max(WIDTH, Console().width))
    judged = paper1_acceptance.verdicts(study)
    console.print(study_table(study, judged))
    console.print(LEGEND)
    console.print(acceptance_table(judged))
    console.print(table1(study))
    console.print(verdicts.count(judged))


def show_mujoco(planar: paper1.Study | None, mujoco: MujocoStudy) -> None:
    """Prints the tables of the study on MuJoCo's truth, and beside that on the planar model's if there is one."""
    console = Console(markup=False, width=max(WIDTH, Console().width))
    console.print(mujoco_table(mujoco))
    if planar is not None:
        console.print(truths_table(planar, mujoco))


def study_table(study: paper1.Study, judged: list[Verdict]) -> Table:
    """One line for each row of the study."""
    form = "quick" if study.quick else "full"
    table = Table(title=f"paper 1: the study, {form}, seed {study.seed}", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("row", no_wrap=True)
    others = [key for key in FILTERS if key != paired.REFERENCE]
    for heading in ("runs", "paper [m]", *(SHORT[key] for key in others), "NEES A0", "NEES IMM+", "A0 / bound"):
        table.add_column(heading, justify="right")
    table.add_column("met")
    for name, results in study.results.items():
        bound = study.bounds.get(name, math.nan)
        numbers = [results[key].ratio for key in others]
        numbers += [_nees(results, "augmented_constant"), _nees(results, "imm_biases")]
        numbers.append(results["augmented_constant"].rms / bound)
        rms = f"{results[paired.REFERENCE].rms:.3f}"
        marks = [v.met for v in judged if v.row == name]
        mark = "yes" if all(marks) else f"{sum(marks)} of {len(marks)}"
        table.add_row(ROWS[name].title, str(study.runs[name]), rms, *map(_number, numbers), mark)
    return table


def mujoco_table(study: MujocoStudy) -> Table:
    """One line for each row of the study on MuJoCo's truth."""
    form = "quick" if study.quick else "full"
    title = f"paper 1: the study on MuJoCo's truth, {form}, seed {study.seed}"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("row", no_wrap=True)
    others = [key for key in next(iter(study.results.values())) if key != paired.REFERENCE]
    judged = [key for key in paper1_products.DOTS if key in others]
    bounded = [paired.REFERENCE, *(key for key in others if key == "imm_biases")]
    brief = {key: SHORT[key].removesuffix(" biases") for key in FILTERS}
    headings = [brief[key] for key in others] + [f"NEES {brief[key]}" for key in judged]
    for heading in ("runs", "paper [m]", *headings, *(f"{brief[key]} / bound" for key in bounded)):
        table.add_column(heading, justify="right", min_width=max(map(len, heading.split())))
    for name, results in study.results.items():
        bound = study.bounds.get(name, math.nan)
        numbers = [results[key].ratio for key in others] + [_nees(results, key) for key in judged]
        numbers += [results[key].rms / bound for key in bounded]
        rms = f"{results[paired.REFERENCE].rms:.3f}"
        table.add_row(paper1_mujoco.ROWS[name].title, str(study.runs[name]), rms, *map(_number, numbers))
    return table


def truths_table(planar: paper1.Study, mujoco: MujocoStudy) -> Table:
    """One line for each row: ratios, with half their 95 % intervals, and NEES on the planar truth and on MuJoCo's."""
    table = Table(title="paper 1: planar truth and MuJoCo's", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("row", no_wrap=True)
    names = [SHORT[key] for key in DRAWN]
    for quantity in ("paper [m]", *(f"{name} / paper" for name in names), *(f"NEES {name}" for name in names)):
        for truth in ("planar", "MuJoCo"):
            table.add_column(f"{quantity}, {truth}", justify="right", min_width=9)
    for name, both in paper1_truths.beside(planar, mujoco):
        cells = [f"{r[paired.REFERENCE].rms:.3f}" if r else "-" for r in both]
        for key in DRAWN:
            cells += [_ratio(r[key]) if r else "-" for r in both]
        for key in DRAWN:
            cells += [_number(r[key].nees) if r else "-" for r in both]
        table.add_row(paper1_truths.title(name), *cells)
    return table


def acceptance_table(judged: list[Verdict]) -> Table:
    """One line for each thing to reach, with the reason if it is not."""
    titles = {paper1_acceptance.ALL: "all rows", paper1_acceptance.DELIVERY: "delivery of fixes"}
    titles |= {name: row.title for name, row in ROWS.items()}
    return verdicts.table("paper 1", judged, titles)


def table1(study: paper1.Study) -> Table:
    """The paper's Table 1 beside what its filter does here."""
    table = Table(title="paper 1, Table 1: error of its filter", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    _, *lines = paper1_products.table1_rows(study)
    for heading in ("distance [m]", "mean [m]", "paper's", "ratio", "variance [m2]", "paper's"):
        table.add_column(heading, justify="right")
    for distance, mean, paper_mean, ratio, variance, paper_variance in lines:
        values = (f"{mean:.4f}", f"{paper_mean:.4f}", f"{ratio:.2f}", f"{variance:.4f}", f"{paper_variance:.4f}")
        table.add_row(str(distance), *values)
    return table


def _nees(results: Mapping[str, Result], key: str) -> float:
    return paper1_products.claimed_nees(key, results[key])


def _ratio(result: Result) -> str:
    """With half its 95 % interval, unless it is that of a single run."""
    deviation = result.ratio_deviation
    return f"{result.ratio:.2f}" + ("" if math.isnan(deviation) else f"±{1.96 * deviation:.2f}")


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}"
