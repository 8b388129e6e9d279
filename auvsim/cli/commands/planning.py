"""Commands that judge a mission, a formation, modems or a vehicle before anything is run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from auvsim.base.errors import InputError


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

    def run(self, values: dict[str, Any]) -> int:
        """Draws the maps, with scenario keys that were given as options; returns the exit code."""
        from auvsim.cli import bound, options
        from auvsim.simulation.loading import find

        scenario = options.scenario(find(self.scenario), None, values, self.seed, 0)
        return bound.run(
            scenario, out=self.out, move=self.move, span=self.span, side=self.side, after=self.after,
            blind=self.blind, seed=self.seed,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Floor:
    """Maps where a sonar's frames can be matched over a floor, before a mission: floor.png and floor.nc.

    The Cramer-Rao bound of one match with the frame that it would be matched with, from relief and backscatter, beside
    speckle and noise; with the planned lanes. Any key of the scenario is an option too, as of `auvsim run`:
    `auvsim floor depths.nc --water.terrain.latitude 59.4 --water.terrain.longitude 10.5`.
    """

    floor: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DEPTHS|SCENARIO.yaml|NAME")]
    """File of depths on a grid, such as NetCDF by CF conventions, or a scenario whose floor it is, such as survey."""
    scenario: Annotated[str | None, tyro.conf.arg(metavar="SCENARIO.yaml|NAME")] = None
    """Where depths are given: the scenario of the vehicle, its sonar and its lanes; by default survey."""
    altitude: float | None = None
    """Height above the floor [m]; by default that of the mission."""
    holds: float = 0.1
    """Standard deviation of a match up to which matching counts as holding [m]."""
    spacing: float = 1.0
    """Between points of the map [m]."""
    out: Path = Path("out")
    """Folder of the map and the data."""

    def run(self, values: dict[str, Any]) -> int:
        """Judges the floor with scenario keys that were given as options; returns the exit code."""
        from auvsim.cli import floor

        return floor.run(
            self.floor, scenario=self.scenario, values=values, altitude=self.altitude, holds=self.holds,
            spacing=self.spacing, out=self.out,
        )  # fmt: skip


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

    def run(self) -> int:
        """Judges the formation, and returns the exit code."""
        from auvsim.cli import formation

        judged = formation.formation(
            self.leaders, self.follower, self.noise, speed=self.speed, heading_deg=self.heading_deg, step=self.step,
            reach=self.reach, modem=self.modem, apart=self.apart,
        )  # fmt: skip
        return formation.run(judged, self.out)


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

    def run(self) -> int:
        """Draws the chart, and returns the exit code."""
        from auvsim.cli import modem

        return modem.run(
            self.name, followers=self.followers, period=self.period, distance=self.distance, duration=self.duration,
            seed=self.seed, out=self.out,
        )  # fmt: skip


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

    def run(self) -> int:
        """Shows or makes the vehicle, and returns the exit code.

        Raises:
            InputError: Neither a name nor a sheet is given, or both are.
        """
        from auvsim.cli import vehicle

        if (self.name is None) == (self.sheet is None):
            raise InputError("command line: give the name of a vehicle, or --from SHEET.yaml")
        if self.sheet is not None:
            return vehicle.from_sheet(self.sheet, self.out or Path("vehicle"))
        return vehicle.show(self.name or "", self.out)
