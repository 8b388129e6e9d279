"""The report in a real browser: clicks choose the right trials, nothing complains, nothing is asked of a network."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from synthetic_campaign import VARIANTS, content, rows

from auvsim.campaign.report import html

webdriver = pytest.importorskip("selenium.webdriver", reason="no selenium: pip install 'auvsim[test]'")
Keys = pytest.importorskip("selenium.webdriver.common.keys").Keys
Select = pytest.importorskip("selenium.webdriver.support.select").Select
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="no browser: apt-get install chromium chromium-driver"
)
OPTIONS = """
    --headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
    --disable-component-update --disable-sync --disable-dev-shm-usage --window-size=1280,900
"""
ROWS = "Array.from(document.querySelectorAll('#trials tbody tr'))"
CELLS = "Array.from(document.querySelectorAll('.frame.compass svg.map .cell'))"


class Page:
    """An open page: what the tests ask of it."""

    def __init__(self, driver) -> None:
        self.driver = driver

    def find(self, selector: str):
        """The first element."""
        return self.driver.find_element("css selector", selector)

    def run(self, script: str, *arguments):
        """What a script returns."""
        return self.driver.execute_script(script, *arguments)

    def click(self, selector: str) -> None:
        """Clicks as a reader does, where the element is."""
        element = self.find(selector)
        self.run("arguments[0].scrollIntoView({block: 'center'})", element)
        webdriver.ActionChains(self.driver).move_to_element(element).click().perform()

    def press(self, *keys: str) -> None:
        """Presses keys where the focus is."""
        webdriver.ActionChains(self.driver).send_keys(*keys).perform()

    def listed(self) -> list[tuple[str, int]]:
        """Variant and number of the trials that the list shows."""
        script = f"return {ROWS}.map(row => [row.cells[0].textContent, Number(row.cells[1].textContent)])"
        return [(variant, trial) for variant, trial in self.run(script)]

    def requests(self, path: Path) -> list[str]:
        """Addresses that the page at a path asked for since the last call; the browser's own pages ask too."""
        messages = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        sent = [m["params"] for m in messages if m["method"] == "Network.requestWillBeSent"]
        return [each["request"]["url"] for each in sent if each["documentURL"] == path.as_uri()]


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A browser with an empty profile."""
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for option in (*OPTIONS.split(), f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield Page(driver)
    driver.quit()


@pytest.fixture
def page(browser: Page, tmp_path: Path) -> Iterator[Page]:
    """The synthetic campaign's report, opened anew; it must leave the console empty and the network alone."""
    path = tmp_path / "report.html"
    path.write_text(html(content()), encoding="utf-8")
    browser.driver.get(path.as_uri())
    yield browser
    assert browser.driver.get_log("browser") == []
    assert [address for address in browser.requests(path) if not address.startswith("data:")] == [path.as_uri()]


def test_the_checks_of_console_and_network_see_what_they_are_for(browser: Page, tmp_path: Path) -> None:
    """A page that does both wrong."""
    path = tmp_path / "wrong.html"
    image = "http://127.0.0.1:9/picture.png"
    path.write_text(f"<img src='{image}'><script>throw Error('wrong')</script>", encoding="utf-8")
    browser.driver.get(path.as_uri())
    assert image in browser.requests(path)
    assert any("wrong" in entry["message"] for entry in browser.driver.get_log("browser"))


def test_a_failure_kind_lists_its_trials(page: Page) -> None:
    """A click lists them, another lists all again; the count says so."""
    aborted = [(r["variant"], r["trial"]) for r in rows() if r["failure"] == "aborted"]
    assert aborted
    everything = page.listed()
    assert len(everything) == 100  # of 120
    page.click("""#failures [data-filter='{"kind": "aborted"}']""")
    assert page.listed() == aborted
    assert page.find("#count").text == f"{len(aborted)} of 120 trials: aborted"
    page.click("""#failures [data-filter='{"kind": "aborted"}']""")
    assert page.listed() == everything


