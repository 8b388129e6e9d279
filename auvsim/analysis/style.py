"""How the pictures of a run draw what they share: phases in their colours, events as ticks, one style of axes."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.estimates import fix_fates, refusals
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog
from auvsim.data.phases import phase_at, phase_stretches

SIZE = (14.0, 9.0)  # of a picture [in]
DPI = 110
PHASE_COLOURS = {
    "search": "#7f7f7f",
    "homing": "#1f77b4",
    "approach": "#17a2a2",
    "final": "#2ca02c",
    "docked": "#9467bd",
    "go_around": "#ff7f0e",
    "aborted": "#d62728",
    "manoeuvre": "#1f77b4",
    "under_way": "#1f77b4",
    "done": "#9467bd",
    "fix": "#c2185b",
    "dive": "#444444",
    "lanes": "#b8a000",
    "surface": "#e377c2",
    "home": "#8c564b",
}
OTHER_PHASES = ("#1f77b4", "#17a2a2", "#2ca02c", "#ff7f0e", "#9467bd", "#8c564b")  # of missions of the user's own
MOST_IN_ROW = 13  # entries of a legend
LONGEST_ROW = 175  # of a legend, in letters, of which the sample of an entry takes six
NO_PHASE = "#444444"
VEHICLES = ("#1f77b4", "#d95f02", "#2c8c2c", "#9467bd", "#c2185b", "#7f6a00", "#17a2a2", "#444444")
DOCK = "#8c4a1f"
WATER = "#0055aa"
OUTLIER = "#d62728"
ARRIVED = "#2c7a2c"
BAND, BAND_EDGE = (0.30, 0.45, 0.69, 0.22), "#4c72b0"


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Writes a figure as PNG, whole or not at all.

    Raises:
        InputError: if the file cannot be written.
    """
    try:
        with whole(Path(path)) as partial:
            figure.savefig(partial, dpi=DPI, format="png")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def phase_line(axes: Axes, log: VehicleLog, x: Array, y: Array, *, width: float = 2.2) -> None:
    """A line of the truth in the colours of the phases."""
    named: set[int] = set()
    phases = phase_at(log, log["truth"]["time"])
    phases[phases < 0] = next(iter(log["mission"]["phase"]), -1)  # the start, before the mission first spoke
    for phase, start, stop in phase_stretches(phases):
        part = slice(start, stop + 1)  # up to the next stretch, so that no gap shows
        label = None if phase in named else phase_name(log.phases, phase)
        axes.plot(x[part], y[part], color=phase_colour(log.phases, phase), lw=width, label=label)
        named.add(phase)


def phase_name(phases: Sequence[str], phase: int) -> str:
    """A phase in a legend; -1 stands for a log in which the mission said nothing yet."""
    return phases[phase].replace("_", " ") if phase >= 0 else "truth"


def phase_colour(phases: Sequence[str], phase: int) -> str:
    """The colour of a phase; -1 stands for a log in which the mission said nothing yet."""
    return PHASE_COLOURS.get(phases[phase], OTHER_PHASES[phase % len(OTHER_PHASES)]) if phase >= 0 else NO_PHASE


def vehicle_colour(index: int) -> str:
    """The colour of a vehicle among several, by its number."""
    return VEHICLES[index % len(VEHICLES)]


def dress(axes: Axes, title: str, x: str, y: str) -> None:
    """Titles, units, grid and sizes of letters."""
    axes.set_title(title, fontsize=11.5)
    axes.set_xlabel(x, fontsize=10.5)
    axes.set_ylabel(y, fontsize=10.5)
    axes.tick_params(labelsize=9.5)
    axes.grid(color="#cccccc", lw=0.6)
    axes.set_axisbelow(True)


def event_ticks(axes: Axes, log: VehicleLog) -> None:
    """Ticks along the lower edge: fixes when they arrived, and when the estimator refused readings."""
    arrived = log["usbl"]["received"][~log["usbl"]["lost"]] if "usbl" in log else []
    refused, _ = refusals(log)
    for times, colour, width in ((arrived, ARRIVED, 1.0), (refused, OUTLIER, 1.6)):
        axes.vlines(times, 0.0, 0.07, color=colour, lw=width, transform=axes.get_xaxis_transform(), zorder=4)


def refused_fixes(axes: Axes, log: VehicleLog, places: Array) -> None:
    """Rings round the refused ones among the fixes' places (n, 2), with their reason in the legend."""
    fates = fix_fates(log)
    for reason in sorted({*fates.tolist()} - {""}):
        label = f"refused: {reason.replace('_', ' ')}"
        axes.plot(*places[fates == reason].T, "o", mfc="none", mec=OUTLIER, ms=11, mew=1.2, label=label, zorder=6)


def shade_phases(axes: Axes, log: VehicleLog) -> None:
    """Colours the background by phase, over the time that the mission logged."""
    time = log["mission"]["time"]
    for phase, start, stop in phase_stretches(log["mission"]["phase"].astype(int)):
        axes.axvspan(time[start], time[stop], color=phase_colour(log.phases, phase), alpha=0.12, lw=0.0, zorder=0)
    if len(time):
        axes.set(xlim=(time[0], time[-1]))


def legend(figure: Figure, entries: dict[str, Any]) -> None:
    """One row below all axes, or two where there are many entries or long ones."""
    handles, labels = list(entries.values()), list(entries)
    fits = len(labels) <= MOST_IN_ROW and sum(len(label) + 6 for label in labels) <= LONGEST_ROW
    columns = len(labels) if fits else (len(labels) + 1) // 2
    style: dict[str, Any] = {"fontsize": 9.5, "frameon": False, "columnspacing": 1.4}
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, **style)
