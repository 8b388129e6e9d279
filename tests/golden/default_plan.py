"""Trials of the default plan by the command line, and their statistics.

`python -m tests.golden.default_plan` runs 200 trials and writes them to `statistics.json`.
"""

import csv
import json
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from auvsim import cli

FILE = Path(__file__).parent / "statistics.json"
COMMAND = "python -m tests.golden.default_plan"
SEED, TRIALS = 2024, 200
# Of each trial, as the campaign's table has them; numbers to the last digit.
COLUMNS: tuple[str, ...] = (
    "trial",
    "docked",
    "attempts",
    "time",
    "cross_track",
    "vertical",
    "heading_error_deg",
    "position_rms",
    "current_rms",
    "nees_per_dof",
)

Row = dict[str, Any]


def run(trials: int, folder: Path) -> list[Row]:
    """The first trials of the plan, run as a campaign into a folder.

    Raises:
        RuntimeError: If the command line says that it failed.
    """
    plan = folder / "plan.yaml"
    plan.write_text(f"trials: {trials}\nseed: {SEED}\n", encoding="utf-8")
    code = cli.main(["campaign", str(plan), "--jobs", "2", "--out", str(folder / "campaign")])
    if code:
        raise RuntimeError(f"auvsim campaign ended with exit code {code}")
    with open(folder / "campaign" / "table.csv", encoding="utf-8", newline="") as stream:
        return [{name: json.loads(row[name] or "null") for name in COLUMNS} for row in csv.DictReader(stream)]


def share(successes: Sequence[bool]) -> dict[str, float]:
    """How many of how many, with Wilson's 95 % interval."""
    count, trials = sum(successes), len(successes)
    low, high = binomtest(count, trials).proportion_ci(method="wilson")
    return {"count": count, "trials": trials, "low": float(low), "high": float(high)}


def mean(values: Sequence[float | None]) -> dict[str, float]:
    """Mean and its standard error, over the trials that have the value."""
    known = np.array([value for value in values if value is not None])
    return {"mean": float(known.mean()), "standard_error": float(known.std(ddof=1) / math.sqrt(len(known)))}


def rms(values: Sequence[float | None]) -> float:
    """Root mean square over the trials that have the value."""
    return math.sqrt(mean([None if value is None else value**2 for value in values])["mean"])


def statistics(rows: Sequence[Row]) -> dict[str, Any]:
    """Docking, miss and consistency of trials."""
    column = {name: [row[name] for row in rows] for name in COLUMNS}
    return {
        "docked": share(column["docked"]),
        "docked_first": share([row["docked"] and row["attempts"] == 1 for row in rows]),
        "miss_across_rms": rms(column["cross_track"]),
        "miss_vertical_rms": rms(column["vertical"]),
        "nees_per_dof": mean(column["nees_per_dof"]),
        "position_rms": mean(column["position_rms"]),
        "time": mean(column["time"]),
    }


def main() -> None:
    """Writes the file, a line for each trial."""
    with tempfile.TemporaryDirectory() as folder:
        rows = run(TRIALS, Path(folder))
    head = {"command": COMMAND, "plan": "default", "seed": SEED, "columns": COLUMNS, "statistics": statistics(rows)}
    lines = ",\n  ".join(json.dumps(list(row.values())) for row in rows)
    text = json.dumps(head, indent=1)[:-2] + f',\n "rows": [\n  {lines}\n ]\n}}\n'
    FILE.write_text(text, encoding="utf-8")


def read() -> tuple[dict[str, Any], list[Row]]:
    """The kept statistics and rows."""
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    return kept["statistics"], [dict(zip(kept["columns"], row, strict=True)) for row in kept["rows"]]


if __name__ == "__main__":
    main()