def test_a_cell_of_the_map_lists_its_trials(page: Page) -> None:
    """Cell of the second variant, to within 22.5 degrees of north, by the test's own sums; chosen by the keyboard."""
    labels = page.run(f"return {CELLS}.map(cell => cell.dataset.label)")
    label = next(text for text in labels if text.startswith(VARIANTS[1]) and text.endswith("(N)"))
    low, high = (float(label.split("current ")[1].split()[i]) for i in (0, 2))
    expected = [
        (r["variant"], r["trial"])
        for r in rows()
        if r["variant"] == VARIANTS[1] and low <= r["current.speed"] < high and abs(r["current.direction_deg"]) < 22.5
    ]
    assert expected
    page.run(f"const cell = {CELLS}.find(c => c.dataset.label === arguments[0]); cell.id = 'it'; cell.focus()", label)
    page.press(Keys.ENTER)
    assert page.listed() == expected
    assert page.find("#it").get_attribute("aria-pressed") == "true"
    assert page.find("#said").text.endswith(label)
    page.press(Keys.ARROW_RIGHT, Keys.SPACE)  # to the next cell
    assert page.listed() != expected
    page.click("#clear")
    assert len(page.listed()) == 100


def test_variants_hide_everywhere(page: Page) -> None:
    """A variant that is not chosen leaves the list, the maps and the curves."""
    page.click("#variants input[value='1']")
    assert {variant for variant, _ in page.listed()} == {VARIANTS[0]}
    parts = "Array.from(document.querySelectorAll('[data-variant]'))"
    shown = page.run(f"return {parts}.filter(part => part.getClientRects().length).map(part => part.dataset.variant)")
    assert set(shown) == {"0"}


def test_columns_sort_both_ways(page: Page) -> None:
    """By miss distance, up and down; trials without one stand last both times."""
    misses = sorted(r["miss_distance"] for r in rows() if r["miss_distance"] is not None)
    heading = "#trials thead th:nth-child(5) button"
    assert page.find(heading).text == "miss [m]"
    cells = f"return {ROWS}.map(row => row.cells[4].dataset.value)"
    page.click(heading)
    assert [float(v) for v in page.run(cells)] == pytest.approx(misses[:100], rel=1e-5)  # six digits are written
    page.click(heading)
    assert [float(v) for v in page.run(cells)] == pytest.approx(misses[::-1][:100], rel=1e-5)
    page.click("#more")
    shown = page.run(cells)
    assert len(shown) == 120
    assert set(shown[len(misses) :]) == {""}


def test_values_show_under_the_pointer(page: Page) -> None:
    """A cell says its counts, the curves their shares."""
    for selector, words in ((".cell", "docked"), ("svg.curves", "within")):
        element = page.find(selector)
        page.run("arguments[0].scrollIntoView({block: 'center'})", element)
        webdriver.ActionChains(page.driver).move_to_element(element).perform()
        assert words in page.find("#tip").text


def test_the_map_shows_first_attempts_and_turns_to_the_dock(page: Page) -> None:
    """What the two menus choose."""
    assert page.find(".frame.compass").is_displayed()
    assert not page.find(".frame.dock").is_displayed()
    Select(page.find("select[name=frame]")).select_by_visible_text("by the dock's axis")
    assert page.find(".frame.dock").is_displayed()
    assert not page.find(".frame.compass").is_displayed()
    cell = """.frame.dock .cell[style*="--docked:100"]:not([style*="--first:100"])"""
    before = page.find(cell).value_of_css_property("fill")
    Select(page.find("select[name=measure]")).select_by_value("first")
    assert page.find(cell).value_of_css_property("fill") != before


def test_the_page_fits_a_telephone(page: Page) -> None:
    """The page itself does not scroll sideways; its tables do."""
    size = {"width": 380, "height": 800, "deviceScaleFactor": 1, "mobile": False}
    page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        assert page.run("return document.documentElement.scrollWidth") <= 380
    finally:
        page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
