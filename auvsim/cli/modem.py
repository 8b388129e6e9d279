"""`auvsim modem`: what a modem gives a fleet by its size: packets that overlap, age of what is known, the bound."""

import math
import sys
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from auvsim.acoustics.presets import PRESETS
from auvsim.analysis import modem_chart
from auvsim.analysis.modem_chart import Fleet, Point
from auvsim.base.errors import InputError, unknown_name
from auvsim.cli.report import StudyProgress
from auvsim.cli.run import output_folder
from auvsim.reproduce.products import write_files

MOST = 30  # followers
BOUNDS = {"period": (1.0, 3600.0), "distance": (10.0, 20_000.0), "duration": (60.0, 86_400.0)}  # [s, m, s]
WIDTH = 110  # of the table [columns]


def run(name: str, *, followers: str, period: float, distance: float, duration: float, seed: int, out: Path) -> int:
    """Computes the chart, prints its table and writes modem_NAME.png and modem_NAME.csv.

    Returns:
        The exit code.

    Raises:
        InputError: For a modem that there is not, or a number that cannot be used.
    """
    if name not in PRESETS:
        raise unknown_name("modem", name, [*PRESETS])
    for key, value in (("period", period), ("distance", distance), ("duration", duration)):
        low, high = BOUNDS[key]
        if not low <= value <= high:
            raise InputError(f"command line: --{key} {value:g} must lie in {low:g} .. {high:g}")
    fleets = [
        Fleet(name, count, period, access, ranging, distance)
        for access in ("ALOHA", "TDMA")
        for ranging in ("one-way", "two-way")
        for count in counts(followers)
    ]
    with output_folder(out):
        with StudyProgress() as progress:
            points = modem_chart.chart(fleets, duration, seed, progress)
        rows = [HEADING, *map(_row, points)]
        written = write_files(out, {f"modem_{name}.csv": rows}, {f"modem_{name}.png": modem_chart.draw(points)})
    Console(markup=False, width=max(WIDTH, Console().width)).print(table(points))
    print(f"written: {', '.join(map(str, written))}", file=sys.stderr)
    return 0


def counts(text: str) -> list[int]:
    """Numbers of followers from "N" or "FROM..TO".

    Raises:
        InputError: It is neither, or there are none or too many.
    """
    first, dots, last = text.partition("..")
    try:
        low = int(first)
        high = int(last) if dots else low
    except ValueError:
        raise InputError(f"command line: --followers {text} must be a number, or FROM..TO such as 1..8") from None
    if not 1 <= low <= high <= MOST:
        raise InputError(f"command line: --followers {text} must lie in 1..{MOST}, the smaller number first")
    return list(range(low, high + 1))


HEADING = (
    "access", "ranging", "followers", "period_s", "lost_by_overlap", "leader_packets_lost", "age_s", "bound_m",
)  # fmt: skip


def _row(p: Point) -> tuple:
    return (p.fleet.access, p.fleet.ranging, p.fleet.followers, p.period, p.collisions, p.lost, p.age, p.bound)


def table(points: list[Point]) -> Table:
    """One line for each point."""
    lines = Table(title=f"modem {points[0].fleet.modem}", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for k, heading in enumerate(
        ("access", "ranging", "followers", "period [s]", "overlap [%]", "leader's lost [%]", "age [s]", "bound [m]")
    ):
        lines.add_column(heading, justify="left" if k < 2 else "right", no_wrap=True)
    for p in points:
        age, bound = (f"{v:.1f}" if math.isfinite(v) else "none heard" for v in (p.age, p.bound))
        shares = (f"{100.0 * share:.1f}" for share in (p.collisions, p.lost))
        lines.add_row(p.fleet.access, p.fleet.ranging, str(p.fleet.followers), f"{p.period:.1f}", *shares, age, bound)
    return lines
