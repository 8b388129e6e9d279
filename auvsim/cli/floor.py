"""`auvsim floor`: where frames of a sonar can be matched over a floor, before a mission; table, map and data."""

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.analysis import floor_bound, floor_bound_files
from auvsim.analysis.floor_bound import STEP, FloorBound
from auvsim.base.errors import InputError
from auvsim.cli import options, report
from auvsim.cli.run import output_folder
from auvsim.simulation import sampling
from auvsim.simulation.loading import find

THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.5)  # of the table [m]
WIDTH = 96  # of the table [columns]


def run(
    floor: str, *, scenario: str | None, values: Mapping[str, Any], altitude: float | None, holds: float,
    spacing: float, out: Path,
) -> int:  # fmt: skip
    """Computes the bound, prints a table, fills the folder and returns the exit code.

    Raises:
        InputError: For a number or a file that cannot be used, or a scenario without a sonar that is matched.
    """
    for name, value, low, high in (
        ("altitude", altitude, 0.5, 1000.0),
        ("holds", holds, 0.0, 1000.0),
        ("spacing", spacing, 0.05, 1000.0),
    ):
        if value is not None and not (math.isfinite(value) and low <= value <= high and value > 0.0):
            more = "be more than 0 and at most" if low == 0.0 else f"lie in {low:g} .."
            raise InputError(f"command line: --{name} {value:g} must {more} {high:g} m")
    if Path(floor).suffix in ("", ".yaml", ".yml"):
        if scenario is not None:
            raise InputError(
                f"command line: --scenario {scenario} goes with a file of depths; {floor} is itself a scenario"
            )
        path = find(floor)
    else:
        path = find(scenario or "survey")
        values = sampling.merge({"water": {"terrain": {"kind": "grid", "file": floor}}}, values)
    plan = options.scenario(path, None, values, 0, 0)
    with output_folder(out), options.located(path, values):
        with report.waiting("judging the floor"):
            found = floor_bound.floor_bound(plan, spacing=spacing, altitude=altitude)
        written = floor_bound_files.write(found, holds, out)
    console = Console(markup=False, width=max(WIDTH, Console().width))
    console.print(table(found, holds))
    if found.coarse:
        print(
            f"auvsim: the floor's points are {found.resolution:.3g} m apart: finer relief, which frames show most, is "
            "not in it, and so the bound is too large",
            file=sys.stderr,
        )
    print(f"written: {', '.join(map(str, written))}", file=sys.stderr)
    return 0


def table(found: FloorBound, holds: float) -> Table:
    """Shares of the floor and of the planned way where a match is better than some deviations."""
    seen, on = found.sight, found.along[~np.isnan(found.along)]
    lines = Table(
        title=f"matches of frames {seen.apart:.3g} m apart, which share {seen.overlap:.0%}, from {seen.altitude:g} m "
        "above the floor",
        caption=_caption(found, holds),
        box=box.SIMPLE_HEAD,
        min_width=90,
    )
    for heading in ("better than [m]", "share of the floor", "share of the planned way"):
        lines.add_column(heading, justify="right", no_wrap=True)
    for limit in sorted({*THRESHOLDS, holds}):
        name = f"{limit:g}{' (holds)' if limit == holds else ''}"
        lines.add_row(name, _share(found.bound, limit), _share(on, limit))
    return lines


def _caption(found: FloorBound, holds: float) -> str:
    median, best, worst = (_metres(f(found.bound)) for f in (np.median, np.min, np.max))
    text = f"median {median}, best {best}, worst {worst}"
    if not len(found.along):
        return f"{text}; no way is planned"
    off = float(np.isnan(found.along).mean())
    if off == 1.0:
        return f"{text}; the planned way is off the floor"
    text += f"\nlongest stretch of the way that does not hold: {longest(~(found.along <= holds)) * STEP:.0f} m"
    return f"{text}; {off:.0%} of it is off the floor" if off > 0.0 else text


def _metres(value: float) -> str:
    return f"{value:.2g} m" if math.isfinite(value) else "infinite"


def longest(flags: NDArray[np.bool_]) -> int:
    """Length of the longest run of true values."""
    edges = np.diff(np.concatenate(([0], flags.astype(int), [0])))
    return int((np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)).max(initial=0))


def _share(values: np.ndarray, limit: float) -> str:
    return f"{float((values <= limit).mean()):.1%}" if values.size else "-"
