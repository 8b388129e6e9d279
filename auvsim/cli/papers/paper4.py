"""`auvsim reproduce paper4`: formations and ranges to leaders, printed as tables and left as CSV and pictures."""

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
from auvsim.reproduce.paper4 import acceptance, products
from auvsim.reproduce.paper4.claims import claims
from auvsim.reproduce.paper4.formations import FORMATIONS, SPEEDS, TABLE2, TABLE3, VARIANCES
from auvsim.reproduce.paper4.runs import FILTERS
from auvsim.reproduce.paper4.study import MIDDLE, STEPS, Key, Study, reproduce

WIDTH = 150  # of the widest table [columns]
LEGEND = (
    "A_RMS in metres, means over runs. The paper does not state the time between ranges: steps of 7.5 s meet "
    "its table 3. "
    "Bound: posterior Cramér-Rao bound in steady motion; none on the leaders' line (formations 3, 4, 8, 9)."
)


def run(*, quick: bool, seed: int, out: Path, jobs: int | None, truth: str | None = None) -> int:
    """Runs the study, prints it and fills the folder.

    Returns:
        The exit code.

    Raises:
        InputError: For a folder that cannot be written to, or another truth than the planar one.
    """
    if truth not in (None, "planar"):
        raise InputError(
            f"command line: --truth {truth}: paper4 has the planar truth alone; `auvsim run formation` is in MuJoCo"
        )
    with output_folder(out):
        with StudyProgress() as progress:
            study = reproduce(seed, quick=quick, jobs=jobs, progress=progress)
        written = products.write(study, out)
    show(study)
    print(f"written: {', '.join(str(path) for path in written)}", file=sys.stderr)
    return 0


def show(study: Study) -> None:
    """Prints the study's tables."""
    # Units stand in brackets. A narrow terminal breaks lines, where rich would break numbers.
    console = Console(markup=False, width=max(WIDTH, Console().width))
    judged = acceptance.verdicts(study)
    for table in (table2(study), table3(study), filters(study), line(study), cars(study), claim_table(study)):
        console.print(table)
    console.print(LEGEND)
    console.print(verdicts.table("paper 4", judged, acceptance.TITLES))
    console.print(verdicts.count(judged))


def table2(study: Study) -> Table:
    """Table 2 beside the paper's."""
    table = _table(f"paper 4, Table 2: A_RMS [m] at 4 m2, {study.runs} runs, seed {study.seed}", "formation")
    for v in SPEEDS:
        for heading in ("paper", "1 s", "7.5 s", "bound, 1 s"):
            table.add_column(f"{heading}, {v:g} m/s", justify="right")
    for f in FORMATIONS:
        cells = []
        for column, v in enumerate(SPEEDS):
            cells += [TABLE2[f][column], *(study.results[Key(T, v, MIDDLE, f)]["ekf"].a_rms for T in STEPS)]
            cells.append(study.bound(Key(1.0, v, MIDDLE, f)))
        table.add_row(str(f), *map(_number, cells))
    return table


def table3(study: Study) -> Table:
    """Table 3 beside the paper's, with steps of 1 and of 7.5 s."""
    table = _table("paper 4, Table 3: A_RMS [m] at 1 m/s", "formation")
    for v in VARIANCES:
        for heading in ("paper", "1 s", "7.5 s", "7.5 s / paper"):
            table.add_column(f"{heading}, {v:g} m2", justify="right")
    for f in FORMATIONS:
        cells = []
        for v in VARIANCES:
            ours = [study.results[Key(T, 1.0, v, f)]["ekf"].a_rms for T in STEPS]
            cells += [TABLE3[v][f - 1], *ours, ours[1] / TABLE3[v][f - 1]]
        table.add_row(str(f), *map(_number, cells))
    return table


def filters(study: Study) -> Table:
    """Other filters over the paper's, with steps of 1 s."""
    table = _table("filters: A_RMS over that of the EKF, and NEES; steps of 1 s, 4 m2", "formation")
    others = [name for name in FILTERS if name != "ekf"]
    for v in SPEEDS:
        table.add_column(f"EKF [m], {v:g} m/s", justify="right")
        for name in others:
            table.add_column(name.replace("_", " "), justify="right")
        table.add_column("NEES EKF, smooth", justify="right")
    for f in FORMATIONS:
        cells = []
        for v in SPEEDS:
            found = study.results[Key(1.0, v, MIDDLE, f)]
            cells += [_number(found["ekf"].a_rms), *(_number(found[n].a_rms / found["ekf"].a_rms) for n in others)]
            cells.append(f"{found['ekf'].nees:.2f}, {found['smooth'].nees:.2f}")
        table.add_row(str(f), *cells)
    return table


def line(study: Study) -> Table:
    """Offsets from the line, and manoeuvres."""
    table = _table("formation 8: leaders off the line, and manoeuvres; follower starts 3 m off", "leaders")
    for heading in ("offset [m]", "filter", "rms [m]", "claimed [m]", "NEES", "at the mirror image"):
        table.add_column(heading, justify="right")
    for (sides, offset), t in study.offsets.items():
        mirrored = f"{t.mirrored:.0%}" if sides == "one side" else "-"
        table.add_row(sides, f"{offset:g}", "ekf", _number(t.rms), _number(t.claimed), _number(t.nees), mirrored)
    for name, traps in study.manoeuvres.items():
        for key, t in traps.items():
            table.add_row(name, "-", key.replace("_", " "), _number(t.rms), _number(t.claimed), _number(t.nees), "-")
    return table


def cars(study: Study) -> Table:
    """The experiment with cars."""
    table = _table("cars with ultra-wide band, simulated: mean A_RMS [m]", "heading bias [deg]")
    for heading in ("runs", "worst 1", "worst 2", "right angle", "gain", "worst 2 better in one run"):
        table.add_column(heading, justify="right")
    for bias, e in study.uwb.items():
        means = [f"{cars.a_rms.mean():.3f}" for cars in e.cars.values()]
        table.add_row(f"{bias:g}", str(len(e.cars["worst 1"].a_rms)), *means, f"{e.gain:.0%}", f"{e.probability:.2f}")
    table.add_row("the paper's, one run", "1", "1.218", "0.713", "-", "41%", "-")
    return table


def claim_table(study: Study) -> Table:
    """What the paper says and what is so."""
    table = Table(
        "where", "claim", "found", "verdict", title="paper 4: its claims", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    for claim in claims(study):
        table.add_row(*claim)
    return table


def _table(title: str, first: str) -> Table:
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column(first, no_wrap=True)
    return table


def _number(value: float) -> str:
    return "-" if not math.isfinite(value) else f"{value:.2f}" if value < 99.995 else f"{value:.0f}"
