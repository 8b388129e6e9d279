"""Pictures of an identification: what was held out beside what the models predict, and what is known of each parameter.

Figures 4 and 5 of paper 1 (Qiu and Li 2019) on a held-out manoeuvre: states over time, and the track.
"""

import math
import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.style import dress
from auvsim.identification.identifiability import WEAK, sizes
from auvsim.identification.judgement import HoldoutResult, root_mean_square
from auvsim.identification.pipeline import Identification
from auvsim.identification.records import MEASURED
from auvsim.physics.planar_sets import UNITS
from estimators.core.types import Array

MEASURED_STYLE: dict[str, Any] = {"color": "#444444", "marker": ".", "ms": 3.0, "ls": "", "alpha": 0.35}
START, FIT = "#d95f02", "#1f5fa8"
START_STYLE: dict[str, Any] = {"color": START, "lw": 1.1, "ls": (0, (6, 3)), "label": "start"}
KNOWN, UNKNOWN = "#1f5fa8", "#b03060"
TURN = math.degrees(1.0)
# Channel of MEASURED, column of a prediction's states, factor to the unit shown, label.
_STATES = (
    ("heading", 2, TURN, "heading\n[deg]"),
    ("surge", 3, 1.0, "surge u\n[m/s]"),
    ("sway", 4, 1.0, "sway v\n[m/s]"),
    ("yaw_rate", 5, TURN, "yaw rate r\n[deg/s]"),
)


def overview(found: Identification) -> Figure:
    """All panels on one page."""
    lines = [f"{'+' if v.good else '!'}  {v.text}" for v in found.verdicts]
    said = "\n".join(textwrap.fill(line, 165, subsequent_indent="    ") for line in lines)
    words = 0.24 + 0.19 * (said.count("\n") + 1)  # [in]
    figure = Figure(figsize=(15.0, 17.5 + words), layout="constrained")
    top, upper, middle, lower = np.asarray(figure.subfigures(4, 1, height_ratios=(words, 6.8, 5.1, 5.6))).tolist()
    top.text(0.01, 0.5, said, fontsize=10.5, va="center", linespacing=1.25)
    judged = hardest(found)
    states_panels(upper, judged)
    left, right = middle.subplots(1, 2)
    track_panel(left, judged)
    growth_panel(right, found)
    left, right = lower.subplots(1, 2, width_ratios=(1.25, 1.0))
    parameter_panel(left, found)
    correlation_panel(right, found)
    figure.suptitle(f"Planar model of {found.vehicle}, from {len(found.readings.sources)} files", fontsize=14)
    return figure


def hardest(found: Identification) -> HoldoutResult:
    """The held-out record that the fit predicts worst: the one to look at."""
    return max(found.judged, key=lambda judged: judged.share)


def states_panels(figure: Any, judged: HoldoutResult) -> None:
    """Figure 4: rudder, heading and velocities over time, predicted open loop from the first start on."""
    axes: Any = figure.subplots(5, 1, sharex=True, height_ratios=(0.6, 1, 1, 1, 1))
    fit, start, first = judged.fit[0], judged.start[0], judged.firsts[0]
    rows = slice(first, first + len(fit.times))
    rudder = np.degrees(judged.record.inputs[rows, 0])
    axes[0].plot(fit.times, rudder, color="black", lw=1.1)
    axes[0].set_ylim(*_limits(float(rudder.min()), float(rudder.max()), least=1.0))  # a rudder held is a line
    dress(axes[0], f"Held out: {judged.record.name}, predicted from its rudder and shaft alone", "", "rudder\n[deg]")
    for panel, (channel, column, factor, label) in zip(axes[1:], _STATES, strict=True):
        measured = judged.record.measured[rows, MEASURED.index(channel)]
        offset = _turns(measured, fit.states[:, column]) if channel == "heading" else 0.0
        panel.plot(fit.times, factor * (measured - offset), **MEASURED_STYLE, label="measured")
        panel.plot(fit.times, factor * fit.states[:, column], color=FIT, lw=2.0, label="fit")
        panel.plot(fit.times, factor * start.states[:, column], **START_STYLE)
        if not np.isfinite(measured).any():
            panel.text(0.01, 0.06, "not measured", transform=panel.transAxes, fontsize=9.5, color="#777777")
        dress(panel, "", "", label)
        values = factor * np.concatenate([fit.states[:, column], start.states[:, column]])
        shown = np.concatenate([values, factor * (measured - offset)[np.isfinite(measured)]])
        low, high = np.percentile(shown, (0.5, 99.5))
        panel.set_ylim(*_limits(min(low, values.min()), max(high, values.max())))
    figure.align_ylabels(list(axes))
    axes[1].legend(loc="best", ncols=3, fontsize=9.5, framealpha=0.9)
    axes[-1].set_xlabel("time since the prediction began [s]", fontsize=10.5)
    axes[-1].set_xlim(0.0, fit.times[-1])


def _turns(measured: Array, modelled: Array) -> float:
    """Whole turns between two headings [rad]: each may have been counted from another."""
    there = np.isfinite(measured)
    return 2.0 * math.pi * round(float(np.mean((measured - modelled)[there])) / (2.0 * math.pi)) if there.any() else 0.0


