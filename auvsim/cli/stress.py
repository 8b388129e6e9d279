"""`auvsim stress`: where a scenario breaks, by campaigns that choose their trials; tables, pictures, findings."""

import sys
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.table import Table

from auvsim.base.errors import InputError
from auvsim.campaign import cluster, execution, local
from auvsim.cli.report import CampaignProgress
from auvsim.stress import bench, plan, results
from auvsim.stress.search import Searches

WIDTH = 120  # of what is printed where there is no terminal [columns]
OUT = Path("out")


def run(
    name: str,
    *,
    out: Path | None,
    budget: int | None,
    jobs: int | None,
    engine: Literal["local", "dask"],
    scheduler: str | None,
) -> int:
    """Runs what a stress test lacks, writes its page and findings, and prints its tables.

    Raises:
        InputError: For a plan, folder or engine that cannot be used.
    """
    for option, value in (("--jobs", jobs), ("--budget", budget)):
        if value is not None and value < 1:
            raise InputError(f"command line: {option} {value} must be 1 or more; leave it out for no limit")
    if scheduler is not None and engine != "dask":
        raise InputError("command line: --scheduler goes with --engine dask")
    chosen = plan.load(name)
    path = out or (Path(name) if Path(name).is_dir() else OUT / chosen.plan.settings.name)
    searches = Searches(chosen)
    with bench.claimed(chosen, path):
        try:
            jobs = jobs or execution.cores()
            start = local.Pool(jobs) if engine == "local" else cluster.Cluster(scheduler, jobs)
            with start as pool, CampaignProgress(chosen.plan.settings.name) as progress:
                execution.prepare(chosen.plan, pool)
                runs = bench.Bench(chosen, path, pool, budget, progress)
                searches.run(runs)
        except KeyboardInterrupt:
            print(f"auvsim: interrupted; what is finished is kept, `auvsim stress {path}` goes on", file=sys.stderr)
            return 130
        _report(searches, path, runs.trials)
    return 0


def _report(searches: Searches, path: Path, trials: int) -> None:
    from auvsim.stress import figures, findings, page

    kept, seed = findings.found(searches), searches.plan.plan.settings.seed
    findings.write(kept, path, seed)
    written = page.write(searches, path, trials, figures.write(searches, path), kept)
    console = Console(markup=False, width=None if Console().is_terminal else WIDTH)
    for title, head, rows in results.tables(searches):
        shown = Table(title=title)
        for index, heading in enumerate(head):
            shown.add_column(heading, justify="right" if index else "left")
        for row in rows:
            shown.add_row(*row)
        console.print(shown)
    said = "; the budget was spent before all was done: the same command with more goes on" if searches.spent else ""
    print(f"{trials} trials{said}", file=sys.stderr)
    print(f"written: {written}, {len(kept)} findings in {path / 'findings'}", file=sys.stderr)
