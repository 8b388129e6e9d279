"""`auvsim compare`: a log beside the simulation of its vehicle, on one page."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Holds the simulation of a vehicle against a log: gap.html, gap.png and a table.

    The log's rudder and shaft drive the vehicle in MuJoCo; errors of the position, open loop, by the distance run;
    spectra of the residuals; the coefficient that explains them best; a grade. The log is a trial's, a table, or a
    bag, as of `auvsim identify`.
    """

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]
    """Log of manoeuvres, best of some minutes with steps of rudder and shaft."""
    vehicle: str
    """Vehicle in models/, or the path of its MJCF file."""
    parameters: Annotated[Path | None, tyro.conf.arg(metavar="FILE.yaml")] = None
    """Parameters of a planar model (from `auvsim identify`) to hold against the log, too."""
    columns: Annotated[Path | None, tyro.conf.arg(metavar="MAP.yaml")] = None
    """Meaning of columns or topics, as of `auvsim identify`."""
    out: Path = Path("out")
    """Folder of gap.html and gap.png."""


def run(command: Compare) -> int:
    """Compares, writes the page, prints the table and returns the exit code.

    Raises:
        InputError: In one line, what cannot be used.
    """
    from auvsim.cli.report import IdentificationProgress
    from auvsim.cli.run import output_folder
    from auvsim.comparison import gap, sheet
    from auvsim.identification import readers
    from auvsim.physics import planar_sets
    from auvsim.vehicles import library

    library.vehicle(command.vehicle)
    parameters = None
    if command.parameters is not None:
        parameters = planar_sets.read(command.parameters).planar()
    readings = readers.read([command.log], columns=command.columns)
    measured = not any("only the rudder's command is there" in note for note in readings.notes)
    with output_folder(command.out):
        with IdentificationProgress() as progress:
            found = gap.compare(
                readings.records, command.vehicle, parameters, measured=measured, notes=readings.notes,
                progress=lambda share: progress("comparing", share),
            )  # fmt: skip
        written = sheet.write(found, command.out)
    show(found)
    print(f"written: {', '.join(map(str, written))}", file=sys.stderr)
    return 0


def show(found) -> None:
    """Prints the verdict, the errors by horizon, and the coefficients that explain most."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from auvsim.comparison import sheet

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
    for heading in ("coefficient", "change", "95 % interval", "share explained"):
        terms.add_column(heading, justify="right")
    for e in found.explanations[:5]:
        terms.add_row(e.name, f"{e.change:+.1%}", f"{e.low:+.1%} to {e.high:+.1%}", f"{e.share:.1%}")
    console.print(terms)
