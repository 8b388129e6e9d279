"""Success over speed and direction of the current: one polar map for each variant, each cell a filter of the trials."""

import json
import math

from auvsim.campaign.report.cells import FRAMES, Cells, frames
from auvsim.campaign.report.chart import colour, svg
from auvsim.campaign.report.content import Content, Row, words
from auvsim.campaign.report.markup import Markup, note, tag

SIZE, HOLE, RADIUS = 330.0, 26.0, 140.0  # [px]
LETTER = 6.2  # width of a digit of a count [px]
MEASURES = ("docked", "first")  # what the page calls the success and the rate next to it


def section(content: Content, cells: Cells | None) -> Markup:
    """The maps with their legend and what chooses what they show."""
    if cells is None:
        return note("No map: speed and direction of the current are not drawn in this campaign.")
    shown = frames(content)
    drawn = []
    for frame in shown:
        figures = [_figure(content, cells, frame, index) for index in range(len(content.variants))]
        heading = tag("h3", FRAMES[frame].title)
        drawn.append(tag("div", heading, tag("div", figures, class_="row"), class_=f"frame {frame}"))
    rates = dict(zip(MEASURES, content.layout.rates, strict=False))
    measures = {name: words(quantity) for name, quantity in rates.items()}
    if all(row[content.layout.success] for row in content.rows):  # another rate may still tell currents apart
        measures = dict(reversed(measures.items()))
    first = next(iter(measures))
    hint = note("Choose a cell to list its trials.")
    return tag("div", hint, _legend(shown, measures), drawn, id="maps", data_measure=first)


def _legend(shown: list[str], measures: dict[str, str]) -> Markup:
    menus = [_menu("measure", "trials that", measures)]
    menus += [_menu("frame", "direction", {name: FRAMES[name].choice for name in shown})] if len(shown) > 1 else []
    ramp = [tag("span", "0 %"), tag("span", class_="ramp"), tag("span", "100 % of the trials in a cell")]
    return tag("div", ramp, tag("span", menus, class_="js flex legend"), class_="legend")


def _menu(name: str, label: str, options: dict[str, str]) -> Markup:
    inner = [tag("option", text, value=value) for value, text in options.items()]
    return tag("label", f"{label} ", tag("select", inner, name=name))


def _figure(content: Content, cells: Cells, frame: str, variant: int) -> Markup:
    name = content.variants[variant]
    places: dict[str, list[Row]] = {}
    for row in content.trials_of(name):
        places.setdefault(cells.place(row, frame), []).append(row)
    parts = [
        _cell(cells, ring, sector, places[f"{ring},{sector}"], frame, (variant, name), content.layout.rates)
        if f"{ring},{sector}" in places
        else tag("path", d=_outline(cells, ring, sector), class_="empty")
        for ring in range(len(cells.edges) - 1)
        for sector in range(cells.sectors)
    ]
    caption = tag("figcaption", tag("span", class_="swatch"), name, class_=colour(variant))
    label = f"Success over the current: {name}"
    drawing = svg(SIZE, SIZE + 20.0, parts, _rim(frame), _ruler(cells), class_="map", aria_label=label)
    return tag("figure", caption, drawing, data_variant=variant)


def _cell(
    cells: Cells, ring: int, sector: int, rows: list[Row], frame: str, variant: tuple[int, str], rates: tuple[str, ...]
) -> list[Markup]:
    """A cell that filters, and its counts where there is room for them."""
    index, name = variant
    shown = list(zip(MEASURES, rates, strict=False))
    rows = [row for row in rows if row[rates[0]] is not None]
    total, counted = len(rows), {name: sum(bool(row[quantity]) for row in rows) for name, quantity in shown}
    said = _said(rates, counted, total)
    label = f"{name}, {cells.label(ring, sector, frame)}"
    path = tag(
        "path",
        tag("title", f"{label}\n{said}"),
        d=_outline(cells, ring, sector),
        class_="cell",
        style=";".join(f"--{name}:{100.0 * count / max(total, 1):.0f}" for name, count in counted.items()),
        data_filter=json.dumps({"v": str(index), frame: f"{ring},{sector}"}),
        data_label=label,
    )
    inner, outer = _radius(cells, ring), _radius(cells, ring + 1)
    x, y = _point((inner + outer) / 2.0, 2.0 * math.pi * sector / cells.sectors)
    counts = [(f"{count}/{total}", name) for name, count in counted.items()]
    return [path] + [
        tag("text", text, x=round(x, 1), y=round(y + 4.0, 1), text_anchor="middle", class_=f"count {kind}")
        for text, kind in counts
        if _fits(cells, ring, sector, text)
    ]


