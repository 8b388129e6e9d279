"""Commands that run many trials."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from auvsim.base.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Runs the trials of a plan on all cores or on a Dask cluster; goes on where it stopped.

    Writes table.parquet, table.csv and report.html beside a file for each trial. The same plan gives the same table on
    however many cores. Nothing that is finished is lost, however the run ends: the same command goes on.
    """

    plan: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PLAN.yaml|NAME|FOLDER")]
    """The plan, the name of a shipped one (navigators), or the folder of a campaign."""
    out: Path | None = None
    """Folder of the campaign; by default out/ and the plan's name."""
    jobs: int | None = None
    """Processes; by default one for each core."""
    engine: Literal["local", "dask"] = "local"
    """What runs them: processes of this machine, or Dask (pip install 'auvsim[cluster]')."""
    scheduler: Annotated[str | None, tyro.conf.arg(metavar="tcp://HOST:PORT")] = None
    """Scheduler of a Dask cluster; by default Dask starts one on this machine."""
    trial: int | None = None
    """Run only this trial, as `auvsim dock` does, into replays/ of the folder, or --out."""
    variant: str | None = None
    """Variant of that trial."""
    video: bool = True
    """Whether to draw docking.mp4 of that trial."""

    def run(self) -> int:
        """Runs the campaign or replays one trial of it, and returns the exit code.

        Raises:
            InputError: A variant is given without a trial.
        """
        from auvsim.cli import campaign

        if self.trial is not None:
            which = {"trial": self.trial, "variant": self.variant}
            return campaign.replay(self.plan, **which, out=self.out, video=self.video)
        if self.variant is not None:
            raise InputError("command line: --variant goes with --trial")
        return campaign.run(self.plan, out=self.out, jobs=self.jobs, engine=self.engine, scheduler=self.scheduler)


@dataclass(frozen=True, kw_only=True)
class Stress:
    """Looks for where a scenario breaks: edges and maps of success, rare events, the worst current.

    The plan is a campaign's with the section `stress`, which says what is varied and what is looked for. Each trial is
    kept; the same command, also with more budget or another section, goes on. Writes report.html, pictures, and
    findings/: scenarios that `auvsim dock` runs again bit for bit.
    """

    plan: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PLAN.yaml|NAME|FOLDER")]
    """The plan, the name of a shipped one (docking_envelope), or the folder of a stress test."""
    out: Path | None = None
    """Folder of the stress test; by default out/ and the plan's name."""
    budget: int | None = None
    """Most trials; by default as many as the plan takes."""
    jobs: int | None = None
    """Processes; by default one for each core."""
    engine: Literal["local", "dask"] = "local"
    """What runs them: processes of this machine, or Dask (pip install 'auvsim[cluster]')."""
    scheduler: Annotated[str | None, tyro.conf.arg(metavar="tcp://HOST:PORT")] = None
    """Scheduler of a Dask cluster; by default Dask starts one on this machine."""

    def run(self) -> int:
        """Runs the stress test, and returns the exit code."""
        from auvsim.cli import stress

        return stress.run(
            self.plan, out=self.out, budget=self.budget, jobs=self.jobs, engine=self.engine, scheduler=self.scheduler
        )


@dataclass(frozen=True, kw_only=True)
class Report:
    """Writes the tables and the report of a campaign again, also of one that is not finished."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the campaign."""

    def run(self) -> int:
        """Makes the page anew, and returns the exit code."""
        from auvsim.cli import campaign

        return campaign.report(self.folder)


@dataclass(frozen=True, kw_only=True)
class Reproduce:
    """Reproduces the figures and tables of a paper.

    Prints the study with its acceptance criteria, and writes study.csv, acceptance.csv and the paper's figures as PNG,
    figures and tables of its own beside them. The same seed gives the same numbers, on however many cores.
    """

    paper: Annotated[Literal["paper1", "paper2", "paper3", "paper4", "paper5"], tyro.conf.Positional]
    """paper1: navigation to a dock by USBL (Qiu and Li 2019).
    paper2: ranges to a leader in an unknown current.
    paper3: cooperative localisation with late packets (Yao et al. 2011).
    paper4: where leaders are to stand, by ranges (Li et al. 2023).
    paper5: a path from sonar frames of the sea floor (2009)."""
    quick: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Few runs: under a minute on two cores, with wide intervals."""
    seed: int = 0
    """Seed of every random number."""
    out: Path = Path("out")
    """Folder of the tables and pictures."""
    jobs: int | None = None
    """Processes; by default one for each core."""
    truth: Literal["planar", "mujoco", "both"] | None = None
    """True motion: of the paper's planar model, of the vehicle in MuJoCo, or one study of each; by
    default both, and in --quick planar."""

    def run(self) -> int:
        """Runs the study, and returns the exit code."""
        from auvsim.cli import reproduce

        return reproduce.run(
            self.paper, quick=self.quick, seed=self.seed, out=self.out, jobs=self.jobs, truth=self.truth
        )


@dataclass(frozen=True, kw_only=True)
class Study:
    """Runs one of the studies behind the figures of the README; without a name lists them."""
