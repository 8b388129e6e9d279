"""How far from the dock's axis the nose passed the mouth: the share of trials within each distance."""

from auvsim.campaign.report.chart import Scale, colour, svg
from auvsim.campaign.report.content import Content, quantile, values
from auvsim.campaign.report.markup import Markup, join, note, number, right, table, tag
from auvsim.campaign.report.success import name_cell

WIDTH, HEIGHT = 560.0, 260.0
LEFT, RIGHT, TOP, BOTTOM = 48.0, 14.0, 10.0, 40.0  # margins [px]
PASSED = "Share of all trials whose nose passed the plane of the mouth within a distance of the dock's axis."
POINTS = 300  # of a curve at most
SHARES = {"median": 0.5, "90 %": 0.9, "95 %": 0.95, "largest": 1.0}


def section(content: Content) -> Markup:
    """The curves, and their quantiles as numbers."""
    found = {name: values(content.rows_of(name), "miss_distance") for name in content.variants}
    every = [value for misses in found.values() for value in misses]
    if not every:
        return note("No trial reached the dock's mouth.")
    figures = tag("div", _curves(content, found), _quantiles(content, found), class_="row")
    return join([note(PASSED), figures])


def _curves(content: Content, found: dict[str, list[float]]) -> Markup:
    every = sorted(max(value, 1e-3) for misses in found.values() for value in misses)
    low, high = quantile(every, 0.01) or 1e-3, every[-1]
    across = Scale(low=0.9 * low, high=1.1 * high, start=LEFT, end=WIDTH - RIGHT, logarithmic=True)
    up = Scale(low=0.0, high=1.0, start=HEIGHT - BOTTOM, end=TOP)
    parts = _grid(across, up)
    for index, name in enumerate(content.variants):
        trials = len(content.rows_of(name))
        parts.append(_curve(across, up, found[name], trials, (index, name)))
    parts.append(tag("line", x1=0, x2=0, y1=TOP, y2=HEIGHT - BOTTOM, class_="cross zero hidden"))
    data = {"data_x0": LEFT, "data_x1": WIDTH - RIGHT, "data_low": across.low, "data_high": across.high}
    data |= {"data_y0": HEIGHT - BOTTOM, "data_y1": TOP}
    return tag(
        "figure",
        svg(WIDTH, HEIGHT, parts, class_="curves", aria_label="Share of trials within a miss distance", **data),
    )


def _grid(across: Scale, up: Scale) -> list[Markup | None]:
    parts: list[Markup | None] = []
    for tick in across.ticks(10):
        x = round(across(tick), 1)
        parts.append(tag("line", x1=x, x2=x, y1=TOP, y2=HEIGHT - BOTTOM, class_="tick"))
        parts.append(tag("text", f"{tick:g}", x=x, y=HEIGHT - BOTTOM + 16.0, text_anchor="middle"))
    for tick in up.ticks():
        y = round(up(tick), 1)
        parts.append(tag("line", x1=LEFT, x2=WIDTH - RIGHT, y1=y, y2=y, class_="tick"))
        parts.append(tag("text", f"{100.0 * tick:.0f} %", x=LEFT - 6.0, y=y + 4.0, text_anchor="end"))
    middle = (LEFT + WIDTH - RIGHT) / 2.0
    parts.append(tag("text", "nose off the axis at the mouth [m]", x=middle, y=HEIGHT - 5.0, text_anchor="middle"))
    return parts


def _curve(across: Scale, up: Scale, misses: list[float], trials: int, of: tuple[int, str]) -> Markup | None:
    """A staircase: the share of all trials that passed within each distance; it ends below 1 if some never passed."""
    if not misses:
        return None
    steps = (
        range(len(misses))
        if len(misses) <= POINTS
        else sorted({i * (len(misses) - 1) // (POINTS - 1) for i in range(POINTS)})
    )
    points, share = [], 0.0
    for i in steps:
        x = across(max(misses[i], 1e-3))
        points.append(f"{x:.1f},{up(share):.1f}")
        share = (i + 1) / trials
        points.append(f"{x:.1f},{up(share):.1f}")
    points.append(f"{across.end:.1f},{up(share):.1f}")
    return tag(
        "polyline", points=" ".join(points), class_=f"curve {colour(of[0])}", data_variant=of[0], data_name=of[1]
    )


def _quantiles(content: Content, found: dict[str, list[float]]) -> Markup:
    head = ["miss distance [m]", *map(right, (*SHARES, "trials"))]
    rows = []
    for index, name in enumerate(content.variants):
        cells = [tag("td", number(quantile(found[name], share)), class_="n") for share in SHARES.values()]
        passed = f"{len(found[name])} of {len(content.rows_of(name))}"
        rows.append(tag("tr", name_cell(index, name), cells, tag("td", passed, class_="n"), data_variant=index))
    return table(head, rows, aria_label="miss distances")
