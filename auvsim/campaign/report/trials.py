"""Every trial as a line that the page filters and sorts."""

import math
from urllib.parse import quote

from auvsim.campaign.report.cells import FRAMES, Cells
from auvsim.campaign.report.chart import colour
from auvsim.campaign.report.content import Content, Row
from auvsim.campaign.report.markup import Markup, join, number, table, tag

COLUMNS = {  # column: heading
    "attempts": "attempts",
    "miss_distance": "miss [m]",
    "position_rms": "position rms [m]",
    "nees_per_dof": "NEES",
    "contact_impulse": "impulse [N s]",
    "time": "time [s]",
    "wall_time": "wall time [s]",
}


def kind(row: Row) -> str:
    """How a trial ended: `docked`, or the kind of its failure; errors by their type."""
    if row["docked"]:
        return "docked"
    return f"error: {row['error_type']}" if row["failure"] == "error" else str(row["failure"])


def section(content: Content, cells: Cells | None) -> Markup:
    """All trials."""
    heads = ["variant", "trial", "outcome", *COLUMNS.values(), *content.drawn, "kept", "run again"]
    index = {name: number for number, name in enumerate(content.variants)}
    rows = [_row(content, row, index[row["variant"]], cells) for row in content.rows]
    buttons = [tag("th", tag("button", text, type="button", class_="plain"), scope="col") for text in heads]
    return table(buttons, rows, aria_label="trials")


def _row(content: Content, row: Row, index: int, cells: Cells | None) -> Markup:
    name = kind(row)
    numbers = [_value(row.get(column)) for column in (*COLUMNS, *content.drawn)]
    places = {f"data_{frame}": cells.place(row, frame) for frame in FRAMES} if cells else {}
    return tag(
        "tr",
        tag("td", tag("span", class_="swatch"), row["variant"], class_=colour(index)),
        tag("td", row["trial"], class_="n"),
        tag("td", name),
        numbers,
        tag("td", kept(row)),
        tag("td", command(row)),
        data_v=index,
        data_kind=name,
        data_docked=int(row["docked"]),
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
