"""The page of a stress test: tables, pictures and findings in one file that asks nothing of a network."""

import base64
from importlib import resources
from pathlib import Path

from auvsim.campaign import folder
from auvsim.campaign.report.markup import Markup, note, table, tag
from auvsim.stress import findings, results
from auvsim.stress.figures import Named
from auvsim.stress.findings import Finding
from auvsim.stress.search import Searches

NAME = "report.html"
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def write(searches: Searches, path: Path, trials: int, pictures: Named, kept: list[Finding]) -> Path:
    """Writes the page into the folder of a stress test and returns where.

    Raises:
        InputError: If it cannot be written.
    """
    plan = searches.plan.plan.settings
    said = f"{trials} trials, seed {plan.seed}" + (
        "; the budget was spent before all was done" if searches.spent else ""
    )
    parts = [tag("h1", plan.name), note(said)]
    for title, head, rows in results.tables(searches):
        parts += [tag("h2", title), _table(head, rows)]
    for title, picture in pictures:
        source = base64.b64encode(picture.read_bytes()).decode()
        parts += [
            tag("h2", title),
            tag("p", tag("img", src=f"data:image/png;base64,{source}", alt=title, style="max-width: 100%")),
        ]
    if kept:
        told = list(findings.commands(kept, path, plan.seed))
        parts += [tag("h2", "Findings"), _table(("name", "what", "runs again, with a video"), told)]
    style = resources.files("auvsim.campaign.report").joinpath("report.css").read_text(encoding="utf-8")
    head = tag(
        "head", tag("meta", charset="utf-8"), tag("meta", http_equiv="Content-Security-Policy", content=POLICY),
        tag("title", f"Stress {plan.name}"), tag("style", Markup(style)),
    )  # fmt: skip
    page = path / NAME
    folder.write(page, f"<!doctype html>\n{tag('html', head, tag('body', tag('main', parts)), lang='en')}\n".encode())
    return page


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> Markup:
    return table(head, [tag("tr", [tag("td", cell) for cell in row]) for row in rows])
