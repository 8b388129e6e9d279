"""How often each variant docks, and how it differs from the first one in the same trials."""

import json
from dataclasses import dataclass

from auvsim.campaign.report.chart import Scale, colour, interval, interval_scale, ruler
from auvsim.campaign.report.content import Content, quantile, values
from auvsim.campaign.report.markup import Markup, join, note, number, percent, right, table, tag
from auvsim.campaign.statistics import Difference

RATES = {"docked": "docked", "docked_first": "docked on the first attempt"}  # in words
PAIRED = (
    "In the same trials: same conditions, same noises. 95 % intervals: Newcombe's for paired proportions, bootstrap "
    "over the pairs for means."
)
MEDIANS = {"miss_distance": "median miss [m]", "time": "median time [s]"}


@dataclass(frozen=True, kw_only=True, slots=True)
class Quantity:
    """How differences of a quantity are shown."""

    words: str
    unit: str
    factor: float = 1.0  # to that unit
    more_is_better: bool = False


QUANTITIES = {
    "docked": Quantity(words=RATES["docked"], unit="points", factor=100.0, more_is_better=True),
    "docked_first": Quantity(words=RATES["docked_first"], unit="points", factor=100.0, more_is_better=True),
    "miss_distance": Quantity(words="miss distance", unit="m"),
    "position_rms": Quantity(words="position error, rms", unit="m"),
}


def variants_table(content: Content) -> Markup:
    """Successes with Wilson's 95 % intervals."""
    scale = interval_scale([end for rate in content.rates for end in (rate.low, rate.high)], bounds=(0.0, 1.0))
    heads = []
    for words in RATES.values():
        heads += [words, tag("th", "95 % interval", ruler(scale, 100.0, " %"), scope="col")]
    heads += map(right, ("not docked", *MEDIANS.values()))
    rows = [_variant(content, index, name, scale) for index, name in enumerate(content.variants)]
    return table(["variant", *heads], rows, aria_label="success")


def _variant(content: Content, index: int, name: str, scale: Scale) -> Markup:
    cells = [name_cell(index, name)]
    for quantity in RATES:
        rate = content.rate(name, quantity)
        share = rate.successes / rate.trials if rate.trials else None
        words = tag("strong", f"{percent(share)} %"), tag("span", f" {rate.successes} of {rate.trials}", class_="weak")
        ends = f"{percent(rate.low)} to {percent(rate.high)} %"
        bar = interval(scale, share, rate.low, rate.high, index)
        cells += [tag("td", words), tag("td", bar, title=ends)]
    docked = content.rate(name, "docked")
    key = json.dumps({"v": str(index), "docked": "0"})
    failed = docked.trials - docked.successes
    data = {"data_filter": key, "data_label": f"{name}, not docked"}
    cells.append(tag("td", tag("button", failed, class_="plain", type="button", **data), class_="n"))
    trials = content.rows_of(name)
    cells += [tag("td", number(quantile(values(trials, column), 0.5)), class_="n") for column in MEDIANS]
    return tag("tr", cells, data_variant=index)


def differences_table(content: Content) -> Markup:
    """Paired differences with their intervals, each quantity on a scale of its own."""
    if not content.differences:
        return note("Nothing to compare.")
    rows = []
    for key, quantity in QUANTITIES.items():
        found = [d for d in content.differences if d.quantity == key]
        if not found:
            continue
        scale = interval_scale([0.0, *(end for d in found for end in (d.low, d.high))])
        better = "right is better" if quantity.more_is_better else "left is better"
        heading = tag("th", f"{quantity.words} [{quantity.unit}]", scope="rowgroup", colspan=3)
        marks = tag("td", ruler(scale, quantity.factor))
        rows += [tag("tr", heading, marks, tag("td", better, colspan=2), class_="group")]
        rows += [_difference(content, d, quantity, scale) for d in found]
    heads = ["", right("difference"), "95 % interval", "", "", right("pairs")]
    return join([note(PAIRED), table(heads, rows, aria_label="differences")])


def _difference(content: Content, d: Difference, quantity: Quantity, scale: Scale) -> Markup:
    index = content.variants.index(d.variant)
    verdict = "better" if (d.value > 0.0) == quantity.more_is_better else "worse"
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
