"""`auvsim identify`: reads logs, fits models of motion, judges them, leaves parameter files and a report."""

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.base.errors import InputError
from auvsim.cli import report
from auvsim.cli.run import COMPILING, output_folder
from auvsim.identification import compiled, product
from auvsim.identification import report as page
from auvsim.identification.motion import engine, files
from auvsim.identification.motion import report as motion_page
from auvsim.identification.motion.dimensions import Dimensions
from auvsim.identification.motion.identify import MotionIdentification, identify_motion, verdicts
from auvsim.identification.pipeline import STEPS, Identification, identify
from auvsim.identification.readers import models, read, texts
from auvsim.identification.records import Readings
from auvsim.physics import motion_models, planar_sets
from auvsim.vehicles import model_files

PARAMETERS = "parameters.yaml"
MANY = 8  # notes that are printed; the report has all


def run(
    logs: Sequence[Path],
    *,
    out: Path,
    holdout: Sequence[Path] = (),
    columns: Path | None = None,
    vehicle: str | None = None,
    name: str | None = None,
    steps: Sequence[str] = (),
    quick: bool = False,
    hull: Sequence[float | None] = (None,) * 4,
    motion: bool = False,
) -> int:
    """Identifies, fills the folder, prints what was found and returns the exit code.

    With a vehicle, that of the trial logs if none is given, its planar model is fitted from its masses; without one, or
    with `motion`, a motion model whose structure the data choose.

    Raises:
        InputError: What is wrong in a log or an argument, in one line; then nothing is written.
    """
    if not logs:
        raise InputError("command line: no log; give trial logs, or CSV or NetCDF files with named columns")
    with model_files.given(texts([*logs, *holdout])):
        return _run(logs, out, holdout, columns, vehicle, name, steps, quick, _hull(hull), motion)


def _run(
    logs: Sequence[Path],
    out: Path,
    holdout: Sequence[Path],
    columns: Path | None,
    vehicle: str | None,
    name: str | None,
    steps: Sequence[str],
    quick: bool,
    known: Dimensions | None,
    motion: bool,
) -> int:
    """As `run`, with the vehicle as the logs hold it."""
    vehicle = vehicle or _vehicle([*logs, *holdout])
    if vehicle is None and (name is not None or steps):
        flag = "--name" if name is not None else "--steps"
        raise InputError(f"command line: {flag} is of a known vehicle's planar model; give --vehicle too")
    target = None if name is None or vehicle is None else _target(name, vehicle)
    chosen = _steps(steps)
    readings = read(logs, vehicle=vehicle, columns=columns)
    judging = read(holdout, vehicle=vehicle, columns=columns) if holdout else None
    warm = (vehicle is None or compiled.is_warm()) and (engine.is_warm() or not (vehicle is None or motion))
    if not warm:
        print(COMPILING.format("identification"), file=sys.stderr)
    written: list[Path] = []
    with output_folder(out):
        planar = chosen_motion = None
        with report.IdentificationProgress() as progress:
            if vehicle is not None:
                planar = identify(
                    readings, judging, vehicle=_stem(vehicle), model=vehicle, steps=chosen, progress=progress
                )
            if vehicle is None or motion:
                named = planar_sets.UNNAMED if vehicle is None else _stem(vehicle)
                given = {"name": named, "hull": known, "quick": quick, "progress": progress}
                chosen_motion = _motion(readings, judging, given, alone=planar is None)
        if planar is not None:
            written += _write(planar, out, target)
            show(planar)
        if chosen_motion is not None:
            written += _write_motion(chosen_motion, out, alone=planar is None)
            show_motion(chosen_motion, planar)
    print(f"written: {', '.join(map(str, written))}", file=sys.stderr)
    return 0


def _motion(
    readings: Readings, judging: Readings | None, given: dict[str, Any], *, alone: bool
) -> MotionIdentification | None:
    """The motion model; None, which is told, where a known vehicle's data are enough for its planar model alone."""
    try:
        return identify_motion(readings, judging, **given)
    except InputError as error:
        if alone:
            raise
        print(f"no motion model of another structure: {error}", file=sys.stderr)
        return None


def _hull(given: Sequence[float | None]) -> Dimensions | None:
    """Length, beam, draught and mass: all of them, or none."""
    numbers = [value for value in given if value is not None]
    if not numbers:
        return None
    if len(numbers) < len(given):
        raise InputError("command line: --length, --beam, --draught and --mass go together; give all four or none")
    return Dimensions(**dict(zip(("length", "beam", "draught", "mass"), numbers, strict=True)))


def _vehicle(paths: Sequence[Path]) -> str | None:
    """The vehicle of the trial logs among the files; None if there is none of them."""
    named = models(paths)
    if len(named) > 1:
        raise InputError(f"command line: logs of several vehicles, {', '.join(sorted(named))}; identify one at a time")
    return next(iter(named), None)


