"""What holds for every page: accessible, no sideways scroll, nothing from elsewhere; and the pictures of the documentation."""

import os
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from browsing import SIZES, in_browser, visiting
from playwright.sync_api import Page, expect
from running import serving
from test_page_measure import draw

pytestmark = in_browser

PAGES = ("calculator", "measure", "empty", "api", "login")


def shown(visit, name: str, examples) -> Page:
    """A page in the state people see it in."""
    if name == "calculator":
        page = visit.open()
        expect(page.get_by_role("slider")).to_be_visible()
        page.get_by_role("button", name="Uncertainty of Real size").click()
        page.locator("details").evaluate_all("all => all.forEach(one => one.open = true)")
    elif name == "measure":
        page = visit.open("/measure")
        page.locator("input[type=file]").first.set_input_files(examples / "desk.jpg")
        expect(page.get_by_test_id("stage").locator("canvas").first).to_be_visible()
        page.wait_for_timeout(300)
        draw(page, "Known size", (80, 90), (230, 120))
        page.get_by_test_id("details").get_by_label("Real size", exact=True).fill("200 mm")
        expect(page.get_by_test_id("answer")).to_contain_text("m")
        page.locator("aside details").evaluate_all("all => all.forEach(one => one.open = true)")
    elif name == "login":
        page = visit.context.new_page()
        page.goto(f"{visit.server.address}/")
    else:
        page = visit.open("/measure" if name == "empty" else "/api")
        page.wait_for_timeout(500)
    return page


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", PAGES)
def test_axe_finds_nothing(browser, server, examples, name, size, theme):
    visit = visiting(browser, server, size, theme)
    page = shown(visit, name, examples)
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    assert page.evaluate("document.documentElement.scrollWidth") <= SIZES[size][0]
    visit.context.close()
    assert visit.unexpected() == []


def test_a_password_opens_the_page_from_elsewhere(browser, tmp_path):
    with serving(tmp_path, "--host", "0.0.0.0", password="correct horse") as server:
        visit = visiting(browser, server)
        visit.expected = "401"
        page = visit.context.new_page()
        page.goto(server.address)
        page.get_by_label("Password").fill("wrong")
        page.get_by_role("button", name="Open").click()
        expect(page.get_by_role("status")).to_contain_text("not it")
        page.get_by_label("Password").fill("correct horse")
        page.get_by_role("button", name="Open").click()
        expect(page.get_by_test_id("value")).to_have_text("13.56")
        visit.context.close()


def test_pictures_of_the_documentation(browser, server, examples, tmp_path):
    """Taken in every run; kept where SUBTENSE_PICTURES names a folder (`make pictures`)."""
    folder = Path(os.environ.get("SUBTENSE_PICTURES", tmp_path))
    for name, theme, size, full in (
        ("calculator", "light", "desktop", False), ("calculator", "dark", "phone", False), ("measure", "light", "desktop", False),
        ("measure", "dark", "phone", False), ("api", "light", "desktop", False),
    ):  # fmt: skip
        visit = visiting(browser, server, size, theme)
        page = visit.open({"calculator": "/", "measure": "/measure", "api": "/api"}[name])
        if name == "calculator":
            expect(page.get_by_role("slider")).to_be_visible()
        if name == "measure":
            measured(page, examples, size)
        page.wait_for_timeout(500)
        page.evaluate("scrollTo(0, 0)")
        page.screenshot(path=folder / f"{name}-{size}.jpg", type="jpeg", quality=86, full_page=full)
        assert (folder / f"{name}-{size}.jpg").stat().st_size > 20_000
        visit.context.close()
        assert visit.unexpected() == []


def measured(page: Page, examples: Path, size: str) -> None:
    """A sheet by its corners, a card by its length, a marker found."""
    page.locator("input[type=file]").first.set_input_files(examples / "desk.jpg")
    expect(page.get_by_test_id("stage").locator("canvas").first).to_be_visible()
    page.wait_for_timeout(400)
    page.get_by_role("button", name="Find…").click()
    page.get_by_label("side of the markers' black square").fill("50 ± 0.2 mm")
    page.get_by_role("button", name="Find ArUco and AprilTag markers").click()
    expect(page.get_by_test_id("details")).to_contain_text("36h11", timeout=20_000)
    box = page.get_by_test_id("stage").bounding_box()
    scale = min(box["width"] / 1600, box["height"] / 1200)
    left, top = (box["width"] - 1600 * scale) / 2, (box["height"] - 1200 * scale) / 2
    corners = ((394.4, 372.4), (747.8, 363.3), (757.8, 821.1), (294.7, 839.6))
    draw(page, "Rectangle", *((left + x * scale, top + y * scale) for x, y in corners))
    page.get_by_label("First side").fill("210 ± 1 mm")
    page.get_by_label("Second side").fill("297 ± 1 mm")
    expect(page.locator("[data-shape=A]")).to_contain_text("mm")
    if size == "desktop":
        for label in ("36h11 id 7", "A"):
            page.get_by_role("checkbox", name=f"Pick {label}", exact=True).check()
        page.get_by_role("button", name="Distance 36h11 id 7 to A").click()
        expect(page.get_by_test_id("together").get_by_test_id("answer")).to_contain_text("mm")
