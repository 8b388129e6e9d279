"""`auvsim identify`: reads logs, fits the planar model, judges it, leaves a parameter file and a report."""

import re
import sys
from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.base.errors import InputError
from auvsim.cli import report
from auvsim.cli.run import COMPILING, output_folder
from auvsim.identification import compiled, product
from auvsim.identification import report as page
from auvsim.identification.pipeline import STEPS, Identification, identify
from auvsim.identification.readers import read
from auvsim.physics import planar_sets

PARAMETERS = "parameters.yaml"
MANY = 8  # notes that are printed; the report has all


def run(
    logs: Sequence[Path],
    *,
    out: Path,
    holdout: Sequence[Path] = (),
    columns: Path | None = None,
    vehicle: str = "remus100",
    name: str | None = None,
    steps: Sequence[str] = (),
) -> int:
    """Identifies, fills the folder, prints one table and returns the exit code.

    Raises:
        InputError: What is wrong in a log or an argument, in one line; then nothing is written.
    """
    if not logs:
        raise InputError("command line: no log; give trial logs, or CSV or NetCDF files with named columns")
    target = None if name is None else _target(name, vehicle)
    chosen = _steps(steps)
    readings = read(logs, vehicle=vehicle, columns=columns)
    judging = read(holdout, vehicle=vehicle, columns=columns) if holdout else None
    if not compiled.is_warm():
        print(COMPILING.format("identification"), file=sys.stderr)
    with output_folder(out):
        with report.IdentificationProgress() as progress:
            found = identify(readings, judging, vehicle=_stem(vehicle), model=vehicle, steps=chosen, progress=progress)
        written = _write(found, out, target)
    show(found)
    print(f"written: {', '.join(map(str, written))}", file=sys.stderr)
    return 0


def _stem(vehicle: str) -> str:
    return Path(vehicle).stem if vehicle.endswith(".xml") else vehicle


def _target(name: str, vehicle: str) -> Path:
    """Where a set of that name of the vehicle is to be."""
    if not re.fullmatch(r"[A-Za-z0-9][\w-]*", name) or name == planar_sets.CONDENSE:
        raise InputError(f"command line: --name '{name}': give a plain name such as 'lake', not a path or 'condense'")
    folder = planar_sets.folder(vehicle)
    if not folder.parent.is_dir():
        raise InputError(f"command line: --name: no folder {folder.parent} of '{vehicle}'")
    return folder / f"{name}{planar_sets.SUFFIX}"


def _steps(given: Sequence[str]) -> tuple[str, ...]:
    """The steps, in the order in which they are taken, by names with hyphens or underscores for spaces."""
    names = [step.replace("-", " ").replace("_", " ") for step in given]
    unknown = [name for name in names if name not in STEPS]
    if unknown:
        known = ", ".join(step.replace(" ", "-") for step in STEPS)
        raise InputError(f"command line: --steps: no step '{unknown[0]}'; there are {known}")
    return tuple(step for step in STEPS if step in names) if names else STEPS


def _write(found: Identification, out: Path, target: Path | None) -> list[Path]:
    """The report; the parameters too if they are better than those the fit started from."""
    written = list(page.write(found, out))
    files = [out / PARAMETERS]
    if target is not None:
        files.append(target)
    if not found.better:
        files[0].unlink(missing_ok=True)  # an earlier run's would not belong to this report
        return written
    for path in files:
        try:
            path.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{path.parent}: cannot be made: {error.strerror or error}") from None
        planar_sets.write(product.planar_set(found), path)
    return files + written


def show(found: Identification) -> None:
    """Prints notes, the table of parameters, and what the data say."""
    console = Console(markup=False, highlight=False)
    for note in found.readings.notes[:MANY]:
        console.print(note, style="dim", soft_wrap=True)
    if len(found.readings.notes) > MANY:
        console.print(f"and {len(found.readings.notes) - MANY} more notes in the report", style="dim")
    console.print(_table(found))
    for verdict in found.verdicts:
        console.print(f"{'+' if verdict.good else '!'} {verdict.text}", soft_wrap=True)
    if not found.better:
        console.print(
            f"! no {PARAMETERS} written: the parameters that the fit started from are as good", soft_wrap=True
        )


def _table(found: Identification) -> Table:
    table = Table(title=f"planar model of {found.vehicle}", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("parameter")
    for heading in ("start", "value", "95 % interval"):
        table.add_column(heading, justify="right")
    table.add_column("unit")
    table.add_column("sd", justify="right")
    for name, relative in zip(found.identifiability.names, found.identifiability.relative.tolist(), strict=True):
        low, high = found.intervals[name]
        values = (f"{getattr(p, name):.4g}" for p in (found.start, found.fit.parameters))
        known = f"{relative:.1%}" + (" weak" if name in found.identifiability.weak else "")
        table.add_row(name, *values, f"{low:.4g} to {high:.4g}", planar_sets.UNITS[name], known)
    return table
