"""Pictures of a stress test: tornado, maps, exceedance of a rare event, the worst current."""

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from auvsim.analysis.style import save
from auvsim.stress.envelope import EnvelopeMap
from auvsim.stress.ladder import Ladder
from auvsim.stress.rare import Subset
from auvsim.stress.search import Searches
from auvsim.stress.worst import Worst

GOOD, BETWEEN, BAD = "#2c8c2c", "#e8b83a", "#c0392b"
LABELLED = 200  # cells of a map up to which each bears its numbers
Named = list[tuple[str, Path]]  # title and file


def write(searches: Searches, path: Path) -> Named:
    """Writes the pictures of what was found into a folder; gives title and file of each."""
    made: list[tuple[str, str, Figure]] = []
    known = [ladder for ladder in searches.ladders if ladder.rungs[0].good is not None]
    if known:
        made.append(("Edges", "tornado.png", tornado(known)))
    for number, found in enumerate(searches.maps, 1):
        if any(cell.outcomes for cell in found.cells):
            made.append((" and ".join(found.names), f"map_{number}.png", chart(found, searches)))
    if searches.rare and searches.rare.levels:
        made.append(("Rare event", "rare.png", exceedance(searches.rare)))
    if searches.worst and searches.worst.iterations:
        made.append(("Worst current", "worst.png", history(searches.worst)))
    for _, name, figure in made:
        save(figure, path / name)
    return [(title, path / name) for title, name, _ in made]


def tornado(ladders: list[Ladder]) -> Figure:
    """How far along its range each factor goes before success is no longer sure, the first to fail on top."""
    ranked = sorted(ladders, key=lambda ladder: (ladder.good or 0.0, ladder.bad or 2.0))
    figure = Figure(figsize=(10.0, 1.2 + 0.42 * len(ranked)), layout="constrained")
    axes = figure.subplots()
    for row, ladder in enumerate(ranked):
        good = ladder.good or 0.0
        bad = ladder.bad if ladder.bad is not None else 1.0
        axes.barh(row, good, color=GOOD)
        axes.barh(row, bad - good, left=good, color=BETWEEN)
        axes.barh(row, 1.0 - bad, left=bad, color=BAD)
        mild, harsh = (" / ".join(f"{v:.3g}" for v in ladder.values(level).values()) for level in (0.0, 1.0))
        edge = " / ".join(f"{v:.3g}" for v in ladder.values(good).values())
        axes.text(0.01, row, mild, va="center", fontsize=8, color="white" if good > 0.1 else "black")
        axes.text(0.99, row, harsh, va="center", ha="right", fontsize=8, color="white")
        if 0.15 < good < 0.9:
            axes.text(good - 0.01, row, edge, va="center", ha="right", fontsize=8, color="white")
    axes.set_yticks(range(len(ranked)), [" + ".join(ladder.names) for ladder in ranked])
    axes.set_xlim(0.0, 1.0)
    axes.invert_yaxis()
    axes.set_xlabel("share of the range, from its mild to its harsh end (values on the bars)")
    axes.legend(
        handles=[
            Rectangle((0, 0), 1, 1, color=colour, label=text)
            for colour, text in ((GOOD, "good enough"), (BETWEEN, "the edge is here"), (BAD, "not good enough"))
        ],
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False,
    )  # fmt: skip
    return figure


def chart(found: EnvelopeMap, searches: Searches) -> Figure:
    """Success over two factors, each cell with its rate and interval [%]."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    axes = figure.subplots()
    across, upward = (searches.plan.settings.factors[name] for name in found.names)
    cells = [cell for cell in found.cells if cell.outcomes]
    norm, colours = _scale()
    for cell in cells:
        x, y = (f.value(low) for f, low in zip((across, upward), cell.low, strict=True))
        w, h = (cell.size * (f.range[1] - f.range[0]) for f in (across, upward))
        axes.add_patch(Rectangle((x, y), w, h, facecolor=colours(norm(cell.rate)), edgecolor="white"))
        if len(cells) <= LABELLED:
            low, high = cell.interval
            text = f"{100 * cell.rate:.0f}\n{100 * low:.0f}-{100 * high:.0f}"
            ink = "black" if 0.15 < cell.rate < 0.85 else "white"  # the scale is dark at both ends
            axes.text(x + w / 2, y + h / 2, text, color=ink, ha="center", va="center", fontsize=6.0 + 14.0 * cell.size)
    axes.set_xlim(min(across.range), max(across.range))
    axes.set_ylim(min(upward.range), max(upward.range))
    axes.set_xlabel(found.names[0])
    axes.set_ylabel(found.names[1])
    from matplotlib.cm import ScalarMappable

    figure.colorbar(
        ScalarMappable(norm, colours), ax=axes, label="success rate [-]; in the cells with its 95 % interval [%]"
    )
    return figure


def exceedance(rare: Subset) -> Figure:
    """The probability that the metric is above a value, with its 95 % interval."""
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = figure.subplots()
    scores = sorted({sample.score for sample in rare.samples if math.isfinite(sample.score)})
    values = np.quantile(scores, np.linspace(0.0, 1.0, min(len(scores), 200)), method="lower")[:-1]
    found = [(v, rare.probability(v)) for v in values.tolist()]
    kept = [(v, p) for v, p in found if p.value > 0.0]
    x = [v for v, _ in kept]
    axes.fill_between(x, [p.low for _, p in kept], [p.high for _, p in kept], alpha=0.25, label="95 % interval")
    axes.plot(x, [p.value for _, p in kept], label="probability to be above")
    for level in rare.levels[1:]:
        axes.axvline(level.above, color="#999999", linewidth=0.8)
    axes.axvline(rare.settings.above, color=BAD, label="the event's limit")
    axes.set_yscale("log")
    axes.set_xlabel(rare.settings.metric.replace("_", " "))
    axes.set_ylabel("probability")
    axes.legend()
    return figure


def history(worst: Worst) -> Figure:
    """The worst current over time, and how the search came to it."""
    figure = Figure(figsize=(11.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    knots = worst.best.knots
    for name, colour in (("north", "#1f77b4"), ("east", "#d95f02")):
        left.plot([k["time"] for k in knots], [k[name] for k in knots], "o-", color=colour, label=name)
    left.set_xlabel("time [s]")
    left.set_ylabel("velocity of the water [m/s]")
    left.legend()
    numbers = range(1, len(worst.iterations) + 1)
    means = [np.mean([h.badness.mean for h in tried]) for tried in worst.iterations]
    most = [max(h.badness.mean for h in tried) for tried in worst.iterations]
    right.plot(numbers, means, "o-", label="mean of the iteration")
    right.plot(numbers, most, "o-", label="largest of the iteration")
    right.set_xlabel("iteration; the first is at random")
    right.set_ylabel(worst.settings.metric.replace("_", " "))
    right.set_ylim(bottom=0.0)
    right.legend()
    return figure


def _scale():
    from matplotlib import colormaps
    from matplotlib.colors import Normalize

    return Normalize(0.0, 1.0), colormaps["RdYlGn"]
