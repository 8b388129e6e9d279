"""The five trials, and the one place that knows what runs a scenario and writes its log."""

import re
from pathlib import Path
from typing import NamedTuple

from auvsim.data import log
from auvsim.simulation import scenario
from auvsim.simulation.run import run as run_scenario

HERE = Path(__file__).parent
START = re.compile(r"(start:.*?\brange: )([0-9.]+)(.*?\bheading_deg: )([-0-9.]+)", re.DOTALL)  # of the vehicle


class Case(NamedTuple):
    """A trial by its scenario, which stands in a file as a user writes it, and the seed of its noise."""

    file: str
    seed: int
    trial: int = 0
    check_step: bool = True


CASES = {
    "docking": Case("docking.yaml", seed=3),
    "turning": Case("turning.yaml", seed=8),
    "zigzag": Case("zigzag.yaml", seed=5),
    "outliers": Case("outliers.yaml", seed=1),
    "diverging": Case("diverging.yaml", seed=3, check_step=False),
}


def run(case: Case, path: Path, *, shift: float = 0.0, duration: float | None = None) -> None:
    """Runs a case and writes its whole log.

    Args:
        case: The trial.
        path: Where the log goes.
        shift: By how much the vehicle starts farther from the dock [m] and turned to starboard [deg].
        duration: Time limit instead of the file's [s].
    """
    text = (HERE / case.file).read_text(encoding="utf-8")
    if shift:
        text = START.sub(lambda m: f"{m[1]}{float(m[2]) + shift!r}{m[3]}{_turned(float(m[4]), shift)!r}", text, count=1)
    if duration is not None:
        text = re.sub(r"(?m)^duration: [0-9.]+", f"duration: {duration}", text)
    found = run_scenario(
        scenario.from_yaml(text, case.file), seed=case.seed, trial=case.trial, check_step=case.check_step
    )
    log.write(found, path)


def _turned(heading: float, shift: float) -> float:
    """A heading [deg] shifted; one of 0 stays where the shift is smaller than any number that a scenario may give."""
    return heading + shift if heading or shift >= 1e-9 else heading
