"""`auvsim campaign` and `auvsim report`: runs a plan's trials, or one of them, and says what they came to."""

import sys
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.table import Table

from auvsim.base.errors import InputError, unknown_name
from auvsim.campaign import cluster, execution, folder, local, plan, statistics, table
from auvsim.campaign.folder import Folder
from auvsim.cli import run as running
from auvsim.cli.report import CampaignProgress
from auvsim.simulation import scenario

HEADINGS = {"docked_first": "first attempt"}  # of rates that the table calls otherwise than their column
WIDTH = 120  # of what is printed where there is no terminal [columns]
OUT = Path("out")  # folders of campaigns lie in it, if --out does not say otherwise


def run(
    name: str, *, out: Path | None, jobs: int | None, engine: Literal["local", "dask"], scheduler: str | None
) -> int:
    """Runs what is missing of a campaign, writes tables and report, and prints the rates.

    Raises:
        InputError: For a plan, folder or engine that cannot be used.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"command line: --jobs {jobs} must be 1 or more; leave it out for all cores")
    if scheduler is not None and engine != "dask":
        raise InputError("command line: --scheduler goes with --engine dask")
    chosen = plan.load(name)
    path = _folder(name, chosen, out)
    jobs = jobs or execution.cores()
    try:
        start = local.Pool(jobs) if engine == "local" else cluster.Cluster(scheduler, jobs)
        with start as pool, CampaignProgress(chosen.settings.name) as progress:
            done = execution.run(chosen, path, pool, progress)
    except KeyboardInterrupt:
        begun = (path / folder.PLAN).is_file()
        more = f"; what is finished is kept, `auvsim campaign {path}` goes on" if begun else ", before it began"
        print(f"auvsim: interrupted{more}", file=sys.stderr)
        return 130
    _report(done)
    return 0


def replay(name: str, trial: int, *, variant: str | None, out: Path | None, video: bool) -> int:
    """Runs one trial of a campaign as `auvsim run` does, alone and from the same draws and noises.

    Raises:
        InputError: For a plan, trial or variant that there is not.
    """
    chosen = plan.load(name)
    if not 0 <= trial < chosen.settings.trials:
        raise InputError(f"command line: --trial {trial}: the plan has trials 0 to {chosen.settings.trials - 1}")
    if variant is None:
        variant, *others = chosen.variants
        if others:
            raise InputError(f"command line: --trial needs --variant; there are {', '.join(chosen.variants)}")
    if variant not in chosen.variants:
        raise unknown_name("variant", variant, list(chosen.variants))
    parsed = scenario.parse(chosen.values(variant, trial))
    here = Folder(Path(name), chosen).replay_path(variant, trial)
    path = out or (here if Path(name).is_dir() else OUT / f"{chosen.settings.name}-{variant}-{trial}")
    code = running.run(parsed, seed=chosen.settings.seed, trial=trial, out=path, video=video)
    print(f"written: {path}", file=sys.stderr)
    return code


def report(path: Path) -> int:
    """Writes tables and report of what is finished of a campaign, and prints the rates.

    Raises:
        InputError: If there is no campaign, or no trial of it is done.
    """
    done = folder.open_begun(path)
    table.write(done)
    _report(done)
    return 0


def _folder(name: str, chosen: plan.Plan, out: Path | None) -> Path:
    """Where a campaign is: where it was begun, where the command says, or by its name."""
    return out or (Path(name) if Path(name).is_dir() else OUT / chosen.settings.name)


def _report(done: Folder) -> None:
    from auvsim.campaign.report import write

    show(done)
    print(f"written: {done.path / 'table.parquet'}, {write(done.path)}", file=sys.stderr)


def show(done: Folder) -> None:
    """Prints the rates of each variant and its differences from the first."""
    variants, layout = done.plan.variants, done.plan.layout
    compared = "docked_first" if "docked_first" in layout.rates else layout.success
    needed = ("variant", "trial", "error_type", *layout.rates)
    rows = [{key: row[key] for key in needed} for row in table.rows(done)]  # of many trials all columns would be much
    rates = {(rate.variant, rate.quantity): rate for rate in statistics.rates(rows, variants, layout)}
    less = {(d.variant, d.quantity): d for d in statistics.differences(rows, variants, layout)}
    count = len({(row["variant"], row["trial"]) for row in rows})
    what = "docking trials" if layout.kinds == ("docking",) else "trials"
    found = Table(title=f"{done.plan.settings.name}: {count} {what}, seed {done.plan.settings.seed}")
    named = [f"{HEADINGS.get(quantity, quantity.replace('_', ' '))} [%]" for quantity in layout.rates]
    for heading in ("variant", "trials", *named, "difference [points]", "errors"):
        found.add_column(heading, justify="left" if heading == "variant" else "right")
    for variant in variants:
        failed = {row["trial"] for row in rows if row["variant"] == variant and row["error_type"] is not None}
        shares = [_share(rates[variant, quantity]) for quantity in layout.rates]
        trials = str(rates[variant, layout.success].trials)
        found.add_row(variant, trials, *shares, _less(less.get((variant, compared))), str(len(failed)))
    Console(markup=False, width=None if Console().is_terminal else WIDTH).print(found)


def _share(rate: statistics.Rate) -> str:
    share = 100.0 * rate.successes / rate.trials if rate.trials else float("nan")
    return f"{share:.1f} ({100.0 * rate.low:.1f} to {100.0 * rate.high:.1f})"


def _less(difference: statistics.Difference | None) -> str:
    if difference is None:
        return ""
    value, low, high = (100.0 * x for x in (difference.value, difference.low, difference.high))
    return f"{value:+.1f} ({low:+.1f} to {high:+.1f})"
