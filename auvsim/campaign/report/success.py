"""How often each variant has success, and how it differs from the first one in the same trials."""

import json
from dataclasses import dataclass

from auvsim.campaign.report.chart import Scale, colour, interval, interval_scale, ruler
from auvsim.campaign.report.content import Content, negated, quantile, values, words
from auvsim.campaign.report.markup import Markup, join, note, number, percent, right, table, tag
from auvsim.campaign.statistics import Difference

PAIRED = (
    "In the same trials: same conditions, same noises. 95 % intervals: Newcombe's for paired proportions, bootstrap "
    "over the pairs for means."
)
MEDIANS = {"miss_distance": "median miss [m]", "time": "median time [s]"}  # of those that are columns


@dataclass(frozen=True, kw_only=True, slots=True)
class Quantity:
    """How differences of a quantity are shown."""

    words: str
    unit: str
    factor: float = 1.0  # to that unit
    more_is_better: bool | None = False  # None: nobody says


POSITION = {"position_rms": Quantity(words="position error, rms", unit="m")}
DOCKING = {"miss_distance": Quantity(words="miss distance", unit="m")} | POSITION  # where it is all that vehicles do


def quantities(content: Content) -> dict[str, Quantity]:
    """What is shown of differences: rates, what missions measure, and the error of the position."""
    layout = content.layout
    found = {
        name: Quantity(words=words(name), unit="points", factor=100.0, more_is_better=True) for name in layout.rates
    }
    if layout.kinds == ("docking",):
        return found | DOCKING
    measured = {
        name: Quantity(words=words(name), unit=layout.columns[name].units, more_is_better=None) for name in layout.means
    }
    return found | measured | POSITION


def variants_table(content: Content) -> Markup:
    """Successes with Wilson's 95 % intervals."""
    scale = interval_scale([end for rate in content.rates for end in (rate.low, rate.high)], bounds=(0.0, 1.0))
    heads = []
    for quantity in content.layout.rates:
        heads += [words(quantity), tag("th", "95 % interval", ruler(scale, 100.0, " %"), scope="col")]
    heads += map(right, (negated(content.layout.success), *_medians(content).values()))
    rows = [_variant(content, index, name, scale) for index, name in enumerate(content.variants)]
    return table(["variant", *heads], rows, aria_label="success")


def _variant(content: Content, index: int, name: str, scale: Scale) -> Markup:
    cells = [name_cell(index, name)]
    for quantity in content.layout.rates:
        rate = content.rate(name, quantity)
        share = rate.successes / rate.trials if rate.trials else None
        said = tag("strong", f"{percent(share)} %"), tag("span", f" {rate.successes} of {rate.trials}", class_="weak")
        ends = f"{percent(rate.low)} to {percent(rate.high)} %"
        bar = interval(scale, share, rate.low, rate.high, index)
        cells += [tag("td", said), tag("td", bar, title=ends)]
    success = content.rate(name, content.layout.success)
    key = json.dumps({"v": str(index), "docked": "0"})
    failed = success.trials - success.successes
    data = {"data_filter": key, "data_label": f"{name}, {negated(success.quantity)}"}
    cells.append(tag("td", tag("button", failed, class_="plain", type="button", **data), class_="n"))
    trials = content.rows_of(name)
    cells += [tag("td", number(quantile(values(trials, column), 0.5)), class_="n") for column in _medians(content)]
    return tag("tr", cells, data_variant=index)


def _medians(content: Content) -> dict[str, str]:
    """Headings of medians by their columns."""
    return {column: heading for column, heading in MEDIANS.items() if column in content.layout.columns}


def differences_table(content: Content) -> Markup:
    """Paired differences with their intervals, each quantity on a scale of its own."""
    if not content.differences:
        return note("Nothing to compare.")
    rows = []
    for key, quantity in quantities(content).items():
        found = [d for d in content.differences if d.quantity == key]
        if not found:
            continue
        scale = interval_scale([0.0, *(end for d in found for end in (d.low, d.high))])
        better = {True: "right is better", False: "left is better", None: ""}[quantity.more_is_better]
        heading = tag("th", f"{quantity.words} [{quantity.unit}]", scope="rowgroup", colspan=3)
        marks = tag("td", ruler(scale, quantity.factor))
        rows += [tag("tr", heading, marks, tag("td", better, colspan=2), class_="group")]
        rows += [_difference(content, d, quantity, scale) for d in found]
    heads = ["", right("difference"), "95 % interval", "", "", right("pairs")]
    return join([note(PAIRED), table(heads, rows, aria_label="differences")])


def _difference(content: Content, d: Difference, quantity: Quantity, scale: Scale) -> Markup:
    index = content.variants.index(d.variant)
    verdict = "better" if (d.value > 0.0) == quantity.more_is_better else "worse"
    verdict = "clear difference" if quantity.more_is_better is None else verdict
    verdict = "no clear difference" if d.low <= 0.0 <= d.high else verdict
    value, low, high = (_signed(quantity.factor * x) for x in (d.value, d.low, d.high))
    return tag(
        "tr",
        name_cell(index, d.variant),
        tag("td", tag("strong", value), class_="n"),
        tag("td", f"{low} to {high}"),
        tag("td", interval(scale, d.value, d.low, d.high, index, zero=0.0)),
        tag("td", verdict),
        tag("td", d.pairs, class_="n"),
        data_variant=index,
    )


def name_cell(index: int, name: str) -> Markup:
    """The heading of a line about a variant."""
    return tag("th", tag("span", class_="swatch"), name, scope="row", class_=colour(index))


def _signed(value: float) -> str:
    return ("+" if value > 0.0 else "") + number(value)
