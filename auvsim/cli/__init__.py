"""The command `auvsim`."""

import logging
import math
import os
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from auvsim import CACHE_NOTE, RENDERER_NOTE, __version__
from auvsim.base.errors import AuvsimError, DrawingError, InputError
from auvsim.base.neighbours import check_estimators
from auvsim.cli.compare import Compare
from auvsim.cli.export import Export
from auvsim.cli.interruption import Interruption
from auvsim.cli.parsing import files_first, parse

# What draws and computes is imported when a command needs it, so that `--help` answers at once.


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
    """Folder of trial.nc, summary.json, run.mp4, and pictures: track.png and estimates.png, or fleet.png of several."""
    video: bool = True
    """Whether to draw run.mp4."""


@dataclass(frozen=True, kw_only=True)
class Bound:
    """Maps how well followers can know position and current at best, over where a leader, beacon or dock starts.

    The Cramer-Rao bound of the planned tracks, with the scenario's noises, losses and delays, before anything is run:
    bound_FOLLOWER.png and bound_FOLLOWER.nc of each follower. Blind and mirror regions are marked. Any key of the
    scenario is an option too, as of `auvsim run`.
    """

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO.yaml|NAME")]
    """The scenario, or the name of a shipped one (leader_follower)."""
    out: Path = Path("out")
    """Folder of the maps."""
    move: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Vehicle, range sensor (its beacon) or structure that starts elsewhere; by default what is heard first."""
    span: float | None = None
    """Width of the square of stations about the follower's start [m]; by default wide enough for the planned one."""
    side: int = 51
    """Stations along each side of the square."""
    after: float | None = None
    """Time from which the position counts [s]; by default a third of the duration."""
    blind: float = 50.0
    """Bound of the position from which a station counts as blind [m]."""
    seed: int = 0
    """Seed of the current, where that is random."""


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


@dataclass(frozen=True, kw_only=True)
class Video:
    """Draws a video beside a log, docking.mp4 of one vehicle and its dock, else run.mp4; or one picture of it."""

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL.nc")]
    """Log of a trial."""
    camera: tuple[str, ...] = ()
    """Up to three of overview, follow, above, dock: the main view and those beside it, throughout."""
    speed: float | None = None
    """Speed-up far from the dock; by default such that the video lasts less than a minute."""
    still: Path | None = None
    """Draw only this picture (PNG), of the moment before the nose comes nearest to the mouth or of --time."""
    time: float | None = None
    """Time of that picture [s]."""


@dataclass(frozen=True, kw_only=True)
class Plot:
    """Draws track.png and estimates.png beside a log; of a manoeuvre its own picture, of several vehicles fleet.png."""

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL.nc")]
    """Log of a trial."""


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """Writes summary.json beside a log and prints it."""

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL.nc")]
    """Log of a trial."""


@dataclass(frozen=True, kw_only=True)
class ScenarioText:
    """Prints the full scenario as commented YAML: the default one, or what a file and options make of it."""

    scenario: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="[SCENARIO.yaml|NAME]")] = None
    """Keys that are not drawn from the seed, as YAML, or the name of a shipped scenario."""
    default: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """The default scenario as installed."""


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


@dataclass(frozen=True, kw_only=True)
class Report:
    """Writes the tables and the report of a campaign again, also of one that is not finished."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the campaign."""


