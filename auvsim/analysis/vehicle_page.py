"""The page of a vehicle (PNG): what its sea trials or hovering trials show, and the numbers beside a data sheet's."""

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.style import dress, save
from auvsim.simulation.hover_trials import HoverTrials
from auvsim.simulation.sea_trials import DIVE, SeaTrials

SIZE = (10.6, 6.2)  # [in]
RPM = 60.0 / (2.0 * math.pi)
COLOURS = ("#1f77b4", "#d95f02", "#2c8c2c", "#9467bd", "#c2185b", "#7f6a00")
Row = tuple[str, str, str]  # of what, value, unit


def draw(trials: SeaTrials | HoverTrials, path: str | os.PathLike[str]) -> None:
    """Writes the page.

    Raises:
        InputError: it cannot be written.
    """
    save(figure(trials), path)


def figure(trials: SeaTrials | HoverTrials) -> Figure:
    """The figure that `draw` writes."""
    made = Figure(figsize=SIZE, layout="constrained")
    axes = made.subplots(2, 3)
    shown: Any = trials
    if isinstance(trials, SeaTrials):
        panels = (_speeds, _turns, _zigzag, _dive, _stops)
        made.suptitle(f"{trials.model}: sea trials in still water, at {trials.cruise:.2f} m/s", fontsize=13)
    else:
        panels = (_forces, _turning, _stop, _step, _holding)
        made.suptitle(f"{trials.model}: hovering trials", fontsize=13)
    for panel, where in zip(panels, axes.flat, strict=False):
        panel(where, shown)
    _table(axes.flat[5], rows(trials))
    return made


def rows(trials: SeaTrials | HoverTrials) -> list[Row]:
    """Name, value and unit of each number, as a data sheet lists them."""
    return _sea_rows(trials) if isinstance(trials, SeaTrials) else _hover_rows(trials)


def _sea_rows(t: SeaTrials) -> list[Row]:
    found = [
        ("mass, length", f"{t.mass:.4g}, {t.length:.4g}", "kg, m"),
        ("net buoyancy", _number(t.buoyancy), "N"),
        ("top speed", f"{t.speeds[-1, 1]:.2f} at {t.speeds[-1, 0] * RPM:.0f}", "m/s, rpm"),
        ("speed of the trials", f"{t.cruise:.2f}", "m/s"),
        ("pitch, stern plane there", f"{_degrees(t.pitch)}, {_degrees(t.elevator)}", "deg"),
        ("roll there", _degrees(t.roll), "deg"),
    ]
    for turn in t.turns:
        f, name = turn.figures, f"rudder {math.degrees(turn.rudder):.1f}"
        found += [
            (f"{name}: advance, transfer", f"{_number(f['advance'])}, {_number(f['transfer'])}", "m"),
            (
                f"{name}: tactical, steady diam.",
                f"{_number(f['tactical_diameter'])}, {_number(f['steady_diameter'])}",
                "m",
            ),
            (f"{name}: yaw rate", _number(f.get("steady_yaw_rate_deg")), "deg/s"),
            (
                f"{name}: drift, speed loss",
                f"{_number(f.get('steady_drift_deg'))}, {_number(f.get('speed_loss'))}",
                "deg, %",
            ),
        ]
    z = t.zigzag
    return [
        *found,
        (
            "zig-zag 10/10: overshoots",
            f"{_number(z['first_overshoot_deg'])}, {_number(z['second_overshoot_deg'])}",
            "deg",
        ),
        ("zig-zag 10/10: period", _number(z["period"]), "s"),
        (f"dive of {DIVE:g} m: time, overshoot", f"{_number(t.dive_time)}, {t.dive_overshoot:.2f}", "s, m"),
        ("full astern: distance, time", f"{t.astern.distance:.2f}, {t.astern.time:.1f}", "m, s"),
        ("shaft stopped, to half speed", f"{t.coasting.distance:.2f}, {t.coasting.time:.1f}", "m, s"),
        ("planar fit: error u, v, r", ", ".join(f"{100.0 * share:.2g}" for share in t.fit_error), "%"),
    ]


def _hover_rows(t: HoverTrials) -> list[Row]:
    units = {"turning": ("N m", "rad/s")}
    found = [
        ("mass, length", f"{t.mass:.4g}, {t.length:.4g}", "kg, m"),
        ("net buoyancy", _number(t.buoyancy), "N"),
        ("thrust to hover, of the largest", f"{100.0 * t.hover_share:.2g}", "%"),
    ]
    for axis in t.axes:
        force, speed = axis.top
        found.append((axis.name, f"{speed:.2f} at {force:.1f}", ", ".join(units.get(axis.name, ("N", "m/s"))[::-1])))
    return [
        *found,
        ("stop from 0.75 of top speed", f"{t.stopping_distance:.2f}, {t.stopping_time:.1f}", "m, s"),
        ("step of 1 m: rise, overshoot", f"{_number(t.rise_time)}, {t.overshoot:.2f}", "s, m"),
        *((f"holds {speed:.1f} m/s across: error", f"{error:.3f}", "m") for speed, error, _ in t.holding.tolist()),
    ]


def _number(value: float | None) -> str:
    if value is None or not math.isfinite(value):
        return "-"
    return f"{0.0 if abs(value) < 5e-3 else value:.3g}"


