"""`auvsim formation`: what leaders can tell a follower, where each should move, as a table and a map."""

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from auvsim.analysis import formation_map
from auvsim.analysis.formation_map import Formation, Judgement
from auvsim.base.errors import InputError
from auvsim.base.frames import Array
from auvsim.cli.run import output_folder
from auvsim.reproduce.products import write_files

MOST = 50  # leaders
WIDTH = 110  # of the table [columns]
BOUNDS = {  # of the options, both included; units as in the help
    "--noise": (1e-4, 1e6), "--step": (1e-3, 1e6), "--reach": (1e-3, 1e7), "--speed": (0.0, 100.0),
    "--apart": (0.0, 1e7),
}  # fmt: skip


def run(formation: Formation, out: Path) -> int:
    """Judges a formation, prints the table and writes formation.png and formation.csv.

    Returns:
        The exit code.

    Raises:
        InputError: For a folder that cannot be written to.
    """
    found = formation_map.judge(formation)
    with output_folder(out):
        written = write_files(
            out, {"formation.csv": rows(formation, found)}, {"formation.png": formation_map.draw(formation, found)}
        )
    # Units stand in brackets. A narrow terminal breaks lines, where rich would break numbers.
    console = Console(markup=False, width=max(WIDTH, Console().width))
    console.print(table(formation, found))
    print(f"written: {', '.join(str(path) for path in written)}", file=sys.stderr)
    return 0


def formation(
    leaders: str, follower: str, noise: str, *, speed: float, heading_deg: float, step: float, reach: float,
    modem: float, apart: float,
) -> Formation:  # fmt: skip
    """A formation from the command line.

    Raises:
        InputError: One line that says what is wrong with it.
    """
    places = [_place(text, "--leaders") for text in leaders.split(";") if text.strip()]
    if not places:
        raise InputError('command line: --leaders names no leader; give "north,east;north,east;..." in metres')
    if len(places) > MOST:
        raise InputError(f"command line: --leaders names {len(places)}; {MOST} at most")
    own = _place(follower, "--follower")
    for index, place in enumerate(places):
        for other in places[:index]:
            if np.linalg.norm(place[:2] - other[:2]) == 0.0:
                raise InputError(f"command line: --leaders: two stand at {_text(place)}; give each a place of its own")
        if np.linalg.norm(place[:2] - own[:2]) == 0.0:
            raise InputError(f"command line: the follower is where a leader is, at {_text(place)}; move one of them")
    deviations = [_number(text, "--noise") for text in noise.split(",")]
    if len(deviations) not in (1, len(places)):
        raise InputError(f"command line: --noise has {len(deviations)} values, not 1 or {len(places)}, one each")
    given = [*(("--noise", one) for one in deviations), ("--step", step), ("--reach", reach), ("--speed", speed)]
    for name, value in (*given, ("--apart", apart)):
        low, high = BOUNDS[name]
        if not low <= value <= high:
            raise InputError(f"command line: {name} {value:g} must lie in {low:g} .. {high:g}")
    if not modem > 0.0:
        raise InputError(f"command line: --modem {modem:g} must be above 0 m")
    if not math.isfinite(heading_deg):
        raise InputError(f"command line: --heading-deg {heading_deg:g} must be a finite number")
    if apart >= modem:
        raise InputError(f"command line: --apart {apart:g} must be less than --modem {modem:g}")
    far = next((p for p in places if np.linalg.norm(p - own) > modem), None)
    if far is not None:
        raise InputError(f"command line: --leaders: the one at {_text(far)} is further from the follower than --modem "
                         f"{modem:g} m; no range comes from there")  # fmt: skip
    limits_of_moves = formation_map.Reach(distance=reach, modem=modem, apart=apart)
    return Formation(
        leaders=np.array(places), follower=own, deviations=np.resize(np.array(deviations), len(places)),
        speed=speed, heading=math.radians(heading_deg), step=step, reach=limits_of_moves,
    )  # fmt: skip


def table(f: Formation, found: Judgement) -> Table:
    """One line a leader, then all together."""
    title = (
        f"least rms error of the follower: {_metres(found.snapshot)} by one set of ranges, "
        f"{_metres(found.steady)} in steady motion"
    )
    if math.isinf(found.steady):
        title += "; all leaders are on one line with it"
    lines = Table(title=title)
    for heading in (
        "leader",
        "north [m]",
        "east [m]",
        "range [m]",
        "bearing [deg]",
        "best move to",
        "by [m]",
        "then [m]",
    ):
        lines.add_column(heading, justify="right")
    for index, (place, move) in enumerate(zip(f.leaders, found.moves, strict=True)):
        away = place - f.follower
        bearing = math.degrees(math.atan2(away[1], away[0])) % 360.0
        to = "stays" if move.distance == 0.0 else f"{move.place[0]:.0f}, {move.place[1]:.0f}"
        lines.add_row(
            str(index + 1), f"{place[0]:g}", f"{place[1]:g}", f"{np.linalg.norm(away):.0f}", f"{bearing:.0f}", to,
            f"{move.distance:.0f}", _metres(move.rms),
        )  # fmt: skip
    e = found.ellipse
    lines.add_section()
    lines.add_row("all", "", "", "", "", "see the map", "", _metres(found.together_rms))
    axes = f"{e.major:.2f} by {e.minor:.2f} m, major axis to {math.degrees(e.bearing):.0f} deg"
    axes = "open" if math.isinf(e.major) else axes
    best = f"the least error of one set of such ranges anywhere: {_metres(found.best_snapshot)}"
    lines.caption = f"ellipse of one set: {axes}; {best}"
    return lines


def rows(f: Formation, found: Judgement) -> Sequence[Sequence[object]]:
    """Heading and lines of formation.csv."""
    lines: list[Sequence[object]] = [
        ("leader", "north_m", "east_m", "depth_m", "noise_m", "move_north_m", "move_east_m", "then_steady_rms_m",
         "together_north_m", "together_east_m")
    ]  # fmt: skip
    for index, (place, move) in enumerate(zip(f.leaders, found.moves, strict=True)):
        lines.append((index + 1, *map(float, place), float(f.deviations[index]), *map(float, move.place), move.rms,
                      *map(float, found.together[index])))  # fmt: skip
    lines.append(("follower", *map(float, f.follower), "", "", "", found.steady, "", ""))
    return lines


def _place(text: str, option: str) -> Array:
    parts = text.split(",")
    if len(parts) not in (2, 3):
        raise InputError(f"command line: {option} '{_short(text)}': give north,east or north,east,depth in metres")
    values = [_number(part, option) for part in parts]
    place = np.array([*values, 0.0][:3])
    if place[2] < 0.0:
        raise InputError(f"command line: {option} '{_short(text)}': a depth of {place[2]:g} m is out of the water")
    return place


def _number(text: str, option: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"command line: {option} '{_short(text)}' is not a finite number")
    if abs(value) > 1e7:
        raise InputError(f"command line: {option} {value:g} m is further than vehicles hear; 1e7 at most")
    return value


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _text(place: Array) -> str:
    return f"{place[0]:g}, {place[1]:g}"


def _metres(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.2f} m"
