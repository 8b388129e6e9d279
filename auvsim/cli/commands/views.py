"""Commands that make the products of a log again."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from auvsim.base.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Video:
    """Draws a video beside a log, docking.mp4 of one vehicle and its dock, else run.mp4; or one picture of it."""

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL.nc")]
    """Log of a trial."""
    camera: tuple[str, ...] = ()
    """Up to four of overview, follow, above, dock, and map, sonar of a sonar: the main view and those beside it."""
    speed: float | None = None
    """Speed-up far from the dock; by default such that the video lasts less than a minute."""
    still: Path | None = None
    """Draw only this picture (PNG), of the moment before the nose comes nearest to the mouth or of --time."""
    time: float | None = None
    """Time of that picture [s]."""

    def run(self) -> int:
        """Draws, and returns the exit code.

        Raises:
            InputError: The options contradict each other or are no times.
        """
        from auvsim.cli import products

        for name, value in (("time", self.time), ("speed", self.speed)):
            if value is not None and not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"command line: --{name} {value:g}: give a finite number that is not negative")
        if self.still is not None:
            return products.again(self.log, products.still, path=self.still, time=self.time, cameras=self.camera)
        if self.time is not None:
            raise InputError("command line: --time goes with --still")
        return products.again(self.log, products.video, speed=self.speed, cameras=self.camera)


@dataclass(frozen=True, kw_only=True)
class Plot:
    """Draws track.png and estimates.png beside a log; of a manoeuvre its own picture, of several vehicles fleet.png.

    Of a vehicle that navigates by a sonar also sonar.png, feature_map.png and, as data, feature_map.nc.
    """

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL.nc")]
    """Log of a trial."""

    def run(self) -> int:
        """Draws, and returns the exit code."""
        from auvsim.cli import products

        return products.again(self.log, products.plots)


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """Writes summary.json beside a log and prints it."""

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="TRIAL.nc")]
    """Log of a trial."""

    def run(self) -> int:
        """Prints and writes the summary, and returns the exit code."""
        from auvsim.cli import products

        return products.again(self.log, products.show_summary)
