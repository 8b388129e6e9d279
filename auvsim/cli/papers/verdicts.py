"""Tables of what a paper's study is to reach, and what it reached."""

from collections.abc import Mapping, Sequence

from rich import box
from rich.table import Table

from auvsim.reproduce.verdict import Verdict


def table(paper: str, judged: Sequence[Verdict], titles: Mapping[str, str]) -> Table:
    """One line for each thing to reach, with the reason if it is not.

    Args:
        paper: begins the title.
        judged: in the order of the lines.
        titles: of the rows, by key; a key that is not there is its own title.
    """
    lines = Table(title=f"{paper}: what to reach", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("row", "quantity"):
        lines.add_column(heading, no_wrap=True)
    for heading in ("measured", "accept"):
        lines.add_column(heading, justify="right", no_wrap=True)
    lines.add_column("met")
    before = ""
    for v in judged:
        verdict = "yes" if v.met else f"NO: {v.reason}"
        title = "" if v.row == before else titles.get(v.row, v.row)
        lines.add_row(title, v.quantity, f"{v.measured:.3g}", v.accept, verdict)
        before = v.row
    return lines


def count(judged: Sequence[Verdict]) -> str:
    """How many are met, as a line."""
    met = sum(v.met for v in judged)
    return f"{met} of {len(judged)} met" + ("" if met == len(judged) else "; the rest, with reasons, above")
