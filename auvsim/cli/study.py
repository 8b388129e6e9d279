"""`auvsim study`: runs a study behind the figures of the README and prints its table."""

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from auvsim import studies
from auvsim.base.errors import InputError
from auvsim.cli.parsing import parse
from auvsim.cli.report import StudyProgress

WIDTH = 140  # of the widest table [columns]
LEAST = {"trials": 1, "seeds": 1, "jobs": 1, "seed": 0, "first": 0}  # least value of options of these names


def run(arguments: Sequence[str]) -> int:
    """Runs the study that the first argument names with the options that follow; without a name lists the studies.

    Returns:
        The exit code.

    Raises:
        InputError: For a study or option that does not exist, or a value that makes no sense.
    """
    if not arguments or arguments[0] in ("-h", "--help"):
        show_studies()
        return 0
    name, *rest = arguments
    study = studies.load(name)
    options = parse(study.Options, rest, f"auvsim study {name}", study.__doc__)
    check(options)
    with StudyProgress() as progress:
        shown = study.report(options, progress)
    console = Console(width=None if Console().is_terminal else WIDTH)
    for item in shown:
        console.print(item, highlight=False)
    return 0


def show_studies() -> None:
    """Prints the names of the studies, each with its line of help."""
    table = Table("auvsim study", "", box=None)
    for name, text in studies.STUDIES.items():
        table.add_row(name, text)
    console = Console(width=None if Console().is_terminal else WIDTH)
    console.print("usage: auvsim study [NAME] [options]\n", highlight=False, markup=False)
    console.print(table)
    console.print("The options of each: auvsim study NAME --help", highlight=False)


def check(options: Any) -> None:
    """Raises InputError if a number of an options dataclass is less than it may be."""
    for name, least in LEAST.items():
        value = getattr(options, name, None)
        if value is not None and value < least:
            raise InputError(f"command line: --{name} {value} must be {least} or more")
