"""`auvsim reproduce paper2`: a follower in an unknown current, by ranges to a leader; tables, CSV and pictures."""

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
from auvsim.reproduce.paper2 import acceptance, products, study
from auvsim.reproduce.paper2.scores import Result

WIDTH = 160  # of the widest table [columns]
# What the paper reports of its one run, where it gives numbers or shapes.
PAPER = (
    ("dead reckoning's error at the end", '"very large"', lambda r: f"{r['reckoning'].final:.0f} m"),
    ("largest error up to 500 s", "150 m", lambda r: f"{r['paper'].peak:.0f} m"),
    ("current error at 500 s", "about 0", lambda r: f"{r['paper'].current_500:.3f} m/s"),
    ("current error at 1000 s", "about 0", lambda r: f"{r['paper'].current_1000:.3f} m/s"),
    ("rms after 500 s", '"markedly improved"', lambda r: f"{r['paper'].rms:.1f} m"),
    ("rms at the end", '"markedly improved"', lambda r: f"{r['paper'].final:.1f} m"),
)
LEGEND = (
    "rms [m] is of the position after 500 s, beside half its 95 % interval; U [m/s] is the median current error; "
    "lost: more than 200 m off at the end; NEES: of the position per axis, 1 if consistent; flagged: runs whose filter "
    "says that the geometry cannot tell. Reading A is the paper's algorithm as printed, C has the derivative that "
    "belongs to its covariance."
)


def run(*, quick: bool, seed: int, out: Path, jobs: int | None, truth: str | None = None) -> int:
    """Runs the study on the truth asked for, or on both; prints it and fills the folder.

    Returns:
        The exit code.

    Raises:
        InputError: For a folder that cannot be written to.
    """
    truth = truth or "both"
    with output_folder(out):
        with StudyProgress() as progress:
            done = study.reproduce(
                seed, quick=quick, jobs=jobs, planar=truth != "mujoco", mujoco=truth != "planar", progress=progress
            )
        written = products.write(done, out)
    show(done)
    print(f"written: {', '.join(str(path) for path in written)}", file=sys.stderr)
    return 0


def show(done: study.Study) -> None:
    """Prints the study's tables."""
    console = Console(markup=False, width=max(WIDTH, Console().width))
    judged = acceptance.verdicts(done)
    console.print(study_table(done))
    console.print(LEGEND)
    if done.results:
        console.print(paper_table(done.results))
        console.print(claims_table(done))
    titles = {name: row.title for name, row in study.ROWS.items()}
    titles |= {f"mujoco_{name}": f"MuJoCo, {title}" for name, title in study.PHYSICAL_TITLES.items()}
    console.print(verdicts.table("paper 2", judged, titles | {"mujoco": "MuJoCo, nothing wrong"}))
    console.print(verdicts.count(judged))


def study_table(done: study.Study) -> Table:
    """One line for each row and filter."""
    form = "quick" if done.quick else "full"
    table = Table(title=f"paper 2: the study, {form}, seed {done.seed}", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("row", "filter"):
        table.add_column(heading, no_wrap=True)
    for heading in (
        "runs", "rms [m]", "+-", "final", "bound", "/ bound", "NEES", "U 500 s", "U 1000 s", "lost", "flagged"
    ):  # fmt: skip
        table.add_column(heading, justify="right", no_wrap=True)
    before = ""
    for _, _, title, method, r, (bound, _) in products.lines(done):
        table.add_row(
            "" if title == before else title, method, str(r.runs), _number(r.rms),
            _number(1.96 * r.rms_deviation), _number(r.final),
            _number(bound), _number(r.rms / bound), _number(r.nees), f"{r.current_500:.3f}", f"{r.current_1000:.3f}",
            f"{r.lost:.0%}", f"{r.rank_2 + r.rank_3:.0%}",
        )  # fmt: skip
        before = title
    return table


def paper_table(results: Mapping[str, Mapping[str, Result]]) -> Table:
    """What the paper reports beside what its filter comes to here, in each set of noise."""
    table = Table(title="paper 2: its figures 2 to 5 in numbers", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("quantity", no_wrap=True)
    for heading in ("paper", *acceptance.NOISES):
        table.add_column(heading, justify="right", no_wrap=True)
    for quantity, paper, measured in PAPER:
        table.add_row(quantity, paper, *(measured(results[noise]) for noise in acceptance.NOISES))
    return table


def claims_table(done: study.Study) -> Table:
    """The paper's claims, and whether they hold."""
    table = Table(title="paper 2: its claims", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("claim", "measured", "holds"):
        table.add_column(heading)
    for claim in acceptance.claims(done):
        table.add_row(claim.claim, claim.measured, "yes" if claim.holds else "NO")
    return table


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"
