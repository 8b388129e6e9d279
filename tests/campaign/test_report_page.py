"""The report as a text: whole, escaped, self-contained, and with the numbers that the table has."""

import html.parser
import math
import re
import time

import numpy as np
import pytest
from synthetic_campaign import TRIALS, VARIANTS, content, row, rows

from auvsim.campaign.columns import layout
from auvsim.campaign.report import cells, cost, misses
from auvsim.campaign.report import html as page
from auvsim.campaign.report.chart import Scale, interval_scale
from auvsim.campaign.report.markup import VOID, Markup, number, percent, tag
from auvsim.campaign.report.page import facts, headline

OPEN_LINKS = ("href", "src", "action", "srcset", "xlink:href", "poster", "data")
ALONE = VOID | {"!doctype"}


class Reader(html.parser.HTMLParser):
    """Reads a page strictly: every element that opens closes in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.counts: dict[str, int] = {}
        self.links: list[str] = []
        self.ids: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, name, attrs):
        """Counts an element and takes its links."""
        self.counts[name] = self.counts.get(name, 0) + 1
        self.links += [value for key, value in attrs if key in OPEN_LINKS]
        self.ids += [value for key, value in attrs if key == "id"]
        if name not in ALONE:
            self.open.append(name)

    def handle_startendtag(self, name, attrs):
        """The same of an element that closes itself."""
        self.handle_starttag(name, attrs)
        if name not in ALONE:
            self.open.pop()

    def handle_endtag(self, name):
        """Must close the element that opened last."""
        if name not in ALONE:
            assert self.open.pop() == name

    def handle_data(self, data):
        """Keeps the words outside scripts and styles."""
        if self.open and self.open[-1] not in ("script", "style"):
            self.words.append(data)


@pytest.fixture(scope="module")
def text() -> str:
    """The synthetic campaign's report."""
    return page(content())


def test_the_page_is_whole_and_asks_for_nothing(text: str) -> None:
    """Well formed, no identifier twice, and links only within the page and to what is kept."""
    reader = Reader(text)
    assert len(reader.ids) == len(set(reader.ids))
    kept = {f"logs/{r['trial']}%20100%25.nc" for r in rows() if r["log"]}
    assert kept
    again = "replays/careful-7/docking.mp4"
    assert set(reader.links) == kept | {again, "#trials", "data:,", "plan.yaml", "table.csv"}
    assert not re.search(r"@import|url\(|fetch\(|XMLHttp|WebSocket|https?:", text)


def test_texts_cannot_be_code(text: str) -> None:
    """A name and an error that look like elements are shown, not obeyed."""
    reader = Reader(text)
    assert "b" not in reader.counts
    assert reader.counts["script"] == 2
    assert "<b>bold</b>" in reader.words
    assert any("cannot </script><script>alert(1)</script>" in words for words in reader.words)


def test_every_trial_is_in_the_list(text: str) -> None:
    """With its command, and without JavaScript."""
    listed = re.search(r'<section id="trials".*?<tbody>(.*)</tbody>', text, re.DOTALL)
    assert listed is not None
    assert listed[1].count("<tr ") == 2 * TRIALS
    assert listed[1].count('class="command"') == 2 * TRIALS


@pytest.mark.parametrize("frame", ["compass", "dock"])
def test_every_trial_is_in_the_cell_it_belongs_to(frame: str) -> None:
    """Cells by an angle between vectors and a comparison of edges; all in all as many as there are trials."""
    grid = cells.choose(content())
    assert grid is not None
    assert grid.edges[0] <= min(r["current.speed"] for r in rows())
    assert grid.edges[-1] >= max(r["current.speed"] for r in rows())
    for each in rows():
        ring, sector = map(int, grid.place(each, frame).split(","))
        assert grid.edges[ring] <= each["current.speed"] <= grid.edges[ring + 1]
        reference = each["dock.heading_deg"] if frame == "dock" else 0.0
        flow, middle = np.radians([each["current.direction_deg"] - reference, 360.0 / grid.sectors * sector])
        off = math.acos(min(np.cos(flow) * np.cos(middle) + np.sin(flow) * np.sin(middle), 1.0))
        assert off <= math.pi / grid.sectors + 1e-6  # rounding of the cosine near 1


