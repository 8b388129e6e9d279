"""Commands that learn from a log."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


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

    def run(self) -> int:
        """Identifies, and returns the exit code."""
        from auvsim.cli import identify

        return identify.run(
            self.logs, out=self.out, holdout=self.holdout, columns=self.columns, vehicle=self.vehicle, name=self.name,
            steps=self.steps, quick=self.quick, hull=(self.length, self.beam, self.draught, self.mass),
            motion=self.motion,
        )  # fmt: skip


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

    def run(self) -> int:
        """Replays the logs, and returns the exit code."""
        from auvsim.cli import estimate
        from auvsim.replay.what_if import WhatIf

        what_if = WhatIf(
            drop=estimate.share(self.drop, "--drop"), delay=estimate.delay(self.delay),
            outliers=estimate.share(self.outliers, "--outliers"), sensors=self.sensors, seed=self.seed,
        )  # fmt: skip
        return estimate.run(
            self.logs, estimators=self.estimator, what_if=what_if, smooth=self.smooth, out=self.out,
            columns=self.columns, vehicle=self.vehicle,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Holds the simulation of a vehicle against a log: gap.html, gap.png and a table.

    The log's rudder and shaft drive the vehicle in MuJoCo; errors of the position, open loop, by the distance run;
    spectra of the residuals; the coefficient that explains them best; a grade. The log is a trial's, a table, or a
    bag, as of `auvsim identify`.
    """

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="LOG")]
    """Log of manoeuvres, best of some minutes with steps of rudder and shaft."""
    vehicle: str
    """Vehicle in models/, or the path of its MJCF file."""
    parameters: Annotated[Path | None, tyro.conf.arg(metavar="FILE.yaml")] = None
    """Parameters of a planar model (from `auvsim identify`) to hold against the log, too."""
    columns: Annotated[Path | None, tyro.conf.arg(metavar="MAP.yaml")] = None
    """Meaning of columns or topics, as of `auvsim identify`."""
    out: Path = Path("out")
    """Folder of gap.html and gap.png."""

    def run(self) -> int:
        """Compares, and returns the exit code."""
        from auvsim.cli import compare

        return compare.run(
            self.log, vehicle=self.vehicle, parameters=self.parameters, columns=self.columns, out=self.out
        )


@dataclass(frozen=True, kw_only=True)
class Export:
    """Writes a log for other programs: MCAP with ROS 2 messages and a Foxglove layout, CSV, or MATLAB.

    MCAP (pip install 'auvsim[ros]') turns NED into ENU and the body to forward, port, up, and holds the definitions of
    its messages; CSV has the columns that `auvsim identify` and `auvsim estimate` read; .mat has the whole log.
    """

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL.nc")]
    """Log of a trial, of one vehicle or several."""
    to: Literal["mcap", "csv", "mat"]
    """Format."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """File; by default beside the log, with its name. CSV of several vehicles is FILE.NAME.csv each."""

    def run(self) -> int:
        """Writes the file, and returns the exit code."""
        from auvsim.cli import export

        return export.run(self.log, to=self.to, out=self.out)
