"""`auvsim reproduce`: a paper's study, by the module of `auvsim.cli.papers` that bears its name."""

from importlib import import_module
from pathlib import Path

from auvsim.base.errors import InputError


def run(paper: str, *, quick: bool, seed: int, out: Path, jobs: int | None, truth: str | None = None) -> int:
    """Runs the study of a paper, prints it and fills the folder.

    Args:
        paper: name of its module; that has `run(*, quick, seed, out, jobs, truth) -> exit code`.
        quick: few runs.
        seed: of every random number.
        out: folder of what is written.
        jobs: processes; None for all cores.
        truth: "planar", "mujoco", "both", or None for the paper's own default.

    Returns:
        The exit code.

    Raises:
        InputError: For a negative seed, no process, or a folder that cannot be written to.
    """
    if seed < 0:
        raise InputError(f"command line: --seed {seed} must be 0 or more")
    if jobs is not None and jobs < 1:
        raise InputError(f"command line: --jobs {jobs} must be 1 or more; leave it out for all cores")
    module = import_module(f"auvsim.cli.papers.{paper}")
    return module.run(quick=quick, seed=seed, out=out, jobs=jobs, truth=truth)
