"""Tools that take any number of points, in a real browser: rims, areas and ways."""

import re

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from browsing import in_browser, visiting
from playwright.sync_api import Page, expect
from test_page_find import SHEET, stage
from test_page_measure import at, draw, opened

pytestmark = in_browser


def rim(n: int, middle=(400.0, 300.0), across=(90.0, 60.0)) -> list[tuple[float, float]]:
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return [(middle[0] + across[0] * np.cos(a), middle[1] + across[1] * np.sin(a)) for a in angles]


def handles(page: Page, name: str, count: int) -> None:
    expect(page.locator(f"[data-handle^='A-{name}-']")).to_have_count(count)


def test_a_rim_is_ended_by_a_button_once_it_has_enough_points(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Disc", *rim(6)[:4])
    more = page.get_by_role("button", name="1 more")
    expect(more).to_be_disabled()
    page.get_by_role("button", name="Back", exact=True).click()
    expect(page.get_by_role("button", name="2 more")).to_be_disabled()
    draw_on(page, *rim(6)[3:])
    expect(page.locator("path.line.draft")).to_have_attribute("d", re.compile("C.*Z"))
    assert Axe().run(page).violations_count == 0
    page.get_by_role("button", name="Done").click()
    handles(page, "rim", 6)
    page.get_by_test_id("details").locator("#f-diameter").fill("80 ± 1 mm")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile("mm|m"))


def draw_on(page: Page, *points: tuple[float, float]) -> None:
    """Further points with the tool that is chosen."""
    box = page.get_by_test_id("stage").bounding_box()
    for x, y in points:
        page.mouse.click(box["x"] + x, box["y"] + y)
        page.wait_for_timeout(350)  # not a double click


@pytest.mark.parametrize("end", ["Enter", "double click", "first again"])
def test_an_area_of_any_number_of_corners_is_that_of_its_polygon(visit, examples, end):
    """The left part of the sheet that the reference is: two thirds of it, by six corners, is two thirds of its area."""
    page = opened(visit, examples / "desk.jpg")
    a, b, c, d = (np.array(corner) for corner in SHEET)
    wide = [np.array(at_share(SHEET, u, v)) for u, v in ((0, 0), (1, 0), (1, 0.5), (0.5, 0.5), (0.5, 1), (0, 1))]
    places = [stage(page, *corner) for corner in wide]
    draw(page, "Plane area", *(stage(page, *corner) for corner in (a, b, c, d)), *places[:-1])
    draw_on(page, places[-1])
    if end == "Enter":
        page.keyboard.press("Enter")
    else:
        draw_on(page, places[-1 if end == "double click" else 0])
    handles(page, "path", 6)
    handles(page, "points", 4)
    assert "C" not in page.locator("[data-shape=A] path.line").last.get_attribute("d")  # corners stay corners
    page.get_by_label("First side").fill("210 ± 0.5 mm")
    page.get_by_label("Second side").fill("297 ± 0.5 mm")
    answer = page.get_by_test_id("answer")
    expect(answer).to_have_text(re.compile("m²"))
    value, unit = re.match(r"([\d.\u202f]+)\s*(\S+)", answer.inner_text()).groups()
    area_m2 = float(value.replace("\u202f", "")) * {"mm²": 1e-6, "cm²": 1e-4, "m²": 1.0}[unit]
    assert area_m2 == pytest.approx(0.75 * 0.21 * 0.297, rel=0.02)


def at_share(corners, u: float, v: float) -> tuple[float, float]:
    """Where a share of a rectangle's sides lies in its picture."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    rows = []
    for (x, y), (s, t) in zip(corners, square, strict=True):
        rows += [[s, t, 1, 0, 0, 0, -x * s, -x * t, -x], [0, 0, 0, s, t, 1, -y * s, -y * t, -y]]
    h = np.linalg.svd(np.array(rows))[2][-1].reshape(3, 3) @ [u, v, 1]
    return float(h[0] / h[2]), float(h[1] / h[2])


def test_a_way_of_several_pieces_in_a_plane(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    way = [stage(page, *at_share(SHEET, u, v)) for u, v in ((0, 0), (1, 0), (1, 1))]
    draw(page, "Plane length", *(stage(page, *corner) for corner in SHEET), *way[:2])
    draw_on(page, way[2])
    page.keyboard.press("Enter")
    handles(page, "path", 3)
    page.get_by_label("First side").fill("210 ± 0.5 mm")
    page.get_by_label("Second side").fill("297 ± 0.5 mm")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile(r"50\d(\.\d)?\s*mm|0\.50\d*\s*m"))


def test_a_rim_by_keys_alone(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    page.locator("summary").filter(has_text="More").click()
    page.get_by_role("button", name="Ball", exact=True).press("Enter")
    page.wait_for_timeout(200)
    page.locator("body").click(position={"x": 5, "y": 5})
    for key in ("Shift+ArrowRight", "Shift+ArrowDown", "Shift+ArrowLeft", "Shift+ArrowUp"):
        for _ in range(5):
            page.keyboard.press(key)
        page.keyboard.press("Enter")
    page.keyboard.press("Backspace")
    page.keyboard.press("Enter")  # not steered since: three are enough for a ball
    handles(page, "rim", 3)
    assert at(page, "A", 0)[1] + 50 == at(page, "A", 1)[1] and at(page, "A", 1)[0] - 50 == at(page, "A", 2)[0]


def test_a_rim_by_fingers(browser, server, examples):
    visit = visiting(browser, server, "phone", "dark")
    page = opened(visit, examples / "desk.jpg")
    page.locator("summary").filter(has_text="More").tap()
    page.get_by_role("button", name="Ball", exact=True).tap()
    box = page.get_by_test_id("stage").bounding_box()
    for x, y in ((150, 80), (190, 110), (150, 140), (110, 110)):
        page.touchscreen.tap(box["x"] + x, box["y"] + y)
        page.wait_for_timeout(350)
    page.get_by_role("button", name="Back", exact=True).tap()
    page.get_by_role("button", name="Done").tap()
    handles(page, "rim", 3)
    visit.context.close()
    assert visit.unexpected() == []
