"""How trials failed: kinds with their counts, and some of each with the command that runs it again."""

import json
from collections import Counter

from auvsim.campaign.report.chart import colour
from auvsim.campaign.report.content import Content, Row, words
from auvsim.campaign.report.markup import Markup, join, note, right, table, tag
from auvsim.campaign.report.trials import command, kept, kind

EXAMPLES = 5  # of each kind


def section(content: Content) -> Markup:
    """One line for each kind, the most frequent first."""
    success = content.layout.success
    failed = [row for row in content.rows if row[success] is False]
    if not failed:
        return note("None: every trial docked." if success == "docked" else f"None: {words(success)} in every trial.")
    kinds_of = {id(row): kind(row, success) for row in failed}
    counts = Counter(kinds_of.values())
    heads = [
        tag("th", tag("span", class_="swatch"), name, class_=f"n {colour(index)}", scope="col", data_variant=index)
        for index, name in enumerate(content.variants)
    ]
    rows = [
        _line(content, name, [row for row in failed if kinds_of[id(row)] == name]) for name, _ in counts.most_common()
    ]
    kinds = table(
        ["failure", right("vehicles" if content.layout.fleet else "trials"), *heads, "run again"],
        rows,
        aria_label="failures",
    )
    return join([note("Choose a kind to list its trials."), kinds])


def _line(content: Content, name: str, rows: list[Row]) -> Markup:
    key = json.dumps({"kind": name})
    chooser = tag("button", name, type="button", class_="plain", data_filter=key, data_label=name)
    cells = [tag("th", chooser, scope="row"), tag("td", len(rows), class_="n")]
    for index, variant in enumerate(content.variants):
        count = sum(row["variant"] == variant for row in rows)
        cells.append(tag("td", count or "–", class_="n", data_variant=index))
    many = f"{EXAMPLES} of {len(rows)}" if len(rows) > EXAMPLES else f"{len(rows)}"
    examples = tag("details", tag("summary", f"{many}, with commands"), [_example(row) for row in rows[:EXAMPLES]])
    return tag("tr", cells, tag("td", examples, class_="wrap"), data_chooses=True)


def _example(row: Row) -> Markup:
    """One failed trial: what it says of itself, what is kept of it, how to run it again."""
    says = row["failure_text"]
    vehicle = f", {row['vehicle']}" if row.get("vehicle") else ""
    trial = tag("strong", f"{row['variant']}, trial {row['trial']}{vehicle}")
    trace = row.get("traceback")
    said = tag("p", trial, f": {says}" if says else "", " ", kept(row))
    return tag("div", said, command(row), tag("pre", trace) if trace else None, class_="example")
