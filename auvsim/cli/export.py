"""`auvsim export`: a log as MCAP with ROS 2 messages, as CSV, or for MATLAB."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from auvsim.base.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Export:
    """Writes a log for other programs: MCAP with ROS 2 messages and a Foxglove layout, CSV, or MATLAB.

    MCAP (pip install 'auvsim[ros]') turns NED into ENU and the body to forward, port, up, and holds the definitions of
    its messages; CSV has the columns that `auvsim identify` and `auvsim estimate` read; .mat has the whole log.
    """

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL.nc")]
    """Log of a trial, of one vehicle or several."""
    to: Literal["mcap", "csv", "mat"]
    """Format."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """File; by default beside the log, with its name. CSV of several vehicles is FILE.NAME.csv each."""


def run(command: Export) -> int:
    """Writes the files, says which, and returns the exit code.

    Raises:
        InputError: The log cannot be read, is empty, or a package is missing.
    """
    from auvsim.data.log import read
    from auvsim.exchange import csv_file, mat_file, mcap_file

    path = command.log / "trial.nc" if command.log.is_dir() else command.log
    log = read(path)
    if not any(len(log.vehicle(name)["truth"]["time"]) > 1 for name in log.vehicles):
        raise InputError(f"{path}: the log is empty: no vehicle has moved in it")
    target = command.out or path.with_suffix(f".{command.to}")
    if target.suffix.lower() != f".{command.to}":
        raise InputError(f"command line: --out {target}: give a name that ends in .{command.to}")
    target.parent.mkdir(parents=True, exist_ok=True)
    write = {"mcap": mcap_file.write, "csv": csv_file.write, "mat": mat_file.write}[command.to]
    print(f"written: {', '.join(map(str, write(log, target)))}", file=sys.stderr)
    return 0
