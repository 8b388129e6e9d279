"""The page: a headline, then one section after another, all in one file that asks nothing of a network."""

from importlib import resources
from typing import Any

from auvsim.campaign.report import cells, cost, estimates, failures, maps, misses, success, trials
from auvsim.campaign.report.chart import colour
from auvsim.campaign.report.content import Content, words
from auvsim.campaign.report.markup import Markup, number, percent, tag

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
LOADING = Markup(  # see report.css; a browser that cannot run the script at the end shows all there is
    "document.documentElement.className = 'loading';"
    "addEventListener('error', () => (document.documentElement.className = ''));"
)


def html(content: Content) -> str:
    """The whole report as one HTML document."""
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", http_equiv="Content-Security-Policy", content=POLICY),
        tag("title", f"Campaign {content.name}"),
        tag("link", rel="icon", href="data:,"),
        tag("style", _data("report.css")),
        tag("script", LOADING),
    )
    script = tag("script", _data("report.js"))
    body = tag("body", _header(content), _choice(content), _sections(content), _floating(), script)
    return f"<!doctype html>\n{tag('html', head, body, lang='en')}\n"


def headline(content: Content) -> list[str]:
    """The result in a sentence for each variant, best first."""
    quantities = content.layout.rates
    found = [[content.rate(name, quantity) for quantity in quantities] for name in content.variants]
    found.sort(key=lambda rates: [-rate.successes / max(rate.trials, 1) for rate in rates])
    docking = quantities[:2] == ("docked", "docked_first")
    all_of_them = " of all vehicles" if content.layout.fleet else ""
    said = []
    for rate, *others in found:
        first = f"{rate.variant} docks" if docking else f"{rate.variant}: {words(rate.quantity)}{all_of_them}"
        more = f", in {others[0].successes} on the first attempt" if docking else ""
        interval = f"{percent(rate.low)} to {percent(rate.high)} %"
        said.append(f"{first} in {rate.successes} of {rate.trials} trials ({interval}){more}.")
    return said


def facts(content: Content) -> dict[str, str]:
    """What was run, by what, for how long."""
    state, planned = content.state, content.trials * len(content.variants)
    done = sum(len(content.trials_of(name)) for name in content.variants)
    told = {"trials": f"{done} ({len(content.variants)} × {content.trials})", "seed": str(content.seed)}
    if state.get("stopped") is not None:
        told["stopped"] = f"after {state['stopped']} trials of each variant"
    elif done < planned:
        told["incomplete"] = f"{planned - done} trials are still to be run"
    told |= {str(name): str(version) for name, version in (state.get("versions") or {}).items()}
    if state.get("engine"):
        jobs = f", {state['jobs']} at a time" if state.get("jobs") else ""
        told["engine"] = f"{state['engine']}{jobs}"
    if state.get("wall_time"):
        told["took"] = _duration(float(state["wall_time"]))
    return told


def _duration(seconds: float) -> str:
    """A wall-clock time in the unit that suits it."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{number(seconds / size, 2)} {unit}"
    return f"{number(seconds, 2)} s"


def _data(name: str) -> Markup:
    """A style sheet or script beside this module."""
    return Markup(resources.files("auvsim.campaign.report").joinpath(name).read_text(encoding="utf-8"))


def _header(content: Content) -> Markup:
    told = [tag("div", tag("dt", name), tag("dd", text)) for name, text in facts(content).items()]
    said = [tag("p", sentence, class_="lead") for sentence in headline(content)]
    return tag("header", tag("h1", content.name), tag("dl", told, class_="facts"), said)


def _choice(content: Content) -> Markup:
    """Which variants to show; nothing without JavaScript."""
    swatch, boxes = tag("span", class_="swatch"), []
    for index, name in enumerate(content.variants):
        box = tag("input", type="checkbox", checked=True, value=index)
        boxes.append(tag("label", box, " ", swatch, name, class_=colour(index)))
    return tag("fieldset", tag("legend", "Show"), boxes, id="variants", class_="js flex")


def _sections(content: Content) -> Markup:
    grid = cells.choose(content)
    count = tag("p", tag("span", id="count", aria_live="polite"), class_="note js")
    links = tag("p", [[tag("a", name, href=name), " "] for name in content.files], class_="note")
    more = tag("p", tag("button", "Show more", id="more", type="button"), class_="js")
    return tag(
        "main",
        _section("success", "Success", success.variants_table(content)),
        _section("differences", f"Difference from {content.variants[0]}", success.differences_table(content)),
        _section("map", "Success over the current", maps.section(content, grid)),
        _section("misses", "Miss distance", misses.section(content))
        if "miss_distance" in content.layout.columns
        else None,
        _section("failures", "Failures", failures.section(content)),
        _section("estimates", "Estimates", estimates.section(content)),
        _section("cost", "Cost", cost.section(content)),
        _section("trials", "Trials", count, trials.section(content, grid), more, links),
    )


def _section(name: str, title: str, *parts: Any) -> Markup:
    heading = tag("h2", title, id=f"{name}-title")
    return tag("section", heading, parts, id=name, aria_labelledby=f"{name}-title")


def _floating() -> Markup:
    """What is filtered, at the lower edge; and the values under the pointer."""
    listed = tag("a", "list", href="#trials")
    bar = [tag("span", id="said"), listed, tag("button", "show all", id="clear", type="button")]
    tip = tag("div", id="tip", class_="hidden", role="tooltip")
    return tag("div", tag("div", bar, id="status", class_="js flex hidden"), tip)
