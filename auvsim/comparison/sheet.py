"""The gap sheet: one page (HTML) that needs no network, and the same as one picture."""

import math
from pathlib import Path

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvsim.analysis.style import dress, save
from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.base.templates import environment
from auvsim.comparison.gap import GRADES, MEANS, VELOCITIES, Gap, reckoned, spectra
from auvsim.identification.report import svg

MEASURED, SIMULATED, OTHER = "#444444", "#1f5fa8", "#d95f02"
SHOWN = 8  # coefficients in the picture
_FACTORS = (1.0, 1.0, math.degrees(1.0))
_UNITS = ("m/s", "m/s", "deg/s")
_SQUARED = ("(m/s)$^2$/Hz", "(m/s)$^2$/Hz", "(deg/s)$^2$/Hz")


def limits() -> str:
    """What the grades are."""
    return ", ".join(f"{grade} up to {most:.0%}" for grade, most in GRADES) + ", else E"


def write(gap: Gap, folder: Path) -> list[Path]:
    """Writes gap.html and gap.png, each whole or not at all.

    Raises:
        InputError: They cannot be written.
    """
    page, picture = folder / "gap.html", folder / "gap.png"
    figure = drawing(gap)
    save(figure, picture)
    text = environment("auvsim.comparison").get_template("gap.html.j2")
    try:
        with whole(page) as partial:
            made = text.render(gap=gap, limits=limits(), means=MEANS, rows=rows(gap), picture=Markup(svg(figure)))
            partial.write_text(made, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None
    return [page, picture]


def rows(gap: Gap) -> list[tuple[str, str, str]]:
    """Horizon, error in MuJoCo and by the planar model, as texts."""
    found = []
    for horizon, error in gap.errors.items():
        planar = gap.planar_errors.get(horizon)
        found.append((f"{horizon:.0f} s", f"{error:.2%}", "-" if planar is None else f"{planar:.2%}"))
    return found


def drawing(gap: Gap) -> Figure:
    """Track, velocities, errors by horizon, spectra and coefficients."""
    figure = Figure(figsize=(14.0, 13.0), layout="constrained")
    figure.suptitle(gap.verdict, fontsize=12, wrap=True)
    grid = figure.add_gridspec(4, 6)
    _track(figure.add_subplot(grid[:2, :3]), gap)
    for k in range(3):
        _velocity(figure.add_subplot(grid[2, 2 * k : 2 * k + 2]), gap, k)
        _spectrum(figure.add_subplot(grid[3, 2 * k : 2 * k + 2]), gap, k)
    _horizons(figure.add_subplot(grid[0, 3:]), gap)
    _coefficients(figure.add_subplot(grid[1, 3:]), gap)
    return figure


def _track(axes: Axes, gap: Gap) -> None:
    beside = max(gap.records, key=lambda b: b.record.duration)
    axes.plot(*beside.measured[beside.first :, 1::-1].T, color=MEASURED, lw=3.5, alpha=0.45, label="measured")
    track, _ = reckoned(beside, beside.first)
    axes.plot(track[:, 1], track[:, 0], color=SIMULATED, lw=1.6, label="MuJoCo, open loop from the circle on")
    if gap.planar:
        other = next(b for b in gap.planar if b.record is beside.record)
        track, _ = reckoned(other, other.first)
        axes.plot(track[:, 1], track[:, 0], color=OTHER, lw=1.3, ls="--", label="planar model")
    axes.plot(*beside.measured[beside.first, 1::-1], "o", color="black", mfc="white", ms=7)
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(fontsize=9)
    dress(axes, beside.record.name, "east [m]", "north [m]")


def _velocity(axes: Axes, gap: Gap, k: int) -> None:
    beside = max(gap.records, key=lambda b: b.record.duration)
    times = (beside.record.times - beside.record.times[0])[beside.first :]
    axes.plot(times, _FACTORS[k] * beside.measured[beside.first :, 3 + k], color=MEASURED, lw=2.5, alpha=0.45,
              label="measured, smoothed")  # fmt: skip
    axes.plot(times, _FACTORS[k] * beside.simulated[beside.first :, k], color=SIMULATED, lw=1.1, label="MuJoCo")
    axes.legend(fontsize=8)
    dress(axes, VELOCITIES[k], "time [s]", f"[{_UNITS[k]}]")


def _spectrum(axes: Axes, gap: Gap, k: int) -> None:
    f, motion, rest = spectra(gap.records)[k]
    axes.loglog(f, _FACTORS[k] ** 2 * motion, color=MEASURED, lw=2.0, alpha=0.5, label="motion")
    axes.loglog(f, _FACTORS[k] ** 2 * rest, color=OTHER, lw=1.3, label="residual")
    axes.legend(fontsize=8)
    dress(axes, f"spectrum of {VELOCITIES[k]}", "frequency [Hz]", f"[{_SQUARED[k]}]")


def _horizons(axes: Axes, gap: Gap) -> None:
    axes.plot(list(gap.errors), [100.0 * e for e in gap.errors.values()], "o-", color=SIMULATED, label="MuJoCo")
    if gap.planar_errors:
        axes.plot(list(gap.planar_errors), [100.0 * e for e in gap.planar_errors.values()], "s--", color=OTHER,
                  label="planar model")  # fmt: skip
    top = max(1.3 * max(gap.errors.values()), 1.2 * GRADES[0][1])
    for grade, most in (row for row in GRADES if row[1] < top):
        axes.axhline(100.0 * most, color="#999999", lw=0.8, ls=":")
        axes.text(1.01, 100.0 * most, grade, transform=axes.get_yaxis_transform(), fontsize=9, va="top")
    axes.set_ylim(0.0, 100.0 * top)
    axes.legend(fontsize=9)
    dress(axes, f"open loop, rms of {gap.starts} starts", "horizon [s]", "error by distance run [%]")


def _coefficients(axes: Axes, gap: Gap) -> None:
    shown = gap.explanations[:SHOWN]
    named = {e.name for e in gap.explained}
    for row, e in enumerate(shown):
        axes.barh(row, 100.0 * e.share, color=OTHER if e.name in named else "#aaaaaa")
        text = f"{e.change:+.0%} [{e.low:+.0%}, {e.high:+.0%}]"
        axes.text(100.0 * e.share + 1.0, row, text, fontsize=8.5, va="center")
    axes.set_yticks(range(len(shown)), [f"{MEANS[e.name]}, {e.name}" for e in shown])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 130.0)
    axes.set_xticks(np.arange(0, 101, 20))
    dress(axes, "coefficients, each alone: change and 95 % interval", "share of the residual explained [%]", "")
