"""Picture of navigation by a sonar, from a log: errors over time, raw and turned, beside what the filter claims."""

import math
import os
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from auvsim.analysis import sonar_path
from auvsim.analysis.estimates import estimate_errors
from auvsim.analysis.plots import which_run
from auvsim.analysis.sonar_path import SonarPath, TurnedErrors
from auvsim.analysis.style import BAND, BAND_EDGE, SIZE, dress, legend, phase_colour, phase_name, save, shade_phases
from auvsim.base.frames import Array
from auvsim.data.log import VehicleLog

RAW, TURNED, KEPT, CLOSED = "#1a1a1a", "#c2185b", "#1f77b4", "#2c7a2c"


def navigation(log: VehicleLog, path: SonarPath, file: str | os.PathLike[str]) -> None:
    """Writes the picture (PNG).

    Raises:
        InputError: it cannot be written.
    """
    save(navigation_figure(log, path), file)


def navigation_figure(log: VehicleLog, path: SonarPath) -> Figure:
    """The figure that `navigation` writes."""
    figure = Figure(figsize=SIZE, layout="constrained")
    grid = figure.add_gridspec(4, 1, height_ratios=(3.0, 2.2, 2.0, 1.2))
    position = figure.add_subplot(grid[0])
    panels = [position, *(figure.add_subplot(grid[k], sharex=position) for k in (1, 2, 3))]
    live, kept = sonar_path.turned_errors(log), sonar_path.turned_path_errors(log, path)
    _position(position, log, path)
    _turned(panels[1], live, kept)
    _heading(panels[2], log, path)
    _closures(panels[3], log)
    for axes in panels:
        shade_phases(axes, log)
        axes.tick_params(labelbottom=axes is panels[-1])
    found = sonar_path.closures(log)
    for axes in panels[:3]:
        axes.vlines(
            np.unique(found.times), 0.0, 0.06, color=CLOSED, lw=0.8, transform=axes.get_xaxis_transform(), zorder=4
        )
    entries = {
        "estimate": panels[0].get_lines()[0],
        "keyframes, given all": panels[0].get_lines()[1],
        "2σ claimed, worst axis": Patch(facecolor=BAND, edgecolor=BAND_EDGE),
        "loop closures believed": Patch(color=CLOSED),
    }
    for phase in sorted(set(log["mission"]["phase"].tolist())):
        entries[phase_name(log.phases, phase)] = Patch(color=phase_colour(log.phases, phase), alpha=0.25)
    legend(figure, entries)
    figure.suptitle(f"Navigation by the sonar, {which_run(log)}", fontsize=13)
    return figure


def _position(axes: Axes, log: VehicleLog, path: SonarPath) -> None:
    errors = estimate_errors(log)
    seen = errors.initialised
    time, off = errors.time[seen], np.hypot(*errors.position[seen, :2].T)
    claimed = 2.0 * _worst(log["estimate"]["covariance"][seen][:, :2, :2])
    axes.fill_between(time, 0.0, claimed, facecolor=BAND, edgecolor=BAND_EDGE, lw=0.9)
    axes.plot(time, off, color=RAW, lw=1.1)
    axes.plot(path.times, np.hypot(*sonar_path.path_errors(log, path)[:, :2].T), ".", color=KEPT, ms=4)
    late = time > time[0] + 20.0 if len(time) else np.zeros(0, dtype=bool)
    if late.any():
        axes.set(ylim=(0.0, 1.15 * max(float(np.percentile(claimed[late], 98.0)), float(off[late].max()))))
    dress(axes, "Horizontal error, by the distance", "", "error [m]")


def _turned(axes: Axes, live: TurnedErrors | None, kept: TurnedErrors | None) -> None:
    said = []
    for found, colour, dots, name in ((live, RAW, "-", "estimate"), (kept, KEPT, ".", "keyframes")):
        if found is not None:
            axes.plot(found.times, np.hypot(*found.errors.T), dots, color=colour, lw=1.1, ms=4)
            said.append(f"{name} {found.rms:.2f} m rms over the lanes, turned by {math.degrees(found.angle):+.2f}°")
    axes.set(ylim=(0.0, None))
    style: dict[str, Any] = {"va": "top", "fontsize": 10.0, "bbox": {"fc": "white", "ec": "none", "alpha": 0.75}}
    axes.text(0.1, 0.95, "\n".join(said), transform=axes.transAxes, **style)
    dress(axes, "The same from the dive point on, after the rotation about it that fits best", "", "error [m]")


def _heading(axes: Axes, log: VehicleLog, path: SonarPath) -> None:
    errors = estimate_errors(log)
    seen = errors.initialised
    axes.plot(errors.time[seen], np.degrees(errors.heading[seen]), color=RAW, lw=0.5, alpha=0.55)
    deviation = np.degrees(np.sqrt(path.covariances[:, 2, 2]))
    axes.fill_between(path.times, -2.0 * deviation, 2.0 * deviation, facecolor=BAND, edgecolor=BAND_EDGE, lw=0.9)
    axes.plot(path.times, np.degrees(sonar_path.path_errors(log, path)[:, 2]), ".", color=KEPT, ms=4)
    axes.axhline(0.0, color="#888888", lw=0.7)
    dress(axes, "Heading, 2σ of the keyframes", "", "error [deg]")


def _closures(axes: Axes, log: VehicleLog) -> None:
    if "matching" in log:
        rows = log["matching"]
        axes.step(rows["time"], rows["closures"], where="post", color=CLOSED, lw=1.6)
    dress(axes, "Loop closures believed so far", "time [s]", "number [-]")


def _worst(covariances: Array) -> Array:
    """Standard deviations (n,) along the longest axes of covariances (n, 2, 2)."""
    return np.sqrt(np.linalg.eigvalsh(covariances)[:, -1])