@dataclass(frozen=True, kw_only=True)
class Identify:
    """Fits models of motion to logs of manoeuvres, and judges them on what is held out.

    Of a known vehicle (a trial log's own, or --vehicle) it fits the planar model, which starts from that vehicle's, and
    writes parameters.yaml, which --estimator.model of `auvsim dock` takes, report.html and report.png. Of an unknown
    one, or with --motion, it chooses the structure that predicts best and writes motion_model.yaml, if that predicts
    better than a vehicle that goes on as it began. A log is a trial's, or a CSV or NetCDF file with
    named columns such as `time [s]`, `rudder [deg]`, `n [rpm]`, `heading [deg]`: rudder positive to starboard, heading
    clockwise from north.
    """

    logs: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="LOG...")]
    """Logs of manoeuvres, of different kinds, best two minutes or more in all."""
    out: Path = Path("out")
    """Folder of parameters.yaml, report.html and report.png."""
    holdout: tuple[Path, ...] = ()
    """Logs to judge by; by default the least informative kind of manoeuvre."""
    columns: Annotated[Path | None, tyro.conf.arg(metavar="MAP.yaml")] = None
    """Meaning of columns, where their names do not say it: `rudder: {column: d, unit: deg, sign: -1}`."""
    vehicle: str | None = None
    """Vehicle in models/, or the path of its MJCF file: its masses, and where the fit of the planar model starts."""
    length: float | None = None
    """Length of the hull [m]; with beam, draught and mass it says what is known of the motion before the logs."""
    beam: float | None = None
    """Beam of the hull [m]."""
    draught: float | None = None
    """Draught of the hull, of a submerged body half its height [m]."""
    mass: float | None = None
    """Mass of the vehicle [kg]."""
    quick: bool = False
    """Of a motion model fewer structures and steps, on a coarser grid: some seconds."""
    name: str | None = None
    """Also keep the parameters under this name, in models/<vehicle>/planar/."""
    motion: bool = False
    """Also choose a motion model of a known vehicle, which then takes longer; for an unknown one it always does."""
    steps: tuple[str, ...] = ()
    """Of a known vehicle's planar model: segments, prediction-error or both, also with least-squares, which they
    start from; by default all."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Runs logs through estimators again, side by side, also with more losses, delays and outliers.

    A log is a trial's, or a CSV or NetCDF file with the columns of `auvsim identify`. Unchanged, a trial's own
    estimator gives the trial's estimates bit for bit. Prints errors and NEES where there is truth, and NIS and
    whiteness by sensor. With --out: estimators.csv, and of each log a page (PNG) and the estimates of each estimator.
    """

    logs: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="LOG...")]
    """Logs of trials, or tables."""
    estimator: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME|PACKAGE.MODULE:FACTORY...")] = ()
    """Estimators; by default the trial's own, and of tables dead_reckoning."""
    drop: str = "0%"
    """Share of readings that are lost besides."""
    delay: str = "+0"
    """Time by which readings arrive later [s]."""
    outliers: str = "0%"
    """Share of readings that get an error of 10 to 30 m, or of their unit."""
    sensors: tuple[str, ...] = ()
    """Sensors that those three change; by default all that fix the position."""
    seed: int = 0
    """Seed of what is lost and wrong."""
    smooth: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Also refine each pose by what came in the 15 to 25 s after it."""
    out: Path | None = None
    """Folder of estimators.csv, the pages and the estimates; by default nothing is written."""
    columns: Annotated[Path | None, tyro.conf.arg(metavar="MAP.yaml")] = None
    """Which column of a table is what, as of `auvsim identify`."""
    vehicle: str = "remus100"
    """Vehicle of a table, for estimators that assume its model."""


@dataclass(frozen=True, kw_only=True)
class Formation:
    """Shows what ranges to leaders tell a follower: a map of the least error, and the best move of each leader.

    Writes formation.png and formation.csv. `auvsim formation --leaders "0,1000;-866,-500;866,-500"`. A depth may follow
    each place; the follower knows its own by a gauge. Where a list begins with a minus, write `--leaders="-866,...`.
    """

    leaders: Annotated[str, tyro.conf.arg(metavar='"NORTH,EAST;..."')]
    """Places of the leaders [m]."""
    follower: Annotated[str, tyro.conf.arg(metavar='"NORTH,EAST"')] = "0,0"
    """Place of the follower [m]."""
    noise: str = "2"
    """Standard deviation of the ranges, one for all or one each [m]."""
    speed: float = 1.0
    """Speed of all [m/s]."""
    heading_deg: float = 0.0
    """Heading of all, clockwise from north [deg]."""
    step: float = 1.0
    """Time between two sets of ranges [s]."""
    reach: float = 200.0
    """How far each leader can move [m]."""
    modem: float = 3000.0
    """Greatest range of the modem [m]."""
    apart: float = 20.0
    """Least distance between vehicles [m]."""
    out: Path = Path("out")
    """Folder of the table and the map."""


@dataclass(frozen=True, kw_only=True)
class Modem:
    """Charts what a modem gives a leader and its followers: packets that overlap, age of the leader's state, the bound.

    ALOHA against TDMA, ranges by one-way against two-way travel time, over the number of followers: modem_NAME.png
    and modem_NAME.csv. The bound is that of the scenario leader_follower with this modem.
    """

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """The modem, such as micromodem_fsk, micromodem_psk, s2c_r_18_34, seatrac_x150, atm_900."""
    followers: Annotated[str, tyro.conf.arg(metavar="N|FROM..TO")] = "1..8"
    """Numbers of followers."""
    period: float = 10.0
    """Time between two packets, or questions, of each [s]."""
    distance: float = 500.0
    """From the leader to each follower [m]."""
    duration: float = 1800.0
    """Of each run of the network [s]."""
    seed: int = 0
    """Seed of every random number."""
    out: Path = Path("out")
    """Folder of the chart."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Runs one of the studies behind the figures of the README; without a name lists them."""


