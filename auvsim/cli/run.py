"""`auvsim run` and `auvsim dock`: checks everything, runs a scenario, leaves whole files."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from auvsim.base.errors import InputError
from auvsim.cli import products, report
from auvsim.data.log import Log
from auvsim.simulation.scenario import Scenario

LOG = "trial.nc"
PRODUCTS = (
    "summary.json",
    "track.png",
    "estimates.png",
    "fleet.png",
    products.MAP,
    products.MAP_DATA,
    products.SONAR,
    *products.VIDEOS,
)  # made from it
COMPILING = "compiling {} (this once; later runs find the code in the cache)"
WARM_UP = 30.0  # simulated time in which a first fix has arrived [s]


def run(scenario: Scenario, *, seed: int, trial: int, out: Path, video: bool, name: str = "docking") -> int:
    """Runs the scenario, fills the folder and returns the exit code."""
    path = out / LOG
    with output_folder(out):
        log = simulate(scenario, seed, trial, name, path)
        for product in PRODUCTS:  # what an earlier run left would not belong to this log
            (out / product).unlink(missing_ok=True)
    status = log.attributes["status"]
    if status == "interrupted":
        print(f"auvsim: interrupted; {path} holds the run up to there", file=sys.stderr)
        return 130
    try:
        values = products.summary(log, out)
        if status == "diverged":
            print(f"auvsim: {diagnosis(log)}; {path} holds the run up to there", file=sys.stderr)
            return 1
        products.plots(log, out)
        if video:
            _video(log, out)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        again = "`auvsim metrics`, `auvsim plot` and `auvsim video` make the rest from it"
        raise InputError(f"{error.filename or out}: cannot be written: {reason}; {path} is whole, {again}") from None
    report.show(values)
    return 0


def diagnosis(log: Log) -> str:
    """Why a run diverged, from its log."""
    event = log.groups["event"]
    texts = [text for kind, text in zip(event["kind"], event["text"], strict=True) if kind == "diverged"]
    return str(texts[-1]) if texts else "the simulation diverged"


@contextmanager
def output_folder(path: Path) -> Iterator[None]:
    """Makes the folder and sees that it can be written to; if what follows fails, an empty new one goes again.

    Raises:
        InputError: If it is no folder or cannot be written to.
    """
    try:
        new = [folder for folder in (path, *path.parents) if not folder.exists()]
        path.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=path):
            pass
    except OSError as error:
        reason = "it is a file, not a folder" if _is_file(path) else (error.strerror or str(error)).lower()
        raise InputError(f"{path}: cannot be written to: {reason}; give another folder with --out") from None
    try:
        yield
    except BaseException:
        for folder in new:
            if not any(folder.iterdir()):
                folder.rmdir()
        raise


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # its name is too long, or a folder above it may not be read
        return False


def simulate(scenario: Scenario, seed: int, trial: int, name: str, path: Path) -> Log:
    """Runs a scenario into a file, with a progress bar of that name; says so if it has to compile first."""
    from auvsim.physics import fluid
    from auvsim.simulation.run import run as run_scenario

    if not fluid.is_warm():
        # A short run calls, and so compiles, all that a long one does.
        with report.waiting(COMPILING.format("hydrodynamics and estimator")):
            short = scenario.model_copy(update={"duration": min(scenario.duration, WARM_UP)})
            if run_scenario(short, seed=seed, trial=trial).attributes["status"] == "interrupted":
                raise KeyboardInterrupt
    with report.TrialProgress(name) as progress:
        return run_scenario(scenario, seed=seed, trial=trial, progress=progress, path=path)


def _video(log: Log, out: Path) -> None:
    from auvsim.video import DrawingError

    try:
        products.video(log, out)
    except DrawingError:
        print(products.NO_OPENGL.format(log=out / LOG), file=sys.stderr)