def _limits(low: float, high: float, least: float = 1e-3) -> tuple[float, float]:
    margin = max(0.08 * (high - low), least)
    return low - margin, high + margin


def track_panel(axes: Axes, judged: HoldoutResult) -> None:
    """Figure 5: the tracks of the same prediction."""
    fit, start, first = judged.fit[0], judged.start[0], judged.firsts[0]
    fixes = judged.record.measured[first : first + len(fit.times), :2]
    axes.plot(*fit.reference.T[::-1], color="#444444", lw=3.5, alpha=0.45, label="measured")
    axes.plot(fixes[:, 1], fixes[:, 0], ".", color="#444444", ms=5, label="fixes")
    axes.plot(fit.states[:, 1], fit.states[:, 0], color=FIT, lw=2.0, label="fit")
    axes.plot(start.states[:, 1], start.states[:, 0], **START_STYLE)
    axes.plot(fit.states[0, 1], fit.states[0, 0], "o", color="black", ms=6, mfc="white", label="prediction begins")
    axes.plot(fit.states[-1, 1], fit.states[-1, 0], "o", color=FIT, ms=5)
    axes.plot(start.states[-1, 1], start.states[-1, 0], "o", color=START, ms=5)
    axes.plot(fit.reference[-1, 1], fit.reference[-1, 0], "o", color="#444444", ms=5)
    axes.set_aspect("equal", adjustable="datalim")
    dress(axes, f"Track over {judged.seconds:.0f} s", "east [m]", "north [m]")
    axes.legend(loc="best", fontsize=9.5, framealpha=0.9)


def growth_panel(axes: Axes, found: Identification) -> None:
    """Position error by the distance run, growing with time, of all predictions and their rms."""
    seconds = min(judged.seconds for judged in found.judged)
    times = np.linspace(seconds / 6.0, seconds, 11)  # on the first metres the start's own error is all there is
    for name, colour in (("start", START), ("fit", FIT)):
        predictions = [p for judged in found.judged for p in getattr(judged, name)]
        for p in predictions:
            axes.plot(times, [100.0 * p.share_at(t) for t in times.tolist()], color=colour, lw=0.5, alpha=0.35)
        rms = 100.0 * root_mean_square(predictions, times, share=True)
        axes.plot(times, rms, color=colour, lw=2.2, marker="o", ms=4, label=f"{name}, rms of {len(predictions)}")
    dress(axes, "Held-out position error", "time since the prediction began [s]", "error by distance run [%]")
    axes.set_xlim(0.0, seconds)
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="best", fontsize=9.5)


def parameter_panel(axes: Axes, found: Identification, *, numbers: bool = True) -> None:
    """Each free parameter with its start and interval, relative to its size, the best known on top."""
    fit, assessed = found.fit, found.identifiability
    size = dict(zip(fit.free, sizes(fit).tolist(), strict=True))
    reach = 2.0
    for row, name in enumerate(assessed.names):
        low, high = found.intervals[name]
        value, start = getattr(fit.parameters, name), getattr(found.start, name)
        colour = UNKNOWN if name in assessed.weak else KNOWN
        ends = [max(low / size[name], -reach), min(high / size[name], reach)]
        axes.plot(ends, [row, row], color=colour, lw=3.0, alpha=0.6, solid_capstyle="butt")
        axes.plot(value / size[name], row, "o", color=colour, ms=6)
        axes.plot(start / size[name], row, "|", color=START, ms=13, mew=2.2)
        text = f"{value:.4g}  [{low:.4g}, {high:.4g}] {UNITS[name]}"
        if numbers:
            axes.text(1.01, row, text, transform=axes.get_yaxis_transform(), fontsize=9.5, va="center", color=colour)
    axes.set_yticks(range(len(assessed.names)), assessed.names)
    axes.invert_yaxis()
    axes.axvline(0.0, color="#888888", lw=0.8)
    axes.set_xlim(-1.6, 1.6)
    weak = f"; red: deviation above {WEAK:.0%}" if assessed.weak else ""
    title = "Parameters (dot), 95 % interval (bar), start (tick)"
    dress(axes, title, f"value by the larger of start and fit{weak}", "")


def correlation_panel(axes: Axes, found: Identification) -> None:
    """Correlations of the free parameters."""
    fit = found.fit
    with np.errstate(invalid="ignore"):
        correlation = fit.correlation
    axes.imshow(correlation, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    for (i, j), value in np.ndenumerate(correlation):
        if i != j and abs(value) >= 0.5:
            colour = "white" if abs(value) > 0.8 else "black"
            axes.text(j, i, f"{value:.2f}".replace("0.", "."), ha="center", va="center", fontsize=7.5, color=colour)
    axes.set_xticks(range(len(fit.free)), fit.free, rotation=90, fontsize=9)
    axes.set_yticks(range(len(fit.free)), fit.free, fontsize=9)
    axes.set_title("Correlation of the estimates", fontsize=11.5)
