"""The HTML report of a calibration in a real browser: accessible, no sideways scroll, nothing asked of anybody, whole on paper."""

import re

import pytest
from axe_playwright_python.sync_playwright import Axe
from browsing import SIZES, in_browser
from tests.test_calibration_reports import calibration, html, plots

pytestmark = in_browser


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of pictures of which some were left out, one with a strange name."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(html(calibration("left out"), plots("left out")))
    return path


def opened(browser, report, size="desktop", theme="light"):
    """The page, and what it asked for and complained of."""
    width, height = SIZES[size]
    page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=theme)
    wrong = []
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda r: None if r.url.startswith(("data:", report.as_uri())) else wrong.append(r.url))
    page.goto(report.as_uri())
    return page, wrong


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_axe_finds_nothing(browser, report, size, theme):
    page, wrong = opened(browser, report, size, theme)
    page.locator("details").evaluate_all("all => all.forEach(one => one.open = true)")
    assert page.locator("img").evaluate_all("all => all.every(one => one.complete && one.naturalWidth > 0)")
    assert page.evaluate("document.documentElement.scrollWidth") <= SIZES[size][0]
    assert wrong == []  # axe brings a script of its own
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    page.close()


def test_paper_is_white_and_has_every_picture(browser, report):
    page, _ = opened(browser, report, theme="dark")
    page.emulate_media(media="print", color_scheme="dark")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert not page.locator("details").is_visible()
    printed = page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) in range(5, 12)
    boxes = page.locator("img").evaluate_all("all => all.map(one => one.getBoundingClientRect().height)")
    assert len(boxes) == len(plots("left out")) and min(boxes) > 150
    page.close()
