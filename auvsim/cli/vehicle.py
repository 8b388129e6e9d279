"""`auvsim vehicle`: what a vehicle does, as a table and a page; or a vehicle's MJCF from a data sheet."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.cli import report
from auvsim.cli.run import output_folder
from auvsim.vehicles import library, model_files
from auvsim.vehicles.actuation import Thrusters


def show(name: str, out: Path | None) -> int:
    """Runs the trials of a vehicle, prints their numbers and draws the page; returns the exit code.

    Args:
        name: In models/, or the path of an MJCF file.
        out: Folder of the page, `<vehicle>.png`; None: no page.

    Raises:
        InputError: The vehicle cannot be used, or the folder cannot be written to.
    """
    from auvsim.analysis import vehicle_page
    from auvsim.physics import hydrodynamics, soundness
    from auvsim.simulation import hover_trials, sea_trials

    thrusters = isinstance(library.vehicle(name).actuation, Thrusters)
    soundness.check(name, hydrodynamics.SEA_WATER)
    soundness.check_step(name, "implicitfast", sea_trials.RATE, hydrodynamics.SEA_WATER)
    with report.StudyProgress() as progress:
        trials = (hover_trials if thrusters else sea_trials).run(name, lambda share: progress(share, 1.0))
    table = Table("", "value", "unit", title=f"{trials.model}: {'hovering' if thrusters else 'sea'} trials")
    for row in vehicle_page.rows(trials):
        table.add_row(*row)
    Console(width=report.WIDTH).print(table)
    if out is not None:
        path = out / f"{trials.model}.png"
        with output_folder(out):
            vehicle_page.draw(trials, path)
        print(f"written: {path}")
    return 0


def from_sheet(path: Path, out: Path) -> int:
    """Makes a vehicle of a data sheet: `<name>.xml`, README.md and controller.yaml in a folder; returns the exit code.

    Raises:
        InputError: The sheet is wrong, or the folder cannot be written to.
    """
    from auvsim.vehicles import from_sheet as made_of
    from auvsim.vehicles import sheet

    made = sheet.read(path)
    if made.name in model_files.shipped("vehicle"):
        raise InputError(f"{path}: name: '{made.name}' is a vehicle that auvsim ships; give it a name of its own")
    try:
        made_of.numbers(made)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    model = out / f"{made.name}.xml"
    if model.exists():
        raise InputError(f"{model} exists; give another folder with --out, or remove it")
    with output_folder(out):
        texts = {
            f"{made.name}.xml": made_of.mjcf(made),
            "README.md": made_of.readme(made),
            "controller.yaml": made_of.controller(made),
        }
        for name, text in texts.items():
            with whole(out / name) as partial:
                partial.write_text(text, encoding="utf-8")
    table = Table("", "value", "unit", "from", title=f"{made.name}: from {path}")
    for number in made_of.numbers(made):
        table.add_row(number.name, number.text, number.unit, number.source)
    Console(width=report.WIDTH).print(table)
    print(f"written: {model}, README.md and controller.yaml beside it; `auvsim vehicle {model}` shows what it does")
    return 0
