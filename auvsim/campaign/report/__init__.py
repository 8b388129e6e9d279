"""The report of a campaign: one self-contained HTML file."""

from pathlib import Path

from auvsim.base.errors import InputError
from auvsim.base.files import whole
from auvsim.campaign.report.content import Content, read
from auvsim.campaign.report.page import html

NAME = "report.html"

__all__ = ["NAME", "Content", "html", "read", "write"]


def write(path: Path) -> Path:
    """Writes the report of the campaign in a folder, from its table, and returns where.

    Raises:
        InputError: If there is no campaign in the folder, no trial of it is done, or it cannot be written to.
    """
    text = html(read(path))
    report = path / NAME
    try:
        with whole(report) as partial:
            partial.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{report}: cannot be written: {(error.strerror or str(error)).lower()}") from None
    return report
