"""HTML and SVG as values: what is not markup is escaped, so that no text of a plan or an error can be code."""

import html
import math
from collections.abc import Iterable, Sequence
from typing import Any

VOID = frozenset(
    {"br", "col", "img", "input", "link", "meta", "circle", "line", "path", "polyline", "rect"}
)  # no children


class Markup(str):
    """Text that is HTML or SVG already."""

    __slots__ = ()


def tag(name: str, /, *children: Any, **attributes: Any) -> Markup:
    """An element. `class_` gives `class`, `data_x` `data-x`; True is an attribute alone, None and False are none."""
    text = "".join(_attribute(key, value) for key, value in attributes.items())
    if name in VOID and not children:
        return Markup(f"<{name}{text}/>")
    return Markup(f"<{name}{text}>{join(children)}</{name}>")


def join(children: Iterable[Any]) -> Markup:
    """Children one after another, escaped unless they are markup; None is nothing, a list is its members."""
    parts = []
    for child in children:
        if isinstance(child, list | tuple):
            parts.append(join(child))
        elif child is not None:
            parts.append(child if isinstance(child, Markup) else html.escape(str(child)))
    return Markup("".join(parts))


def table(head: Sequence[Any], rows: Iterable[Markup], **attributes: Any) -> Markup:
    """A table in a box that scrolls sideways where the screen is narrow; a heading may be a finished `th`."""
    heads = [h if isinstance(h, Markup) and h.startswith("<th") else tag("th", h, scope="col") for h in head]
    inner = tag("table", tag("thead", tag("tr", heads)), tag("tbody", list(rows)), **attributes)
    return tag(
        "div", inner, class_="scroll", tabindex=0, role="region", aria_label=attributes.get("aria_label", "table")
    )


def note(text: str) -> Markup:
    """A line that explains what follows."""
    return tag("p", text, class_="note")


def right(words: Any, **attributes: Any) -> Markup:
    """The heading of a column of numbers."""
    return tag("th", words, class_="n", scope="col", **attributes)


def number(value: float | None, digits: int = 3) -> str:
    """A number as a reader wants it: so many significant digits, no exponent up to a million; a dash for none."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    if 1e-4 <= abs(value) < 1e6:
        text = f"{value:.{max(digits - 1 - math.floor(math.log10(abs(value))), 0)}f}"
    else:
        text = f"{value:.{digits - 1}e}"
    return text.replace("-", "−")


def percent(share: float | None) -> str:
    """A share in per cent; a tenth is shown only near the ends, where it says something."""
    if share is None or not math.isfinite(share):
        return "–"
    value = 100.0 * share
    return f"{value:.0f}" if 2.0 <= value <= 98.0 or value in (0.0, 100.0) else f"{value:.1f}"


def _attribute(key: str, value: Any) -> str:
    name = key.rstrip("_").replace("_", "-")
    if name in ("viewbox", "preserveaspectratio"):
        name = {"viewbox": "viewBox", "preserveaspectratio": "preserveAspectRatio"}[name]
    if value is None or value is False:
        return ""
    if value is True:
        return f" {name}"
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return f' {name}="{html.escape(text)}"'