@dataclass(frozen=True, kw_only=True)
class ShowVehicle:
    """Shows what a vehicle does, as one holds it against a data sheet; or makes a vehicle of a data sheet.

    Of a vehicle with fins: speed against shaft speed, trim, turning circles, zig-zag, dive, stopping, and the error of
    the planar model that filters assume. Of one that thrusters drive: speed against force in each axis, stopping, a
    step of its place, holding in a current. With --from: NAME.xml, README.md, in which every estimate is marked, and
    controller.yaml.
    """

    name: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="NAME|MODEL.xml")] = None
    """A vehicle in models/, or the path of an MJCF file."""
    out: Path | None = None
    """Folder of the page, NAME.png; with --from of the vehicle, by default vehicle/."""
    sheet: Annotated[Path | None, tyro.conf.arg(name="from", metavar="SHEET.yaml")] = None
    """Data sheet from which to make a vehicle."""


Command = (
    Dock
    | Run
    | Bound
    | Campaign
    | Stress
    | Report
    | Manoeuvre
    | Identify
    | Estimate
    | Compare
    | Export
    | Video
    | Plot
    | Metrics
    | Reproduce
    | Formation
    | Modem
    | Study
    | Annotated[ShowVehicle, tyro.conf.subcommand("vehicle")]
    | Annotated[ScenarioText, tyro.conf.subcommand("scenario")]
)


@dataclass(frozen=True, kw_only=True)
class Auvsim:
    """The whole command line."""

    command: tyro.conf.OmitSubcommandPrefixes[tyro.conf.OmitArgPrefixes[Command]]
    version: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Prints the version."""


TAKE_SCENARIO_KEYS = {"dock": Dock, "run": Run, "bound": Bound, "manoeuvre": Manoeuvre, "scenario": ScenarioText}
TAKE_NAMES = {
    "identify": ("--steps",),
    "estimate": ("--estimator", "--sensors"),
    "video": ("--camera",),
}  # several each


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns its exit code."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if arguments == ["--version"]:
        print(f"auvsim {__version__}")
        return 0
    logging.getLogger("absl").setLevel(logging.ERROR)  # MuJoCo's warnings; what comes of them is said in one line
    if CACHE_NOTE:
        print(f"auvsim: {CACHE_NOTE}", file=sys.stderr)
    with Interruption() as interruption:
        try:
            return _run(arguments)
        except AuvsimError as error:
            more = f"; {RENDERER_NOTE}" if isinstance(error, DrawingError) and RENDERER_NOTE else ""
            print(f"auvsim: {' '.join(str(error).split())}{more}", file=sys.stderr)
            return error.exit_code
        except KeyboardInterrupt:
            pass
        except BrokenPipeError:  # the reader, such as `head`, has what it wanted
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except OSError as error:  # a full disk, a file that may not be read
            if not interruption.came:
                print(f"auvsim: {_of_a_file(error)}", file=sys.stderr)
                return 2
        except MemoryError as error:
            print(f"auvsim: out of memory: {' '.join(str(error).split())}".rstrip(": "), file=sys.stderr)
            return 1
        except Exception as error:
            folder = _cache_at_fault(error)
            if folder and not interruption.came:
                text = " ".join(str(error).split())[:200]
                print(
                    f"auvsim: compiled code in {folder} cannot be read ({type(error).__name__}: {text}); delete its "
                    ".nbi and .nbc files, or set NUMBA_CACHE_DIR to another folder",
                    file=sys.stderr,
                )
                return 1
            if not interruption.came:
                raise
    print("auvsim: interrupted", file=sys.stderr)
    return 130


def _cache_at_fault(error: BaseException) -> str | None:
    """The folder of compiled code, if that is what an error is about."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        if Path(frame.f_code.co_filename).parts[-3:] == ("numba", "core", "caching.py"):
            place = getattr(frame.f_locals.get("self"), "_cache_path", None)
            if place is not None:
                return str(place)
    return None


