"""The report of an identification: one HTML page that needs no network, and the same as one picture."""

import io
from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.identification import pictures
from auvsim.identification.pipeline import NAMES, Identification
from auvsim.physics.planar_sets import UNITS

DPI = 100
STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 1150px; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; margin-bottom: .2em; } h2 { font-size: 1.15em; margin: 1.6em 0 .5em; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .2em .7em; text-align: right; }
th { border-bottom: 1px solid #999; font-weight: 600; } td:first-child, th:first-child { text-align: left; }
tr:nth-child(even) td { background: #f5f6f8; } .weak td { color: #b03060; }
.verdicts { list-style: none; padding: 0; }
.verdicts li { padding: .25em .6em; margin: .25em 0; border-left: 5px solid; }
.verdicts .good { border-color: #2c7a2c; background: #eef6ee; }
.verdicts .bad { border-color: #c77700; background: #fdf5e6; }
.pair { display: flex; flex-wrap: wrap; gap: 1em; } .pair > div { flex: 1 1 500px; } svg { width: 100%; height: auto; }
.small { color: #555; font-size: .9em; }
"""


def write(found: Identification, folder: Path) -> tuple[Path, Path]:
    """Writes report.html and report.png, each whole or not at all.

    Raises:
        InputError: If they cannot be written.
    """
    page, picture = folder / "report.html", folder / "report.png"
    try:
        with whole(page) as partial:
            partial.write_text(html(found), encoding="utf-8")
        with whole(picture) as partial:
            pictures.overview(found).savefig(partial, dpi=DPI, format="png")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None
    return page, picture


def html(found: Identification) -> str:
    """The page."""
    judged = pictures.hardest(found)
    one: list[tuple[Callable[[Any], None], tuple[float, float]]] = [
        (lambda axes: pictures.track_panel(axes, judged), (6.0, 5.2)),
        (lambda axes: pictures.growth_panel(axes, found), (6.0, 5.2)),
        (lambda axes: pictures.parameter_panel(axes, found, numbers=False), (6.0, 5.8)),
        (lambda axes: pictures.correlation_panel(axes, found), (6.0, 5.8)),
    ]
    states = Figure(figsize=(11.5, 8.0), layout="constrained")
    pictures.states_panels(states, judged)
    track, growth, parameters, correlation = (_panel(draw, size) for draw, size in one)
    return "\n".join(
        (
            f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(found.vehicle)}: planar model'
            f"</title><style>{STYLE}</style></head><body>",
            f"<h1>Planar model of {escape(found.vehicle)}</h1>",
            f'<p class="small">{_origin(found)}</p>',
            f'<ul class="verdicts">{"".join(_verdicts(found))}</ul>',
            f"<h2>Held out</h2>{_svg(states)}",
            f'<div class="pair"><div>{track}</div><div>{growth}</div></div>',
            "".join(_held_out(found)),
            f"<h2>Parameters</h2>{''.join(_parameters(found))}",
            f'<div class="pair"><div>{parameters}</div><div>{correlation}</div></div>',
            f"<h2>What the data cannot tell apart</h2>{''.join(_combinations(found))}",
            f"<h2>Residuals</h2>{''.join(_residuals(found))}",
            f"<h2>Data</h2>{''.join(_data(found))}",
            "</body></html>\n",
        )
    )


def _panel(draw: Callable[[Any], None], size: tuple[float, float]) -> str:
    figure = Figure(figsize=size, layout="constrained")
    draw(figure.subplots())
    return _svg(figure)


def _svg(figure: Figure) -> str:
    """The figure as an element of the page, the same for the same numbers."""
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "auvsim", "svg.fonttype": "none", "font.family": "sans-serif"}):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    text = stream.getvalue()
    return text[text.index("<svg") :]


def _origin(found: Identification) -> str:
    steps = ", ".join(fit.method for fit in found.fits)
    fitted = sum(record.duration for record in found.fitted)
    return escape(
        f"{steps}; {fitted:.0f} s of {len(found.fitted)} records, mean {found.speed:.2f} m/s through the water; "
        f"started from {found.start_text}"
    )


def _verdicts(found: Identification) -> Iterator[str]:
    for verdict in found.verdicts:
        yield f'<li class="{"good" if verdict.good else "bad"}">{escape(verdict.text)}</li>'


def _held_out(found: Identification) -> Iterator[str]:
    yield "<table><tr><th>record</th><th>predictions</th><th>of [s]</th><th>start [%]</th><th>fit [%]</th></tr>"
    for judged in found.judged:
        cells = (
            escape(judged.record.name), str(len(judged.fit)), f"{judged.seconds:.0f}",
            f"{100 * judged.start_share:.2f}", f"{100 * judged.share:.2f}",
        )  # fmt: skip
        yield f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"
    yield (
        '</table><p class="small">Position error at the end by the distance run, rms over the predictions. Each takes '
        "what is measured until it begins, and nothing afterwards; it is judged against dead reckoning and fixes, "
        "smoothed without hydrodynamics.</p>"
    )


def _parameters(found: Identification) -> Iterator[str]:
    fit, assessed = found.fit, found.identifiability
    yield "<table><tr><th>parameter</th><th>start</th><th>value</th><th>95 % interval</th><th>unit</th>"
    yield "<th>relative sd</th><th>identifiable</th></tr>"
    for name, relative in zip(assessed.names, assessed.relative.tolist(), strict=True):
        low, high = found.intervals[name]
        by = " (likelihood ratio)" if name in found.profiled else ""
        weak = name in assessed.weak
        cells = (
            name, f"{getattr(found.start, name):.4g}", f"{getattr(fit.parameters, name):.4g}",
            f"{low:.4g} to {high:.4g}{by}", UNITS[name], f"{relative:.1%}", "no" if weak else "yes",
        )  # fmt: skip
        row = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
        yield f"<tr{' class=weak' if weak else ''}>{row}</tr>"
    yield "</table>"
    if fit.noise is not None:
        surge, sway, yaw = fit.noise[3:].tolist()
        yield (
            f'<p class="small">Process noise as density: surge {surge:.2g}, sway {sway:.2g} m²/s³, '
            f"yaw rate {yaw:.2g} rad²/s³.</p>"
        )


def _combinations(found: Identification) -> Iterator[str]:
    yield "<table><tr><th>combination of relative parameters</th><th>relative sd</th></tr>"
    for combination in found.identifiability.combinations[:-5:-1]:
        yield f"<tr><td>{escape(combination.text)}</td><td>{combination.deviation:.1%}</td></tr>"
    yield "</table>"
    tied = found.identifiability.tied
    if tied:
        pairs = "; ".join(f"{a} and {b} ({r:+.3f})" for a, b, r in tied)
        yield f'<p class="small">Correlated beyond 0.95: {escape(pairs)}.</p>'


def _residuals(found: Identification) -> Iterator[str]:
    yield "<table><tr><th>measured</th><th>rms in deviations</th><th>Ljung-Box p</th></tr>"
    for name, rms, test in zip(NAMES, found.fit.residual_rms.tolist(), found.fit.whiteness, strict=True):
        if rms == rms:  # what was measured
            chance = "-" if test is None else f"{test.probability:.3f}"
            yield f"<tr><td>{name}</td><td>{rms:.2f}</td><td>{chance}</td></tr>"
    yield "</table>"


def _data(found: Identification) -> Iterator[str]:
    yield "<ul>"
    yield from (
        f"<li>{escape(source.file)} <span class=small>sha256 {source.sha256}</span></li>"
        for source in found.readings.sources
    )
    yield "</ul>"
    if found.readings.notes:
        yield f'<ul class="small">{"".join(f"<li>{escape(note)}</li>" for note in found.readings.notes)}</ul>'
