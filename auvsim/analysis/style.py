"""How the pictures of a trial draw what they share: phases in their colours, events as ticks, one style of axes."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.base.frames import Array
from auvsim.data.log import PHASES, TrialLog
from auvsim.missions.docking.metrics import phase_at, phase_stretches

PHASE_COLOURS = ("#7f7f7f", "#1f77b4", "#17a2a2", "#2ca02c", "#9467bd", "#ff7f0e", "#d62728", "#1f77b4")  # as in PHASES
NO_PHASE = "#444444"
DOCK = "#8c4a1f"
WATER = "#0055aa"
OUTLIER = "#d62728"
ARRIVED = "#2c7a2c"
BAND, BAND_EDGE = (0.30, 0.45, 0.69, 0.22), "#4c72b0"


def phase_line(axes: Axes, log: TrialLog, x: Array, y: Array, *, width: float = 2.2) -> None:
    """A line of the truth in the colours of the phases."""
    named: set[int] = set()
    phases = phase_at(log, log["truth"]["time"])
    phases[phases < 0] = next(iter(log["guidance"]["phase"]), -1)  # the start, before guidance first spoke
    for phase, start, stop in phase_stretches(phases):
        part = slice(start, stop + 1)  # up to the next stretch, so that no gap shows
        label = None if phase in named else phase_name(phase)
        axes.plot(x[part], y[part], color=phase_colour(phase), lw=width, label=label)
        named.add(phase)


def phase_name(phase: int) -> str:
    """A phase in a legend; -1 stands for a log without guidance."""
    return PHASES[phase].replace("_", " ") if phase >= 0 else "truth"


def phase_colour(phase: int) -> str:
    """The colour of a phase; -1 stands for a log without guidance."""
    return PHASE_COLOURS[phase] if phase >= 0 else NO_PHASE


def dress(axes: Axes, title: str, x: str, y: str) -> None:
    """Titles, units, grid and sizes of letters."""
    axes.set_title(title, fontsize=11.5)
    axes.set_xlabel(x, fontsize=10.5)
    axes.set_ylabel(y, fontsize=10.5)
    axes.tick_params(labelsize=9.5)
    axes.grid(color="#cccccc", lw=0.6)
    axes.set_axisbelow(True)


def event_ticks(axes: Axes, log: TrialLog) -> None:
    """Ticks along the lower edge: fixes when they arrived, and when the estimator refused readings."""
    usbl, estimate = log["usbl"], log["estimate"]
    arrived = usbl["received"][~usbl["lost"]]
    refused = estimate["time"][1:][np.diff(estimate["refused"]) > 0]
    for times, colour, width in ((arrived, ARRIVED, 1.0), (refused, OUTLIER, 1.6)):
        axes.vlines(times, 0.0, 0.07, color=colour, lw=width, transform=axes.get_xaxis_transform(), zorder=4)


def shade_phases(axes: Axes, log: TrialLog) -> None:
    """Colours the background by phase, over the time that the guidance logged."""
    time = log["guidance"]["time"]
    for phase, start, stop in phase_stretches(log["guidance"]["phase"].astype(int)):
        axes.axvspan(time[start], time[stop], color=phase_colour(phase), alpha=0.12, lw=0.0, zorder=0)
    if len(time):
        axes.set(xlim=(time[0], time[-1]))


def legend(figure: Figure, entries: dict[str, Any]) -> None:
    """One row below all axes."""
    handles, labels = list(entries.values()), list(entries)
    style: dict[str, Any] = {"fontsize": 9.5, "frameon": False, "columnspacing": 1.4}
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), **style)