def test_the_map_counts_what_docked(text: str) -> None:
    """Counts in the cells of each variant and frame add up to the table's."""
    for index, name in enumerate(VARIANTS):
        mine = [r for r in rows() if r["variant"] == name]
        label = name.replace("<", "&lt;").replace(">", "&gt;")
        found = re.findall(
            rf"<title>{label}, current[^<]*docked (\d+) of (\d+), on the first attempt (\d+)</title>", text
        )
        sums = np.array(found, dtype=int).sum(axis=0)
        first = sum(r["docked_first"] for r in mine)
        assert sums.tolist() == [2 * sum(r["docked"] for r in mine), 2 * TRIALS, 2 * first], index  # two frames


def test_the_frame_of_the_dock_is_for_docking() -> None:
    """A track's map has north up alone, whatever is drawn."""
    assert cells.frames(content()) == ["compass", "dock"]
    assert cells.frames(content(layout=layout(("track",)))) == ["compass"]


def test_the_map_shows_first_what_tells_currents_apart(text: str) -> None:
    """Success where some failed; where all docked, the first attempt."""
    assert 'data-measure="docked"' in text
    docked = page(content(rows=[{**r, "docked": True} for r in rows()]))
    assert 'data-measure="first"' in docked
    assert docked.index('<option value="first">') < docked.index('<option value="docked">')


def test_the_curve_of_misses_is_the_share_of_all_trials() -> None:
    """Where the curve ends, and where it passes the median, by counting."""
    text = misses.section(content())
    curves = re.findall(r'<polyline points="([^"]*)"', text)
    assert len(curves) == 2
    up = Scale(low=0.0, high=1.0, start=misses.HEIGHT - misses.BOTTOM, end=misses.TOP)
    for name, curve in zip(VARIANTS, curves, strict=True):
        passed = [r["miss_distance"] for r in rows() if r["variant"] == name and r["miss_distance"] is not None]
        points = np.array([pair.split(",") for pair in curve.split()], dtype=float)
        assert (np.diff(points, axis=0) * [1.0, -1.0] >= 0.0).all()  # a staircase up
        assert points[-1, 1] == pytest.approx(up(len(passed) / TRIALS), abs=0.05)  # a tenth of a pixel is written
        assert len(points) == 2 * len(passed) + 1


def test_cost_is_that_of_all_trials() -> None:
    """60 trials of 0.25 s are a quarter of a minute."""
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", cost.section(content()))
    assert cells[: len(cost.HEADS)] == ["60", "0.500", "0.500", "600", "0.250", "0.250"]


def test_headline_is_the_best_first_with_its_interval() -> None:
    """Wilson's bounds as the roots of (p - rate)^2 = z^2 p (1 - p) / n."""
    z = 1.959963984540054
    for sentence, name in zip(headline(content()), VARIANTS, strict=True):
        docked = sum(r["docked"] for r in rows() if r["variant"] == name)
        rate = docked / TRIALS
        ends = np.roots([1.0 + z * z / TRIALS, -2.0 * rate - z * z / TRIALS, rate * rate]).real
        low, high = sorted(np.round(ends, 12).tolist())  # a root at 1 is 1 but for rounding
        assert sentence.startswith(f"{name} docks in {docked} of {TRIALS} trials ({percent(low)} to {percent(high)} %)")


def test_reports_of_poor_campaigns() -> None:
    """One variant, no current drawn, nothing docked, nothing failed, no trial at all: still a page."""
    one = [r for r in rows() if r["variant"] == VARIANTS[0]]
    still = [{**r, "current.speed": None} for r in one]
    lost = [row(1, trial) for trial in range(5, TRIALS, 11)]
    for chosen, differences, nees in ((one, [], []), (still, [], []), (lost, [], []), ([], [], [])):
        names = tuple(dict.fromkeys(r["variant"] for r in chosen)) or VARIANTS
        Reader(page(content(rows=chosen, variants=names, differences=differences, nees=nees)))


