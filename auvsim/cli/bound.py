"""`auvsim bound`: how well each follower of a scenario can know its place, over where another starts; maps of it."""

import math
import sys
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.analysis import mission_bound_files
from auvsim.analysis.mission_bounds import FollowerBound, mission_bounds
from auvsim.base.errors import InputError
from auvsim.cli.report import StudyProgress
from auvsim.cli.run import output_folder
from auvsim.simulation.scenario import Scenario

WIDTH = 122  # of the table [columns]
MOST = 301  # stations along an axis
SPANS = (1.0, 1e5)  # width of the square of stations [m]


def run(
    scenario: Scenario, *, out: Path, move: str | None, span: float | None, side: int, after: float | None,
    blind: float, seed: int,
) -> int:  # fmt: skip
    """Computes the bounds, prints a table, fills the folder and returns the exit code.

    Raises:
        InputError: For a number that cannot be used, or a scenario that leaves nothing to bound.
    """
    if not 2 <= side <= MOST:
        raise InputError(f"command line: --side {side} must lie in 2 .. {MOST} stations")
    if span is not None and not SPANS[0] <= span <= SPANS[1]:
        raise InputError(f"command line: --span {span:g} must lie in {SPANS[0]:g} .. {SPANS[1]:g} m")
    if after is not None and not 0.0 <= after < scenario.duration:
        raise InputError(f"command line: --after {after:g} must lie in the run's 0 .. {scenario.duration:g} s")
    if not 0.0 < blind < math.inf:
        raise InputError(f"command line: --blind {blind:g} must be a finite number above 0 m")
    with output_folder(out):
        with StudyProgress() as progress:
            found = mission_bounds(
                scenario, moved=move, seed=seed, span=span, side=side, after=after, blind=blind, progress=progress
            )
        written = [path for bound in found for path in mission_bound_files.write(bound, out)]
    console = Console(markup=False, width=max(WIDTH, Console().width))
    console.print(table(found))
    print(f"written: {', '.join(map(str, written))}", file=sys.stderr)
    return 0


def table(found: list[FollowerBound]) -> Table:
    """One line for each follower: as planned, at the best station, and shares of all stations."""
    after = f"{found[0].after:.0f}"
    lines = Table(
        title=f"Cramer-Rao bound over {found[0].settled.size} starts of {found[0].moved}",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    lines.add_column("follower", no_wrap=True)
    for heading in (
        f"rms after {after} s [m]", "to expect", "current [m/s]", "rank", "mirror", "best rms", "there (N, E)", "blind",
        "mirrored",
    ):  # fmt: skip
        lines.add_column(heading, justify="right", no_wrap=True)
    for bound in found:
        m, n = (int(np.abs(a - x).argmin()) for a, x in zip((bound.north, bound.east), bound.start, strict=True))
        settled = np.where(bound.blind, np.inf, bound.settled)
        i, j = np.unravel_index(settled.argmin(), settled.shape)
        best = (
            (f"{settled[i, j]:.2f}", f"{bound.north[i]:.0f}, {bound.east[j]:.0f}")
            if np.isfinite(settled[i, j])
            else ("-", "all are blind")
        )
        lines.add_row(
            bound.follower, f"{bound.settled[m, n]:.2f}", f"{bound.expected[m, n]:.2f}",
            f"{bound.current[m, n, -1]:.4f}", f"{bound.rank[m, n]} of 4",
            f"{bound.mirror[m, n]:.0%}", *best, f"{bound.blind.mean():.0%}", f"{bound.mirrored.mean():.0%}",
        )  # fmt: skip
    return lines