def _write_motion(found: MotionIdentification, out: Path, *, alone: bool) -> list[Path]:
    """The motion model's report and file; also the planar model nearest to it where no vehicle's own is fitted."""
    written = list(motion_page.write(found, out, "report" if alone else "motion"))
    model, parameters = out / motion_models.NAME, out / PARAMETERS
    model.unlink(missing_ok=True)  # an earlier run's would not belong to this report
    if found.better:
        motion_models.write(files.motion_model(found), model)
        written.insert(0, model)
    if alone:
        parameters.unlink(missing_ok=True)
        planar = files.planar_set(found) if found.better else None
        if planar is not None:
            planar_sets.write(planar, parameters)
            written.insert(0, parameters)
    return written


def _stem(vehicle: str) -> str:
    return Path(vehicle).stem if vehicle.endswith(".xml") else vehicle


def _target(name: str, vehicle: str) -> Path:
    """Where a set of that name of the vehicle is to be."""
    if not re.fullmatch(r"[A-Za-z0-9][\w-]*", name) or name == planar_sets.CONDENSE:
        raise InputError(f"command line: --name '{name}': give a plain name such as 'lake', not a path or 'condense'")
    folder = planar_sets.folder(vehicle)
    if folder.is_relative_to(model_files.PACKAGE):
        raise InputError(
            f"command line: --name keeps parameters in {folder}, within the installed package, where they would go "
            "with it; leave --name out, and give --estimator.model the parameters.yaml of --out"
        )
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
    """The report; the parameters too if nothing forbids to use them."""
    written = list(page.write(found, out))
    files = [out / PARAMETERS]
    if target is not None:
        files.append(target)
    if found.doubts:
        files[0].unlink(missing_ok=True)  # an earlier run's would not belong to this report
        return written
    for path in files:
        try:
            path.parent.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{path.parent}: cannot be made: {error.strerror or error}") from None
        planar_sets.write(product.planar_set(found), path)
    return files + written


def show_motion(found: MotionIdentification, planar: Identification | None = None) -> None:
    """Prints how far to trust the motion model, what the data say, and the tables of horizons and candidates.

    Beside a vehicle's planar model, whose notes are printed already, it says whose predictions are better.
    """
    console = Console(markup=False, highlight=False)
    if planar is not None:
        console.print(f"\nmotion model of {found.name}, its structure chosen from the data alone", soft_wrap=True)
    beside = None if planar is None else compared(planar, found)
    for good, text in verdicts(found) if beside is None else [beside, *verdicts(found)]:
        console.print(f"{'+' if good else '!'} {text}", soft_wrap=True)
    if planar is None:
        _notes(console, found.readings.notes)
    horizons = Table(
        title="open loop: position error by the distance run, and the 95 % band", box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0), caption="going on: a vehicle that goes on as it began; alone: a band by the "
        "coefficients' intervals alone",
    )  # fmt: skip
    for heading in ("after [s]", "of", "error [%]", "going on [%]", "band [%]", "holds [%]", "alone [%]"):
        horizons.add_column(heading, justify="right")
    for row in motion_page.horizon_rows(found):
        horizons.add_row(*row)
    console.print(horizons)
    candidates = Table(
        title=f"cross-validation, {found.choice.horizon:.0f} s", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    for heading in ("structure", "step", "error [%]", "standard error", ""):
        candidates.add_column(heading)
    for c in found.choice.candidates:
        own = f"{100 * c.error:.2f}", f"{100 * c.deviation:.2f}", found.choice.mark(c)
        candidates.add_row(c.structure.name, c.step, *own)
    console.print(candidates)
    if not found.better:
        console.print(f"! no {motion_models.NAME} written: going on as it began predicts as well", soft_wrap=True)


def compared(planar: Identification, motion: MotionIdentification) -> tuple[bool, str] | None:
    """Whether the motion model predicts what was held out better than the planar one; None without a common horizon."""
    seconds = {judged.seconds for judged in planar.judged}
    if motion.holdout is None or len(seconds) > 1 or not seconds <= set(motion.holdout.horizons):
        return None
    at = seconds.pop()
    error = float(motion.holdout.share[motion.holdout.horizons.index(at)])
    better = error < planar.share
    first, low, high = ("motion", error, planar.share) if better else ("planar", planar.share, error)
    text = (
        f"the {first} model predicts what was held out better: off by {low:.2%} against {high:.2%} of the distance run"
    )
    return better, f"{text} after {at:.0f} s"


def _notes(console: Console, notes: Sequence[str]) -> None:
    for note in notes[:MANY]:
        console.print(note, style="dim", soft_wrap=True)
    if len(notes) > MANY:
        console.print(f"and {len(notes) - MANY} more notes in the report", style="dim")


def show(found: Identification) -> None:
    """Prints how far to trust the model, notes, the table of parameters, and what else the data say."""
    console = Console(markup=False, highlight=False)
    first, *others = [f"{'+' if verdict.good else '!'} {verdict.text}" for verdict in found.verdicts]
    console.print(first, soft_wrap=True)
    _notes(console, found.readings.notes)
    console.print(_table(found))
    for text in others:
        console.print(text, soft_wrap=True)
    for doubt in found.doubts:
        console.print(f"! no {PARAMETERS} written: {doubt}", soft_wrap=True)


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