def _degrees(value: float) -> str:
    return f"{math.degrees(value) + 0.0:.1f}".replace("-0.0", "0.0")


def _table(axes: Axes, lines: Sequence[Row]) -> None:
    axes.axis("off")
    table = axes.table(cellText=lines, loc="upper left", cellLoc="left", colWidths=(0.58, 0.31, 0.19), edges="open")
    table.auto_set_font_size(False)
    table.set_fontsize(6.8)
    table.scale(1.05, 0.82)


def _speeds(axes: Axes, t: SeaTrials) -> None:
    axes.plot(t.speeds[:, 0] * RPM, t.speeds[:, 1], "o-", color=COLOURS[0], ms=4)
    dress(axes, "Speed on a straight course", "shaft speed [rpm]", "speed [m/s]")
    axes.set(xlim=(0.0, None), ylim=(0.0, None))


def _turns(axes: Axes, t: SeaTrials) -> None:
    for turn, colour in zip(t.turns, COLOURS, strict=False):
        axes.plot(turn.track[:, 1], turn.track[:, 0], color=colour, label=f"rudder {math.degrees(turn.rudder):.1f} deg")
    axes.plot(0.0, 0.0, "k.", ms=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(fontsize=9, loc="best")
    dress(axes, "Turning circles", "to starboard [m]", "ahead [m]")


def _zigzag(axes: Axes, t: SeaTrials) -> None:
    time, heading, rudder = t.zigzag_series.T
    axes.plot(time, np.degrees(heading), color=COLOURS[0], label="heading")
    axes.plot(time, np.degrees(rudder), color=COLOURS[1], lw=1.0, drawstyle="steps-post", label="rudder commanded")
    axes.legend(fontsize=9, loc="upper right")
    dress(axes, "Zig-zag 10/10", "time [s]", "[deg]")
    axes.set(xlim=(0.0, min(40.0, time[-1])))


def _dive(axes: Axes, t: SeaTrials) -> None:
    time, depth, pitch = t.dive_series.T
    axes.plot(time, depth, color=COLOURS[0], label="depth below the start [m]")
    axes.plot(time, -np.degrees(pitch) / 4.0, color=COLOURS[1], lw=1.0, label="nose down [4 deg]")
    axes.axhline(DIVE, color="#888888", lw=0.8, ls=":")
    axes.invert_yaxis()
    axes.legend(fontsize=9, loc="lower right")
    dress(axes, f"Dive of {DIVE:g} m by its autopilot", "time [s]", "[m], [4 deg]")


def _stops(axes: Axes, t: SeaTrials) -> None:
    for stop, name, colour in ((t.astern, "full astern", COLOURS[1]), (t.coasting, "shaft stopped", COLOURS[0])):
        axes.plot(*stop.speeds.T, color=colour, label=f"{name}: {stop.distance:.2f} m")
    axes.legend(fontsize=9, loc="upper right")
    dress(axes, "Stopping", "time [s]", "surge [m/s]")


def _forces(axes: Axes, t: HoverTrials) -> None:
    for axis, colour in zip((a for a in t.axes if a.name != "turning"), COLOURS, strict=False):
        style: dict[str, Any] = {"ls": "--"} if axis.name in ("astern", "up") else {}
        axes.plot(*axis.curve.T, color=colour, label=axis.name, **style)
    axes.legend(fontsize=9, loc="lower right")
    dress(axes, "Speed against force, to the largest", "force [N]", "speed [m/s]")
    axes.set(xlim=(0.0, None), ylim=(0.0, None))


def _turning(axes: Axes, t: HoverTrials) -> None:
    curve = next(axis.curve for axis in t.axes if axis.name == "turning")
    axes.plot(*curve.T, color=COLOURS[0])
    dress(axes, "Rate of turn against moment", "moment [N m]", "yaw rate [rad/s]")
    axes.set(xlim=(0.0, None), ylim=(0.0, None))


def _stop(axes: Axes, t: HoverTrials) -> None:
    axes.plot(*t.stop_series.T, color=COLOURS[0])
    dress(axes, "Stop from 0.75 of its top speed", "time [s]", "surge [m/s]")


def _step(axes: Axes, t: HoverTrials) -> None:
    time, ahead, pitch, roll = t.step_series.T
    axes.plot(time, ahead, color=COLOURS[0], label="ahead [m]")
    axes.plot(time, np.degrees(pitch) / 10.0, color=COLOURS[1], lw=1.0, label="pitch [10 deg]")
    axes.plot(time, np.degrees(roll) / 10.0, color=COLOURS[2], lw=1.0, label="roll [10 deg]")
    axes.axhline(1.0, color="#888888", lw=0.8, ls=":")
    axes.legend(fontsize=9, loc="lower right")
    dress(axes, "Step of 1 m ahead by its controller", "time [s]", "[m], [10 deg]")


def _holding(axes: Axes, t: HoverTrials) -> None:
    speed, error, share = t.holding.T
    axes.plot(speed, 100.0 * share, "o-", color=COLOURS[1], ms=4, label="largest thrust [% of full]")
    axes.plot(speed, 1000.0 * error, "s-", color=COLOURS[0], ms=4, label="largest error [mm]")
    axes.legend(fontsize=9, loc="upper left")
    dress(axes, "Place held in a current across", "current [m/s]", "[%], [mm]")