def test_a_large_campaign_is_quick_and_small() -> None:
    """5000 trials: a page of a few MB in a few seconds."""
    many = [{**row(variant, trial % TRIALS), "trial": trial} for variant in (0, 1) for trial in range(2500)]
    start = time.process_time()
    size = len(page(content(rows=many, trials=2500)))
    assert size < 8e6  # 1 kB a trial and what the page needs anyhow
    assert time.process_time() - start < 10.0  # measured 1 s; a shared machine is slower, a quadratic one far slower


def test_facts_say_what_was_run_and_what_is_missing() -> None:
    """Versions, engine and time; an unfinished campaign says so, one that a rule stopped says when."""
    told = facts(content())
    assert told["trials"] == "120 (2 × 60)"
    assert (told["auvsim"], told["engine"], told["took"]) == ("0.1.0", "processes, 2 at a time", "61 s")
    assert "incomplete" not in told
    assert facts(content(rows=rows()[:-7]))["incomplete"] == "7 trials are still to be run"
    stopped = facts(content(rows=rows()[:-7], state={"stopped": 40}))
    assert stopped["stopped"] == "after 40 trials of each variant"
    assert "incomplete" not in stopped


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"),
        (1.0, "1.00"),
        (-0.03549, "−0.0355"),
        (123456.0, "123456"),
        (1e7, "1.00e+07"),
        (None, "–"),
        (math.nan, "–"),
    ],
)
def test_numbers_are_shown_with_three_digits(value: float | None, shown: str) -> None:
    """As a reader wants them."""
    assert number(value) == shown


@pytest.mark.parametrize(("share", "shown"), [(0.0, "0"), (1.0, "100"), (0.995, "99.5"), (0.63, "63"), (0.004, "0.4")])
def test_per_cent_near_the_ends_have_a_tenth(share: float, shown: str) -> None:
    """99.5 % is not 100 %."""
    assert percent(share) == shown


def test_markup_escapes_all_but_markup() -> None:
    """In texts and in attributes; what is false is left out, zero is not."""
    made = tag("p", "<&>", Markup("<br/>"), None, [1, "x"], title='"', hidden=False, open=True, data_v=0)
    assert made == '<p title="&quot;" open data-v="0">&lt;&amp;&gt;<br/>1x</p>'


def test_scales_hold_their_values_between_round_ticks() -> None:
    """Ends lie outside all values, ticks inside the ends; a logarithm is linear in decades."""
    scale = interval_scale([-0.031, 0.42])
    assert scale.low <= -0.031 < 0.42 <= scale.high
    assert all(scale.low - 1e-9 <= tick <= scale.high + 1e-9 for tick in scale.ticks())
    decades = Scale(low=0.01, high=1.0, start=0.0, end=200.0, logarithmic=True)
    assert decades(0.1) == pytest.approx(100.0)
    assert decades.ticks(8) == pytest.approx([0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0])
    assert decades.ticks(4) == pytest.approx([0.01, 0.1, 1.0])


def test_trials_of_several_vehicles_count_once() -> None:
    """In the map a trial is one, and a success if it is one for all of its vehicles; its cost counts once."""
    several = layout(("docking",), True)
    pairs = [{**each, "vehicle": name} for each in rows() for name in ("left", "right")]
    for each in pairs:
        each["docked"] = each["docked"] and (each["vehicle"] == "left" or each["trial"] != 3)
    made = content(rows=pairs, layout=several)
    mine = made.trials_of(VARIANTS[0])
    assert [each["trial"] for each in mine] == list(range(TRIALS))
    assert [each["trial"] for each in mine if not each["docked"]] == [3]
    assert facts(made)["trials"] == "120 (2 × 60)"
    assert re.findall(r"<td[^>]*>([^<]*)</td>", cost.section(made))[0] == "60"