def _of_a_file(error: OSError) -> str:
    """What is wrong with a file, in one line."""
    names = [str(name) for name in (error.filename, error.filename2) if name is not None]
    name = names[-1] if names else type(error).__name__
    shown = name if len(name) <= 200 else f"{name[:197]}..."
    return f"{shown}: {' '.join((error.strerror or str(error)).split())}"


def _run(arguments: list[str]) -> int:
    check_estimators()
    if arguments[:1] == ["study"]:  # each study has options of its own
        from auvsim.cli import study

        return study.run(arguments[1:])
    values: dict = {}
    if arguments and arguments[0] in TAKE_SCENARIO_KEYS and not {"-h", "--help"} & set(arguments):
        from auvsim.cli import options

        arguments, values = options.split(arguments, TAKE_SCENARIO_KEYS[arguments[0]])
    arguments = files_first(arguments, TAKE_NAMES.get(arguments[0], ()) if arguments else ())
    command: Command = parse(Auvsim, arguments, "auvsim", _DESCRIPTION).command
    if isinstance(command, ScenarioText):
        from auvsim.cli import options
        from auvsim.simulation.loading import find

        path = find(command.scenario) if command.scenario is not None else None
        print(options.scenario_text(path, command.default, values), end="")
        return 0

    if isinstance(command, Dock):
        from auvsim.cli import options, run
        from auvsim.simulation.loading import find

        path = find(command.scenario) if command.scenario is not None else None
        scenario = options.scenario(path, command.estimator, values, command.seed, command.trial)
        _, vehicle = scenario.lone
        if vehicle.mission.kind != "docking":
            manoeuvre = getattr(vehicle.mission, "manoeuvre", None)
            meant = f"auvsim manoeuvre {manoeuvre.kind}" if manoeuvre else "auvsim run"
            raise InputError(f"the scenario is a {vehicle.mission.kind}, not a docking; run it with `{meant}`")
        with options.located(path, values, command.estimator):
            return run.run(scenario, seed=command.seed, trial=command.trial, out=command.out, video=command.video)

    if isinstance(command, Run):
        from auvsim.cli import options, run
        from auvsim.simulation.loading import find

        path = find(command.scenario)
        scenario = options.scenario(path, None, values, command.seed, command.trial)
        made = {"seed": command.seed, "trial": command.trial, "out": command.out, "video": command.video}
        with options.located(path, values):
            return run.run(scenario, **made, name=path.stem)

    if isinstance(command, Bound):
        from auvsim.cli import bound, options
        from auvsim.simulation.loading import find

        scenario = options.scenario(find(command.scenario), None, values, command.seed, 0)
        return bound.run(
            scenario, out=command.out, move=command.move, span=command.span, side=command.side, after=command.after,
            blind=command.blind, seed=command.seed,
        )  # fmt: skip

    if isinstance(command, Campaign | Report):
        from auvsim.cli import campaign

        match command:
            case Report():
                return campaign.report(command.folder)
            case Campaign(trial=None):
                if command.variant is not None:
                    raise InputError("command line: --variant goes with --trial")
                engine = {"engine": command.engine, "scheduler": command.scheduler}
                return campaign.run(command.plan, out=command.out, jobs=command.jobs, **engine)
        which = {"trial": command.trial, "variant": command.variant}
        return campaign.replay(command.plan, **which, out=command.out, video=command.video)

    if isinstance(command, Stress):
        from auvsim.cli import stress

        engine = {"engine": command.engine, "scheduler": command.scheduler}
        return stress.run(command.plan, out=command.out, budget=command.budget, jobs=command.jobs, **engine)

    if isinstance(command, Manoeuvre):
        from auvsim.cli import manoeuvre, options

        plans = manoeuvre.plans(command.kinds, values, command.seed, command.trial)
        with options.located(manoeuvre.file_of(command.kinds), values):
            return manoeuvre.run(plans, seed=command.seed, trial=command.trial, out=command.out)

    if isinstance(command, Identify):
        from auvsim.cli import identify

        return identify.run(
            command.logs, out=command.out, holdout=command.holdout, columns=command.columns,
            vehicle=command.vehicle, name=command.name, steps=command.steps, quick=command.quick,
            hull=(command.length, command.beam, command.draught, command.mass), motion=command.motion,
        )  # fmt: skip

    if isinstance(command, Estimate):
        from auvsim.cli import estimate
        from auvsim.replay.what_if import WhatIf

        what_if = WhatIf(
            drop=estimate.share(command.drop, "--drop"), delay=estimate.delay(command.delay),
            outliers=estimate.share(command.outliers, "--outliers"), sensors=command.sensors, seed=command.seed,
        )  # fmt: skip
        return estimate.run(
            command.logs, estimators=command.estimator, what_if=what_if, smooth=command.smooth, out=command.out,
            columns=command.columns, vehicle=command.vehicle,
        )  # fmt: skip

    if isinstance(command, Compare):
        from auvsim.cli import compare

        return compare.run(command)

    if isinstance(command, Export):
        from auvsim.cli import export

        return export.run(command)

    if isinstance(command, ShowVehicle):
        from auvsim.cli import vehicle

        if (command.name is None) == (command.sheet is None):
            raise InputError("command line: give the name of a vehicle, or --from SHEET.yaml")
        if command.sheet is not None:
            return vehicle.from_sheet(command.sheet, command.out or Path("vehicle"))
        return vehicle.show(command.name or "", command.out)

    if isinstance(command, Reproduce):
        from auvsim.cli import reproduce

        return reproduce.run(
            command.paper, quick=command.quick, seed=command.seed, out=command.out, jobs=command.jobs,
            truth=command.truth,
        )  # fmt: skip

    if isinstance(command, Modem):
        from auvsim.cli import modem

        return modem.run(
            command.name, followers=command.followers, period=command.period, distance=command.distance,
            duration=command.duration, seed=command.seed, out=command.out,
        )  # fmt: skip

    if isinstance(command, Formation):
        from auvsim.cli import formation

        judged = formation.formation(
            command.leaders, command.follower, command.noise, speed=command.speed, heading_deg=command.heading_deg,
            step=command.step, reach=command.reach, modem=command.modem, apart=command.apart,
        )  # fmt: skip
        return formation.run(judged, command.out)

    from auvsim.cli import products

    if isinstance(command, Video):
        for name, value in (("time", command.time), ("speed", command.speed)):
            if value is not None and not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"command line: --{name} {value:g}: give a finite number that is not negative")
    match command:
        case Video(still=None):
            if command.time is not None:
                raise InputError("command line: --time goes with --still")
            return products.again(command.log, products.video, speed=command.speed, cameras=command.camera)
        case Video():
            return products.again(
                command.log, products.still, path=command.still, time=command.time, cameras=command.camera
            )
        case Plot():
            return products.again(command.log, products.plots)
        case Study():
            raise AssertionError("handled above")
        case Metrics():
            return products.again(command.log, products.show_summary)


_DESCRIPTION = "Closed-loop simulation of autonomous underwater vehicles."
