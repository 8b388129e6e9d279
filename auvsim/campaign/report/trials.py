"""Every trial as a line that the page filters and sorts."""

import math
from urllib.parse import quote

from auvsim.campaign.columns import metrics_of
from auvsim.campaign.report.cells import FRAMES, Cells
from auvsim.campaign.report.chart import colour
from auvsim.campaign.report.content import Content, Row, negated, words
from auvsim.campaign.report.markup import Markup, join, number, table, tag

COLUMNS = {  # column: heading
    "attempts": "attempts",
    "miss_distance": "miss [m]",
    "position_rms": "position rms [m]",
    "nees_per_dof": "NEES",
    "contact_impulse": "impulse [N s]",
    "contacts": "contacts",
    "shaft_energy": "shaft energy [J]",
    "way": "way [m]",
    "time": "time [s]",
    "wall_time": "wall time [s]",
}
COMMON = ("position_rms", "nees_per_dof", "time", "wall_time")  # of them, those that are of any mission


def kind(row: Row, success: str) -> str:
    """How a trial ended: by the column of its success, or the kind of its failure; errors by their type."""
    if row["failure"] == "error":
        return f"error: {row['error_type']}"
    if row[success] or row["failure"] is None:
        return negated(success) if row[success] is False else words(success)
    return str(row["failure"])


def shown(content: Content) -> dict[str, str]:
    """Headings of the columns that are listed, by column."""
    kinds, columns = content.layout.kinds, content.layout.columns
    if kinds == ("docking",):
        return COLUMNS
    own = [name for kind in kinds for name, column in metrics_of(kind).items() if column.dtype in ("int", "float")]
    units = {name: columns[name].units for name in own}
    named = {name: words(name) + (f" [{unit}]" if unit not in ("", "1") else "") for name, unit in units.items()}
    return named | {name: COLUMNS[name] for name in COMMON}


def section(content: Content, cells: Cells | None) -> Markup:
    """All trials."""
    vehicle = ["vehicle"] if content.layout.fleet else []
    listed = shown(content)
    heads = ["variant", "trial", *vehicle, "outcome", *listed.values(), *content.drawn, "kept", "run again"]
    index = {name: number for number, name in enumerate(content.variants)}
    rows = [_row(content, row, index[row["variant"]], cells, [*listed, *content.drawn]) for row in content.rows]
    buttons = [tag("th", tag("button", text, type="button", class_="plain"), scope="col") for text in heads]
    return table(buttons, rows, aria_label="trials")


def _row(content: Content, row: Row, index: int, cells: Cells | None, columns: list[str]) -> Markup:
    success = content.layout.success
    name = kind(row, success)
    numbers = [_value(row.get(column)) for column in columns]
    places = {f"data_{frame}": cells.place(row, frame) for frame in FRAMES} if cells else {}
    return tag(
        "tr",
        tag("td", tag("span", class_="swatch"), row["variant"], class_=colour(index)),
        tag("td", row["trial"], class_="n"),
        tag("td", row["vehicle"]) if content.layout.fleet else None,
        tag("td", name),
        numbers,
        tag("td", kept(row)),
        tag("td", command(row)),
        data_v=index,
        data_kind=name,
        data_docked=None if row[success] is None else int(row[success]),
        **places,
    )


def kept(row: Row) -> Markup | None:
    """Links to the log of a trial, if it is kept, and to what was made when it was run again, if it was."""
    links = [tag("a", name, href=quote(row[name])) for name in ("log", "replay") if row.get(name)]
    return join([[link, " "] for link in links]) if links else None


def command(row: Row) -> Markup:
    """What runs a trial again."""
    return tag("code", row["command"], class_="command")


def _value(value: object) -> Markup:
    """A cell; `data-value` is what it is sorted by where the text is shortened or missing."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return tag("td", "–", class_="n", data_value="")
    if isinstance(value, float):
        return tag("td", number(value), class_="n", data_value=f"{value:.6g}")
    return tag("td", value, class_="n" if isinstance(value, int) else None)
