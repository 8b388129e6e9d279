"""How good the estimates were, and whether the filters knew how good."""

from auvsim.campaign.report.chart import SIDE, WIDTH, Scale, band, ruler
from auvsim.campaign.report.content import Content, quantile, values
from auvsim.campaign.report.markup import Markup, join, note, number, right, table, tag
from auvsim.campaign.report.success import name_cell
from auvsim.campaign.statistics import Nees

DECISIVE = ("approach", "final")  # phases that docking hangs on
CONSISTENT = (
    "NEES: squared error over claimed covariance; 1 is consistent, more is overconfident. Bands hold 95 % of the means "
    "of a consistent filter if each trial counts as one sample, which is wide."
)
PREFIX = "position_rms"  # of the columns of errors; the phase follows


def section(content: Content) -> Markup:
    """Errors by phase, and NEES beside the interval of a consistent filter."""
    tables = tag("div", _errors(content), _consistency(content), class_="row")
    return join([note(CONSISTENT), tables])


def _errors(content: Content) -> Markup:
    phases = [
        "all",
        *(p for p in content.layout.phases if any(row.get(f"{PREFIX}_{p}") is not None for row in content.rows)),
    ]
    median = "median of vehicles" if content.layout.fleet else "median trial"
    head = [f"position rms [m], {median}", *(right(_words(phase)) for phase in phases)]
    rows = []
    for index, name in enumerate(content.variants):
        trials = content.rows_of(name)
        columns = [PREFIX if p == "all" else f"{PREFIX}_{p}" for p in phases]
        cells = [tag("td", number(quantile(values(trials, column), 0.5)), class_="n") for column in columns]
        rows.append(tag("tr", name_cell(index, name), cells, data_variant=index))
    return table(head, rows, aria_label="estimate errors")


def _consistency(content: Content) -> Markup | None:
    decisive = [phase for phase in DECISIVE if phase in content.layout.phases] or content.layout.phases
    phases = ("all", *decisive)
    found = [n for n in content.nees if n.phase in phases and n.mean > 0.0]
    if not found:
        return None
    ends = [end for n in found for end in (n.mean, n.low, n.high)]
    low, high = min(0.5, 0.8 * min(ends)), max(2.0, 1.25 * max(ends))
    scale = Scale(low=low, high=high, start=SIDE, end=WIDTH - SIDE, logarithmic=True)
    heads = ["NEES per axis", right("mean"), "if consistent", tag("th", ruler(scale), scope="col"), ""]
    rows = []
    for phase in phases:
        lines = [_nees(content, n, scale) for n in found if n.phase == phase]
        heading = tag("tr", tag("th", _words(phase), scope="rowgroup", colspan=5), class_="group")
        rows += [heading, *lines] if lines else []
    return table(heads, rows, aria_label="consistency")


def _nees(content: Content, n: Nees, scale: Scale) -> Markup:
    index = content.variants.index(n.variant)
    verdict = "consistent" if n.low <= n.mean <= n.high else ("overconfident" if n.mean > n.high else "cautious")
    return tag(
        "tr",
        name_cell(index, n.variant),
        tag("td", tag("strong", number(n.mean)), class_="n"),
        tag("td", f"{number(n.low)} to {number(n.high)}"),
        tag("td", band(scale, n.mean, n.low, n.high, index)),
        tag("td", verdict),
        data_variant=index,
    )


def _words(phase: str) -> str:
    return "all phases" if phase == "all" else phase.replace("_", " ")