def _said(rates: tuple[str, ...], counted: dict[str, int], total: int) -> str:
    """The counts of a cell in words."""
    if rates[:2] == ("docked", "docked_first"):
        return f"docked {counted['docked']} of {total}, on the first attempt {counted['first']}"
    return ", ".join(f"{words(rate)} {count} of {total}" for rate, count in zip(rates, counted.values(), strict=False))


def _fits(cells: Cells, ring: int, sector: int, text: str) -> bool:
    """Whether a cell has room for a text, which stands upright wherever the cell is."""
    inner, outer = _radius(cells, ring), _radius(cells, ring + 1)
    angle, width, height = 2.0 * math.pi * sector / cells.sectors, LETTER * len(text), 1.5 * LETTER
    across, along = abs(math.cos(angle)), abs(math.sin(angle))
    arc = math.pi * (inner + outer) / cells.sectors
    return width * across + height * along <= arc - 2.0 and width * along + height * across <= outer - inner + 3.0


def _outline(cells: Cells, ring: int, sector: int) -> str:
    """The path round a cell."""
    inner, outer = _radius(cells, ring), _radius(cells, ring + 1)
    start, end = ((2 * sector + side) * math.pi / cells.sectors for side in (-1, 1))
    corners = [_point(inner, start), _point(outer, start), _point(outer, end), _point(inner, end)]
    a, b, c, d = (f"{x:.1f},{y:.1f}" for x, y in corners)
    return f"M{a}L{b}A{outer:.1f},{outer:.1f} 0 0 1 {c}L{d}A{inner:.1f},{inner:.1f} 0 0 0 {a}Z"


def _rim(frame: str) -> list[Markup]:
    """Names of four directions, long ones turned along the rim."""
    parts = []
    for quarter, name in enumerate(FRAMES[frame].names):
        x, y = _point(RADIUS + 13.0, quarter * math.pi / 2.0)
        turn = {1: 90, 3: -90}.get(quarter, 0) if len(name) > 1 else 0
        place = f"translate({x:.1f} {y:.1f}) rotate({turn})"
        parts.append(tag("text", name, dy="0.35em", text_anchor="middle", class_="strong", transform=place))
    return parts


def _ruler(cells: Cells) -> list[Markup]:
    """The speeds at the edges of the rings, below the map."""
    middle, y, rings = SIZE / 2.0, SIZE + 2.0, len(cells.edges) - 1
    parts = [tag("line", x1=middle + HOLE, x2=middle + RADIUS, y1=y, y2=y, class_="zero")]
    every = 1 if rings < 4 else 2  # as many labels as there is room for
    for ring, edge in enumerate(cells.edges):
        x = round(middle + _radius(cells, ring), 1)
        parts.append(tag("line", x1=x, x2=x, y1=y, y2=y + 4.0, class_="zero"))
        if (rings - ring) % every == 0:
            parts.append(tag("text", f"{edge:g}", x=x, y=y + 16.0, text_anchor="middle"))
    beside = middle + RADIUS + LETTER * (len(f"{cells.edges[-1]:g}") / 2.0 + 1.0)
    return [*parts, tag("text", "m/s", x=beside, y=y + 16.0)]


def _radius(cells: Cells, ring: int) -> float:
    low, high = cells.edges[0], cells.edges[-1]
    return HOLE + (RADIUS - HOLE) * (cells.edges[ring] - low) / (high - low)


def _point(radius: float, angle: float) -> tuple[float, float]:
    """Place of a radius and an angle clockwise from up [px]."""
    return SIZE / 2.0 + radius * math.sin(angle), SIZE / 2.0 - radius * math.cos(angle)
