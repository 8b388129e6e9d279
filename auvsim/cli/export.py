"""`auvsim export`: a log as MCAP with ROS 2 messages, as CSV, or for MATLAB."""

import sys
from pathlib import Path
from typing import Literal

from auvsim.base.errors import InputError
from auvsim.data.log import read
from auvsim.exchange import csv_file, mat_file, mcap_file


def run(log: Path, *, to: Literal["mcap", "csv", "mat"], out: Path | None) -> int:
    """Writes the files, says which, and returns the exit code.

    Raises:
        InputError: The log cannot be read, is empty, or a package is missing.
    """
    path = log / "trial.nc" if log.is_dir() else log
    content = read(path)
    if not any(len(content.vehicle(name)["truth"]["time"]) > 1 for name in content.vehicles):
        raise InputError(f"{path}: the log is empty: no vehicle has moved in it")
    target = out or path.with_suffix(f".{to}")
    if target.suffix.lower() != f".{to}":
        raise InputError(f"command line: --out {target}: give a name that ends in .{to}")
    target.parent.mkdir(parents=True, exist_ok=True)
    write = {"mcap": mcap_file.write, "csv": csv_file.write, "mat": mat_file.write}[to]
    print(f"written: {', '.join(map(str, write(content, target)))}", file=sys.stderr)
    return 0
