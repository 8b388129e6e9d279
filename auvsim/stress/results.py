"""What a stress test found, as rows of text for the terminal and the page."""

import math
from collections.abc import Iterator

from auvsim.analysis.statistics import wilson
from auvsim.stress.ladder import Ladder
from auvsim.stress.rare import Subset
from auvsim.stress.search import Searches
from auvsim.stress.sequential import indifferent
from auvsim.stress.worst import Worst

Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]  # title, headings, rows


def tables(searches: Searches) -> Iterator[Table]:
    """A table for each kind of search."""
    if searches.ladders:
        s = searches.plan.settings.edge
        title = f"Edge of {100 * indifferent(s):.0f} % success; tests err in {100 * s.error:.0f} % above "
        title += f"{100 * s.above:.0f} and below {100 * s.below:.0f} %"
        head = ("factor", "mild", "harsh", "good at", "not at", "there", "trials")
        ranked = sorted(searches.ladders, key=lambda ladder: (ladder.good or 0.0, ladder.bad or 2.0))
        yield title, head, [edge_row(ladder) for ladder in ranked]
    for found in searches.maps:
        cells = [cell for cell in found.cells if cell.outcomes]
        good = searches.plan.settings.maps.good
        share = sum(cell.size**2 for cell in cells if cell.rate >= good)
        head = ("cells", "trials in each", f"area with {100 * good:.0f} % or more")
        row = (str(len(cells)), str(searches.plan.settings.maps.trials), f"{100 * share:.0f} %")
        yield f"Map of {found.names[0]} and {found.names[1]}", head, [row]
    if searches.rare and searches.rare.levels:
        s = searches.rare.settings
        yield f"{s.metric} above {s.above:g}", *rare_rows(searches.rare)
    if searches.worst and searches.worst.iterations:
        yield "Worst current", *worst_rows(searches.worst)


def edge_row(ladder: Ladder) -> tuple[str, ...]:
    """The edge along a ladder."""

    def values(level: float | None) -> str:
        return "-" if level is None else " / ".join(f"{value:.4g}" for value in ladder.values(level).values())

    bad = next((rung for rung in ladder.rungs if rung.good is False and rung.level == ladder.bad), None)
    there = f"{share(bad.successes, len(bad.outcomes))}" if bad else ""
    said = "" if ladder.done else " (not done)"
    count = str(sum(len(rung.outcomes) for rung in ladder.rungs))
    ends = (values(0.0), values(1.0), values(ladder.good) + said, values(ladder.bad))
    return (" + ".join(ladder.names), *ends, there, count)


def rare_rows(rare: Subset) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The levels of a rare event, and its probability."""
    head = ("level", "above", "trials", "accepted", "probability", "95 % interval")
    rows = []
    for number, level in enumerate(rare.levels, 1):
        above = "-" if math.isinf(level.above) else f"{level.above:.4g}"
        rows.append((str(number), above, str(len(level.samples)), f"{100 * level.accepted:.0f} %", "", ""))
    p = rare.probability()
    said = f"{p.value:.2g}" if p.value > 0.0 else "none seen"
    rows.append(("event", f"{rare.settings.above:g}", str(len(rare.samples)), "", said, f"{p.low:.2g} to {p.high:.2g}"))
    return head, rows


def worst_rows(worst: Worst) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """How the search for the worst current went."""
    head = ("iteration", "histories", "that fail", f"mean {worst.settings.metric}", "largest")
    rows = []
    for number, tried in enumerate(worst.iterations, 1):
        means = [history.badness.mean for history in tried]
        failing = sum(history.badness.failures > 0 for history in tried)
        rows.append((str(number), str(len(tried)), str(failing), f"{sum(means) / len(means):.4g}", f"{max(means):.4g}"))
    return head, rows


def share(successes: int, trials: int) -> str:
    """A rate in percent with its 95 % Wilson interval."""
    low, high = wilson(successes, trials)
    return f"{100.0 * successes / trials:.0f} ({100.0 * low:.0f}-{100.0 * high:.0f}) %"
