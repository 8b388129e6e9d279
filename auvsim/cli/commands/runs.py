"""Commands that run a scenario; each takes its keys as options."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from auvsim.base.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Dock:
    """Runs one docking trial.

    Any key of the scenario is an option too, such as `--current.speed 0.2`; `auvsim scenario --default` lists them.
    What a file or an option gives is pinned; the rest of the default scenario is drawn from the seed. Exit codes: 0
    the trial ran, docked or not; 1 the simulation diverged; 2 bad input; 130 interrupted.
    """

    scenario: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="[SCENARIO.yaml|NAME]")] = None
    """Keys that are not drawn from the seed, as YAML, or the name of a shipped scenario."""
    seed: int = 0
    """Seed of every random number."""
    trial: int = 0
    """Number of the trial under that seed."""
    out: Path = Path("out")
    """Folder of trial.nc, summary.json, track.png, estimates.png and docking.mp4."""
    estimator: Annotated[str | None, tyro.conf.arg(metavar="NAME|PACKAGE.MODULE:FACTORY")] = None
    """Estimator that navigates; the same as --estimator.kind."""
    video: bool = True
    """Whether to draw docking.mp4."""

    def run(self, values: dict[str, Any]) -> int:
        """Runs the trial with scenario keys that were given as options; returns the exit code."""
        from auvsim.cli import options, run
        from auvsim.simulation.loading import find

        path = find(self.scenario) if self.scenario is not None else None
        scenario = options.scenario(path, self.estimator, values, self.seed, self.trial)
        _, vehicle = scenario.lone
        if vehicle.mission.kind != "docking":
            manoeuvre = getattr(vehicle.mission, "manoeuvre", None)
            meant = f"auvsim manoeuvre {manoeuvre.kind}" if manoeuvre else "auvsim run"
            raise InputError(f"the scenario is a {vehicle.mission.kind}, not a docking; run it with `{meant}`")
        with options.located(path, values, self.estimator):
            return run.run(scenario, seed=self.seed, trial=self.trial, out=self.out, video=self.video)


@dataclass(frozen=True, kw_only=True)
class Run:
    """Runs whatever a scenario says: one vehicle or several, docking, on a track or in manoeuvres.

    Any key of the scenario is an option too, such as `--vehicles.auv_1.estimator.kind imm`. Exit codes as of
    `auvsim dock`.
    """

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO.yaml|NAME")]
    """The scenario, or the name of a shipped one, such as three_vehicles, leader_follower, formation, rov_docking."""
    seed: int = 0
    """Seed of every random number."""
    trial: int = 0
    """Number of the run under that seed."""
    out: Path = Path("out")
    """Folder of trial.nc, summary.json, run.mp4, and pictures: track.png and estimates.png, or fleet.png of several.

    Of one that navigates by a sonar also sonar.png, feature_map.png and feature_map.nc."""
    video: bool = True
    """Whether to draw run.mp4."""

    def run(self, values: dict[str, Any]) -> int:
        """Runs the scenario with keys of it that were given as options; returns the exit code."""
        from auvsim.cli import options, run
        from auvsim.simulation.loading import find

        path = find(self.scenario)
        scenario = options.scenario(path, None, values, self.seed, self.trial)
        with options.located(path, values):
            return run.run(scenario, seed=self.seed, trial=self.trial, out=self.out, video=self.video, name=path.stem)


@dataclass(frozen=True, kw_only=True)
class Manoeuvre:
    """Runs manoeuvres of the vehicle, for its identification: KIND.nc and KIND.png each.

    KIND is straight, circle, zigzag, multisine, prbs, spiral, optimal (designed to be most informative), or table
    and sequence, which need a file or an option for their contents. Any key of the scenario is an option too, such as
    `--manoeuvre.heading_deg 20`.
    """

    kinds: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="KIND... [SCENARIO.yaml]")]
    """Manoeuvres, then what to pin, as YAML."""
    seed: int = 0
    """Seed of every random number."""
    trial: int = 0
    """Number of the trial under that seed."""
    out: Path = Path("out")
    """Folder of the logs and pictures."""

    def run(self, values: dict[str, Any]) -> int:
        """Runs the manoeuvres with scenario keys that were given as options; returns the exit code."""
        from auvsim.cli import manoeuvre, options

        plans = manoeuvre.plans(self.kinds, values, self.seed, self.trial)
        with options.located(manoeuvre.file_of(self.kinds), values):
            return manoeuvre.run(plans, seed=self.seed, trial=self.trial, out=self.out)


@dataclass(frozen=True, kw_only=True)
class ScenarioText:
    """Prints the full scenario as commented YAML: the default one, or what a file and options make of it."""

    scenario: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="[SCENARIO.yaml|NAME]")] = None
    """Keys that are not drawn from the seed, as YAML, or the name of a shipped scenario."""
    default: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """The default scenario as installed."""

    def run(self, values: dict[str, Any]) -> int:
        """Prints the scenario with keys of it that were given as options; returns the exit code."""
        from auvsim.cli import options
        from auvsim.simulation.loading import find

        path = find(self.scenario) if self.scenario is not None else None
        print(options.scenario_text(path, self.default, values), end="")
        return 0
