"""Distances between measured things, and one number from several, in a real browser."""

import re

import pytest
from axe_playwright_python.sync_playwright import Axe
from browsing import SIZES, in_browser, visiting
from playwright.sync_api import Page, expect
from test_page_find import body_of
from test_page_measure import draw, field, opened

from subtense import Photo
from subtense.workflow.in_photo import Item, measure_items
from subtense.workflow.resolve_camera import resolve_camera
from subtense.workflow.tables import METHODS
from subtense.workflow.together import with_distances, with_fused

pytestmark = in_browser


def two(page: Page) -> None:
    """A and B, of known sizes."""
    for (first, last), size in ((((300, 300), (500, 340)), "200 ± 1 mm"), (((150, 480), (300, 520)), "400 ± 2 mm")):
        draw(page, "Known size", first, last)
        field(page).fill(size)
        expect(page.get_by_test_id("answer")).to_have_text(re.compile(r"\d"))
    page.keyboard.press("Escape")


def pick(page: Page, *labels: str) -> None:
    for label in labels:
        page.get_by_role("checkbox", name=f"Pick {label}", exact=True).check()


def row(page: Page, name: str):
    return page.locator(f"[data-together='{name}']")


def metres(text: str) -> float:
    value, unit = text.replace("\u202f", "").replace("! ", "").split()
    return float(value) * {"mm": 1e-3, "m": 1.0}[unit]


def of_python(examples, body: dict):
    """The document of a sheet as the page asks for it, without a server."""
    photo = Photo.load(examples / "desk.jpg")
    items = [Item(METHODS[one["method"]], one["inputs"], one["label"], judged=True) for one in body["items"]]
    document = measure_items(items, photo, resolve_camera(photo))
    for text in body.get("same", []):
        document = with_fused(document, text, draws=20_000)
    for text in body.get("between", []):
        document = with_distances(document, text, draws=20_000)
    return document


