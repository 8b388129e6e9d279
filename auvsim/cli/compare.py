"""`auvsim compare`: a log beside the simulation of its vehicle, on one page."""

import sys
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.cli.report import IdentificationProgress
from auvsim.cli.run import output_folder
from auvsim.comparison import gap, sheet
from auvsim.identification import readers
from auvsim.physics import planar_sets
from auvsim.vehicles import library


def run(log: Path, *, vehicle: str, parameters: Path | None, columns: Path | None, out: Path) -> int:
    """Compares, writes the page, prints the table and returns the exit code.

    Raises:
        InputError: In one line, what cannot be used.
    """
    library.vehicle(vehicle)
    believed = planar_sets.read(parameters).planar() if parameters is not None else None
    readings = readers.read([log], columns=columns)
    measured = not any("only the rudder's command is there" in note for note in readings.notes)
    with output_folder(out):
        with IdentificationProgress() as progress:
            found = gap.compare(
                readings.records, vehicle, believed, measured=measured, notes=readings.notes,
                progress=lambda share: progress("comparing", share),
            )  # fmt: skip
        written = sheet.write(found, out)
    show(found)
    print(f"written: {', '.join(map(str, written))}", file=sys.stderr)
    return 0


def show(found) -> None:
    """Prints the verdict, the errors by horizon, and the coefficients that explain most."""
    console = Console(markup=False, highlight=False)
    console.print(found.verdict, soft_wrap=True)
    console.print(f"grades: {sheet.limits()} after {found.graded:.0f} s", style="dim", soft_wrap=True)
    errors = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("open loop after", "MuJoCo", "planar model"):
        errors.add_column(heading, justify="right")
    for row in sheet.rows(found):
        errors.add_row(*row)
    console.print(errors)
    terms = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    terms.add_column("coefficient")
    for heading in ("change", "95 % interval", "share explained"):
        terms.add_column(heading, justify="right")
    for e in found.explanations[:5]:
        terms.add_row(
            f"{e.name} {gap.MEANS[e.name]}", f"{e.change:+.1%}", f"{e.low:+.1%} to {e.high:+.1%}", f"{e.share:.1%}"
        )
    console.print(terms)
    limits = [f"{name} {change:.0%}" for name, change in found.hidden]
    text = f"changes that this log would just show: {', '.join(limits) or 'none'}"
    if found.unseen:
        text += f"; none of {', '.join(found.unseen)} by up to 100 %"
    console.print(text, style="dim", soft_wrap=True)
