"""What the trials cost."""

from auvsim.campaign.report.content import Content, quantile, values
from auvsim.campaign.report.markup import Markup, number, right, table, tag
from auvsim.campaign.report.success import name_cell

HEADS = (
    "trials", "median wall time [s]", "95 %", "times real time, median", "median CPU time [s]", "all together [min]",
)  # fmt: skip


def section(content: Content) -> Markup:
    """Wall-clock and CPU time of a trial, one line for each variant."""
    rows = []
    for index, name in enumerate(content.variants):
        trials = content.trials_of(name)
        walls, factors = values(trials, "wall_time"), values(trials, "real_time_factor")
        busy = values(trials, "cpu_time")
        numbers = [quantile(walls, 0.5), quantile(walls, 0.95), quantile(factors, 0.5)]
        numbers += [quantile(busy, 0.5), sum(busy) / 60.0]
        cells = [tag("td", text, class_="n") for text in (len(walls), *map(number, numbers))]
        rows.append(tag("tr", name_cell(index, name), cells, data_variant=index))
    return table(["", *map(right, HEADS)], rows, aria_label="cost")