def test_the_distance_between_two_things_is_that_of_the_library(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    two(page)
    expect(page.get_by_role("group", name="Picked measurements")).to_contain_text("Tick two")
    pick(page, "A", "B")
    page.get_by_role("button", name="Distance A to B").click()
    expect(row(page, "A to B").locator("strong")).to_have_text(re.compile(r"\d"))
    shown = row(page, "A to B").locator("strong").inner_text()
    line = page.locator("[data-between='A to B']")
    expect(page.locator("[data-distance='A to B']")).to_contain_text(shown)
    expect(line.locator(".line")).to_have_css("stroke-dasharray", re.compile("9"))
    expect(page.get_by_test_id("together").get_by_test_id("answer")).to_have_text(shown)
    expect(page.get_by_test_id("together")).to_contain_text("farther than A")
    page.get_by_test_id("together").get_by_text("Why this uncertainty").click()
    expect(page.locator("table.budget")).to_contain_text("size")
    body = body_of(page)
    assert body["between"] == ["1,2"]
    length = next(m for m in of_python(examples, body).measurements if m.method == "between")
    assert metres(shown) == pytest.approx(length.value, abs=length.u / 10)
    page.get_by_role("button", name="Swap", exact=True).click()
    expect(row(page, "B to A").locator("strong")).to_have_text(shown)
    expect(page.get_by_test_id("together")).to_contain_text("nearer than B")


def test_it_follows_a_handle_and_is_grey_until_it_is_current(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    two(page)
    pick(page, "A", "B")
    page.locator("body").click(position={"x": 5, "y": 5})
    page.keyboard.press("d")
    line, caption = page.locator("[data-between='A to B']"), page.locator("[data-distance='A to B'] text").first
    expect(caption).to_contain_text(re.compile(r"\d"))
    value = caption.text_content()
    drawn = line.locator(".line").get_attribute("d")
    # what a page would show if the server took its time
    page.route("**/api/measure", lambda route: (page.wait_for_timeout(300), route.continue_()))
    handle = page.locator("[data-handle='A-ends-1']").bounding_box()
    box = page.get_by_test_id("stage").bounding_box()
    page.mouse.move(handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 600, box["y"] + 380, steps=3)
    expect(line).to_have_class(re.compile("stale"))
    assert line.locator(".line").get_attribute("d") != drawn  # the line itself never trails
    expect(line).not_to_have_class(re.compile("stale"))  # live: the handle is still held
    expect(caption).not_to_have_text(value)
    page.mouse.up()
    page.get_by_role("button", name="Undo").click()
    expect(caption).to_have_text(value)


def test_it_is_undone_kept_and_goes_with_what_it_is_between(visit, browser, server, examples, tmp_path):
    page = opened(visit, examples / "desk.jpg")
    two(page)
    pick(page, "A", "B")
    page.get_by_role("button", name="Distance A to B").click()
    expect(row(page, "A to B").locator("strong")).to_have_text(re.compile(r"\d"))
    shown = row(page, "A to B").locator("strong").inner_text()
    page.get_by_role("button", name="Undo").click()
    expect(row(page, "A to B")).to_have_count(0)
    page.get_by_role("button", name="Redo").click()
    expect(row(page, "A to B").locator("strong")).to_have_text(shown)
    page.get_by_role("button", name="Remove B", exact=True).click()
    expect(row(page, "A to B")).to_have_count(0)
    page.locator("body").click(position={"x": 5, "y": 5})
    page.keyboard.press("Control+z")
    expect(row(page, "A to B").locator("strong")).to_have_text(shown)
    row(page, "A to B").get_by_role("button", name="A to B", exact=True).click()
    page.keyboard.press("Delete")
    expect(row(page, "A to B")).to_have_count(0)
    expect(page.locator("[data-shape]")).to_have_count(2)
    page.keyboard.press("Control+z")
    expect(row(page, "A to B")).to_be_visible()
    page.wait_for_timeout(400)
    page.reload()
    expect(row(page, "A to B").locator("strong")).to_have_text(shown)
    page.locator("summary").filter(has_text="Save").click()
    with page.expect_download() as saved:
        page.get_by_role("button", name="Project with the pictures").click()
    (tmp_path / "p.json").write_bytes(saved.value.path().read_bytes())
    other = visiting(browser, server)
    again = other.open("/measure")
    again.locator("input[type=file]").last.set_input_files(tmp_path / "p.json")
    expect(row(again, "A to B").locator("strong")).to_have_text(shown)
    other.context.close()
    assert other.unexpected() == []


def test_reports_hold_it_whatever_the_measurements_are_called(visit, examples):
    """Names that are the same, or look like numbers, or of which one has no answer, must not lead to another distance."""
    visit.expected = "422"
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (60, 100), (160, 100))
    field(page).fill("two apples")
    two_named = (("B", "1"), ("C", "1"))
    for (first, last), size in ((((300, 300), (500, 340)), "200 ± 1 mm"), (((150, 480), (300, 520)), "400 ± 2 mm")):
        draw(page, "Known size", first, last)
        field(page).fill(size)
        expect(page.get_by_test_id("answer")).to_have_text(re.compile(r"\d"))
    pick(page, "B", "C")
    page.get_by_role("button", name="Distance B to C").click()
    expect(row(page, "B to C").locator("strong")).to_have_text(re.compile(r"\d"))
    shown = row(page, "B to C").locator("strong").inner_text()
    for label, name in two_named:
        page.locator("table.rows").get_by_role("button", name=label, exact=True).click()
        page.get_by_role("textbox", name="Name", exact=True).fill(name)
        page.keyboard.press("Tab")
    expect(row(page, "1 to 1").locator("strong")).to_have_text(shown)
    body = body_of(page)
    assert [one["label"] for one in body["items"]] == ["1", "1 (2)", "A"]
    document = of_python(examples, {**body, "items": body["items"][:2]})
    assert next(m for m in document.measurements if m.method == "between").value == pytest.approx(
        metres(shown), rel=0.01
    )
    page.locator("summary").filter(has_text="Save").click()
    with page.expect_download() as saved:
        page.get_by_role("button", name=re.compile("^text")).click()
    assert re.search(
        rf"1 to 1 \(2\).*{re.escape(shown.split()[0])}", saved.value.path().read_text().replace("\u202f", "")
    )


def test_one_thing_measured_twice_gives_one_number_and_a_doubt_where_both_disagree(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    two(page)
    pick(page, "A", "B")
    page.get_by_role("button", name="Same thing: one number").click()
    details = page.get_by_test_id("together")
    expect(details.get_by_test_id("answer")).to_have_text(re.compile(r"\d"))
    expect(row(page, "A and B")).to_contain_text("!")
    expect(details).to_contain_text("contradict each other")
    expect(details.locator("table.parts tr")).to_have_count(2)
    page.locator("table.rows").get_by_role("button", name="B", exact=True).click()
    field(page).fill("150 ± 1 mm")
    expect(row(page, "A and B")).not_to_contain_text("!")
    body = body_of(page)
    one = next(m for m in of_python(examples, body).measurements if m.method == "fuse")
    assert metres(row(page, "A and B").locator("strong").inner_text()) == pytest.approx(one.value, abs=one.u / 10)


def test_what_has_no_place_is_said_at_its_row(visit, examples):
    visit.expected = "422"
    page = opened(visit, examples / "desk.jpg")
    two(page)
    draw(page, "Same plane", (230, 250), (430, 250), (500, 400), (600, 420))
    page.get_by_test_id("details").get_by_label("Length of the reference").fill("210 mm")
    expect(page.locator("[data-shape=C]")).to_contain_text("mm")
    pick(page, "A", "C")
    page.get_by_role("button", name="Distance A to C").click()
    expect(row(page, "A to C").get_by_role("alert")).to_contain_text("Same plane gives no place")
    body = body_of(page)
    assert "between" not in body and len(body["items"]) == 3  # the report is not lost by it
    page.locator("table.rows").get_by_role("button", name="B", exact=True).click()
    field(page).fill("")
    pick(page, "A", "B")
    page.get_by_role("button", name="Distance A to B").click()
    expect(row(page, "A to B")).to_contain_text("needs B")


def test_three_picked_on_the_picture_give_their_distances(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    two(page)
    draw(page, "Known size", (550, 500), (640, 560))
    field(page).fill("100 mm")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile(r"\d"))
    for label in "AB":
        page.locator(f"[data-shape={label}] .caption").click(modifiers=["Shift"])
    for label in "ABC":
        expect(page.get_by_role("checkbox", name=f"Pick {label}")).to_be_checked()
    page.get_by_role("button", name="3 distances between them").click()
    for name in ("A to B", "A to C", "B to C"):
        expect(row(page, name).locator("strong")).to_have_text(re.compile(r"\d"))
    page.get_by_role("button", name="Undo").click()
    expect(page.locator("[data-together]")).to_have_count(0)


@pytest.mark.parametrize(("size", "theme"), [("desktop", "light"), ("phone", "dark")])
def test_by_touch_and_keys_and_open_to_all(browser, server, examples, size, theme, tmp_path):
    visit = visiting(browser, server, size, theme)
    page = opened(visit, examples / "desk.jpg")
    for (x, y), length in (((90, 90), "200 ± 1 mm"), ((200, 190), "400 ± 2 mm")):
        draw(page, "Known size", (x, y), (x + 80, y + 20))
        field(page).fill(length)
        expect(page.get_by_test_id("answer")).to_have_text(re.compile(r"\d"))
    if size == "phone":
        for label in "AB":
            page.get_by_role("checkbox", name=f"Pick {label}").tap()
        expect(page.locator(".stale")).to_have_count(0)
        found = Axe().run(page)
        assert found.violations_count == 0, found.generate_report()
        page.get_by_role("button", name="Distance A to B").tap()
    else:
        page.get_by_role("checkbox", name="Pick A").focus()
        page.keyboard.press("Space")
        page.get_by_role("checkbox", name="Pick B").focus()
        page.keyboard.press("Space")
        page.keyboard.press("d")
    expect(row(page, "A to B").locator("strong")).to_have_text(re.compile(r"\d"))
    expect(page.locator("[data-distance='A to B']")).to_be_in_viewport()
    page.locator("aside details").evaluate_all("all => all.forEach(one => one.open = true)")
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    assert page.evaluate("document.documentElement.scrollWidth") <= SIZES[size][0]
    page.screenshot(path=tmp_path / f"{size}.png")
    visit.context.close()
    assert visit.unexpected() == []
