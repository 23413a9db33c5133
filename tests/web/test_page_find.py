"""Finding things by themselves, and snapping to edges, in a real browser."""

import json
import re

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from browsing import SIZES, in_browser, visiting
from PIL import Image
from playwright.sync_api import Page, expect
from test_page_measure import at, draw, field, opened

from subtense import Photo
from subtense.workflow.detect import detect
from subtense.workflow.measure import measure_detections
from subtense.workflow.resolve_camera import resolve_camera
from subtense.workflow.tables import DETECTORS

pytestmark = in_browser
SHEET = [(394.4, 372.4), (747.8, 363.3), (757.8, 821.1), (294.7, 839.6)]
"""Corners of the sheet on the desk, px."""


def find(page: Page, button: str = "Find everything") -> None:
    """Search, and wait for what is found."""
    page.get_by_role("button", name="Find…").click()
    page.get_by_role("button", name=button).click()
    expect(page.get_by_test_id("find")).to_have_count(0, timeout=60_000)


def stage(page: Page, x: float, y: float) -> tuple[float, float]:
    """A place of the desk's picture as one of the stage."""
    box = page.get_by_test_id("stage").bounding_box()
    scale = min(box["width"] / 1600, box["height"] / 1200)
    return (box["width"] - 1600 * scale) / 2 + x * scale, (box["height"] - 1200 * scale) / 2 + y * scale


def body_of(page: Page) -> dict:
    """What the page asks the server when all is saved as JSON."""
    page.locator("summary").filter(has_text="Save").click()
    with page.expect_request(re.compile("measure.format=json")) as asked, page.expect_download():
        page.get_by_role("button", name=re.compile("^JSON")).click()
    return asked.value.post_data_json


def test_everything_is_found_listed_and_measured(visit, examples):
    """As `subtense measure` does it: the same things, the same distances, the assumption of their size beside them."""
    page = opened(visit, examples / "desk.jpg")
    find(page)
    photo = Photo.load(examples / "desk.jpg")
    found = detect(photo)
    expect(page.locator("[data-shape]")).to_have_count(len(found.detections))
    document = measure_detections(found, photo, resolve_camera(photo), sizes={})
    heads = {m.label: m for m in document.measurements if m.what == "range"}
    rows = page.locator("table.rows tbody")
    for one in found.detections:
        row = rows.filter(has=page.get_by_role("button", name=one.label, exact=True))
        if one.label in heads:
            expect(row.locator("strong")).to_have_text(re.compile("mm|m"))
            told, unit = row.locator("strong").inner_text().replace("\u202f", "").split()
            value = float(told) * {"mm": 1e-3, "m": 1.0}[unit]
            assert value == pytest.approx(heads[one.label].value, abs=heads[one.label].u / 5)
        if one.target is not None:
            expect(row).to_contain_text(one.target.title)
        else:
            expect(row.get_by_label(f"Real size of {one.label}")).to_be_visible()
    expect(page.get_by_role("status").filter(has_text="found")).to_contain_text(f"{len(found.detections)} found")
    page.get_by_role("button", name="Undo").click()
    expect(page.locator("[data-shape]")).to_have_count(0)  # one step


def test_a_size_that_is_missing_is_told_in_the_list(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    find(page, "Find ArUco and AprilTag markers")
    row = page.locator("table.rows tbody").filter(has_text="36h11 id 7")
    size = row.get_by_label("Real size of 36h11 id 7")
    visit.expected = "422"
    size.fill("fifty")
    page.keyboard.press("Tab")
    expect(row.get_by_role("alert")).to_contain_text("fifty")
    size.fill("50 ± 0.2 mm")
    page.keyboard.press("Tab")
    expect(row.locator("strong")).to_have_text(re.compile("mm"))
    expect(row).to_contain_text("50 mm")
    find(page, "Find ArUco and AprilTag markers")
    expect(page.locator("[data-shape]")).to_have_count(1)
    expect(page.get_by_role("status").filter(has_text="known already")).to_be_visible()


def two_markers(tmp_path) -> str:
    """A picture of two markers on white."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    pixels = np.full((500, 900), 255, np.uint8)
    for number, left in ((3, 100), (8, 550)):
        pixels[150:350, left : left + 200] = cv2.aruco.generateImageMarker(dictionary, number, 200)
    Image.fromarray(pixels).convert("RGB").save(tmp_path / "two.png")
    return tmp_path / "two.png"


@pytest.mark.opencv
def test_things_alike_get_the_size_of_one(visit, tmp_path):
    page = opened(visit, two_markers(tmp_path))
    page.get_by_text("Replace it").click()
    page.get_by_label("Camera as text").fill("f=900px")
    page.get_by_role("button", name="Use", exact=True).click()
    find(page, "Find ArUco and AprilTag markers")
    expect(page.locator("[data-shape]")).to_have_count(2)
    page.get_by_label(re.compile("Real size of .* 3$")).fill("100 mm")
    page.keyboard.press("Tab")
    page.get_by_role("button", name="same for 1 more").click()
    expect(page.locator("table.rows strong")).to_have_count(2)
    page.get_by_role("button", name="Undo").click()
    expect(page.locator("table.rows strong")).to_have_count(1)


def test_what_is_said_to_be_there_narrows_the_search(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    page.get_by_role("button", name="Find…").click()
    page.get_by_role("combobox", name="What is in the picture").fill("coffee cup")
    page.locator("#find-target-list").get_by_role("option").first.click()
    chips = page.get_by_role("list", name="Said to be there")
    expect(chips).to_contain_text(re.compile("cup", re.IGNORECASE))
    expect(page.get_by_role("button", name="Find ArUco and AprilTag markers")).to_be_disabled()
    with page.expect_request("**/api/jobs") as asked:
        page.get_by_role("button", name=re.compile("^Find .*cup", re.IGNORECASE)).first.click()
    assert asked.value.post_data_json["targets"] == ["cup"] and asked.value.post_data_json["detector"] == "all"
    expect(page.get_by_test_id("find")).to_have_count(0, timeout=60_000)
    expect(page.get_by_test_id("details")).not_to_contain_text("taken to be")
    page.get_by_role("button", name="Find…").click()
    expect(page.get_by_role("button", name="Find ArUco and AprilTag markers")).to_be_enabled()


def test_another_kind_can_be_chosen_and_moving_a_point_drops_what_was_seen(visit, examples):
    """Whatever detector gives `others`: the answer here is a made-up one, drawn and measured like any."""
    page = opened(visit, examples / "desk.jpg")
    seen = {
        "points_px": SHEET, "sigma_px": 0.3, "cov": None, "label": "sheet 1", "score": 0.9, "source": "made up", "detector": "sheets",
        "shape": "rectangle", "target": "a4", "others": ["letter"], "tilt": None, "method": "pose", "points_field": "points",
        "notes": [{"code": "assumed_size", "text": "its size is taken to be that of A4", "cure": "say what it is"}],
        "size_field": "target", "size": None, "size_prefix": "rectangle ", "size_text": None,
    }  # fmt: skip
    a4 = next(t for t in page.evaluate("fetch('/api/targets').then((a) => a.json())")["targets"] if t["name"] == "a4")
    seen["size_text"] = "rectangle " + a4["text"]
    asked = {"code": "not_searched", "text": "faces were not looked for", "cure": ""}
    job = {"id": "a" * 16, "kind": "detect all", "state": "done", "progress": 1, "doing": "", "error": None,
           "result": {"detections": [seen], "notes": [asked]}}  # fmt: skip
    page.route("**/api/jobs", lambda route: route.fulfill(status=202, json={**job, "state": "running", "result": None}))
    page.route(
        "**/api/jobs/*/events",
        lambda route: route.fulfill(content_type="text/event-stream", body=f"event: done\ndata: {json.dumps(job)}\n\n"),
    )
    find(page)
    expect(page.get_by_role("status").filter(has_text="1 found")).to_contain_text("faces were not looked for")
    details, row = page.get_by_test_id("details"), page.locator("table.rows tbody")
    expect(row).to_contain_text(re.compile("taken to be .*A4.*; or another", re.DOTALL))
    expect(details.get_by_role("list", name="Notes")).to_contain_text("taken to be that of A4")
    assert [note["code"] for note in body_of(page)["items"][0]["notes"]] == ["assumed_size"]
    before = page.get_by_test_id("answer").inner_text()
    details.get_by_label("What it is").select_option(index=2)
    expect(page.get_by_test_id("answer")).not_to_have_text(before)
    expect(details.get_by_role("list", name="Notes").filter(has_text="that of A4")).to_have_count(0)
    item = body_of(page)["items"][0]
    assert item["notes"] == [] and item["inputs"]["points"]["source"] == "made up"
    page.locator("[data-handle='sheet 1-points-0']").focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_timeout(800)
    item = body_of(page)["items"][0]
    assert "assumed" in item["inputs"]["points"]["source"] and item["inputs"]["points"]["sigma_px"] == 0.7
    page.reload()
    expect(page.locator("[data-shape='sheet 1']")).to_contain_text("mm")
    page.get_by_role("button", name="sheet 1", exact=True).click()
    expect(page.get_by_test_id("details").get_by_label("What it is")).to_be_visible()


def test_nothing_found_and_a_refusal_are_said(visit, tmp_path):
    Image.new("RGB", (300, 200), (128, 128, 128)).save(tmp_path / "blank.png")
    page = opened(visit, tmp_path / "blank.png")
    page.get_by_role("button", name="Find…").click()
    page.get_by_role("button", name="Find everything").click()
    expect(page.get_by_role("status").filter(has_text="Nothing found")).to_be_visible(timeout=60_000)
    visit.expected = "422"
    page.get_by_text("How it looks").click()
    page.get_by_label("transfer curve").fill("steep")
    page.get_by_role("button", name="Find everything").click()
    expect(page.get_by_test_id("find").get_by_role("alert")).to_contain_text("steep")
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("find")).to_have_count(0)


def test_every_detector_of_the_table_has_its_button(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    page.keyboard.press("f")
    expect(page.get_by_role("button", name="Find everything")).to_be_focused()
    panel = page.get_by_test_id("find")
    for row in DETECTORS.values():
        expect(panel.get_by_role("button", name=f"Find {row.title}", exact=True)).to_be_enabled()
        if row.asks:
            expect(panel.get_by_label(row.asks, exact=True)).to_be_visible()
    page.keyboard.press("Tab")
    for _ in range(2):  # on through the kinds, from the first
        page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.closest('[data-testid=find]') !== null")


# -- snapping --------------------------------------------------------------------------------------------


def test_what_is_set_goes_to_the_edges_and_can_be_put_back(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    page.keyboard.press("s")
    expect(page.get_by_role("button", name="Snap")).to_have_attribute("aria-pressed", "true")
    draw(
        page,
        "Rectangle",
        *(
            stage(page, x + dx, y + dy)
            for (x, y), (dx, dy) in zip(SHEET, ((3, 2), (-2, 3), (2, -3), (3, 2)), strict=True)
        ),
    )
    expect(page.get_by_test_id("details")).to_contain_text("Moved to the edges")
    moved = [at(page, "A", i) for i in range(4)]
    assert np.hypot(*(np.array(moved) - SHEET).T).max() < 0.5
    page.get_by_label("First side").fill("210 ± 1 mm")
    page.get_by_label("Second side").fill("297 ± 1 mm")
    expect(page.get_by_test_id("details").get_by_role("list", name="Notes")).to_contain_text("moved to edges")
    item = body_of(page)["items"][0]
    assert np.shape(item["inputs"]["points"]["cov"]) == (8, 8) and "snapped" in [note["code"] for note in item["notes"]]
    page.get_by_role("button", name="Put it back").click()
    assert np.hypot(*(np.array([at(page, "A", i) for i in range(4)]) - SHEET).T).min() > 1.5
    assert "cov" not in body_of(page)["items"][0]["inputs"]["points"]


def test_where_no_edge_is_near_the_points_stay(visit, tmp_path):
    visit.expected = "422"
    Image.new("RGB", (600, 400), (128, 128, 128)).save(tmp_path / "blank.png")
    page = opened(visit, tmp_path / "blank.png")
    page.get_by_role("button", name="Snap").click()
    draw(page, "Known size", (300, 300), (500, 340))
    expect(page.get_by_role("status").filter(has_text="Left where it was set")).to_be_visible()
    expect(page.get_by_test_id("details")).not_to_contain_text("Moved to the edges")


def test_a_dragged_end_snaps_again(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", stage(page, 349, 600), stage(page, 700, 600))
    field(page).fill("200 mm")
    page.get_by_role("button", name="Snap").click()
    handle = page.locator("[data-handle='A-ends-1']").bounding_box()
    page.mouse.move(handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2)
    page.mouse.down()
    box, (x, y) = page.get_by_test_id("stage").bounding_box(), stage(page, 749.5, 600)
    page.mouse.move(box["x"] + x, box["y"] + y, steps=4)
    page.mouse.up()
    expect(page.get_by_test_id("details")).to_contain_text("Moved to the edges")
    assert (at(page, "A", 0)[0], at(page, "A", 1)[0]) == pytest.approx((345.7, 753.0), abs=1.0)


# -- rims ------------------------------------------------------------------------------------------------


def test_a_disc_takes_as_many_points_as_one_likes(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    angles = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    points = [(400 + 90 * np.cos(a), 300 + 60 * np.sin(a)) for a in angles]
    draw(page, "Disc", *points, points[-1])
    expect(page.locator("[data-handle^='A-rim-']")).to_have_count(7)
    page.get_by_test_id("details").locator("#f-diameter").fill("80 ± 1 mm")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile("mm|m"))
    assert "C" in page.locator("[data-shape=A] path.line").get_attribute("d")  # drawn round


# -- outlines --------------------------------------------------------------------------------------------


def test_an_outline_by_a_box_or_a_click_is_measured_by_one_of_its_extents(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Outline", stage(page, 860, 680), stage(page, 1085, 825), drag=True)
    row = page.locator("table.rows tbody")
    row.get_by_label("Real size of A").fill("101.2 ± 0.5 mm")
    page.keyboard.press("Tab")
    expect(row.locator("strong")).to_have_text(re.compile("mm"))
    low, high = re.search(r"(\d+) to (\d+)", row.locator("td.number").inner_text()).groups()
    assert int(low) < 590 < int(high)
    extent = page.get_by_test_id("details").get_by_label("Which extent of the outline")
    expect(extent).to_have_value("longest")
    (x1, y1), (x2, y2) = at(page, "A", 0), at(page, "A", 1)
    assert np.hypot(x2 - x1, y2 - y1) == pytest.approx(212, abs=3)
    extent.select_option("width")
    expect(page.locator("[data-handle='A-ends-1']")).to_have_attribute("aria-label", re.compile(r"at 1\d+\.\d, 7"))
    (x1, _), (x2, _) = sorted((at(page, "A", 0), at(page, "A", 1)))
    assert (x1, x2) == pytest.approx((871.7, 1073.6), abs=2)
    page.locator("[data-handle='A-ends-0']").focus()
    page.keyboard.press("ArrowLeft")
    expect(extent).to_have_value("")
    expect(page.locator("[data-shape=A] path.contour")).to_be_visible()
    page.reload()
    expect(page.locator("[data-shape=A] path.contour")).to_be_visible()


def test_an_outline_of_nothing_says_so(visit, tmp_path):
    visit.expected = "422"
    Image.new("RGB", (600, 400), (128, 128, 128)).save(tmp_path / "blank.png")
    page = opened(visit, tmp_path / "blank.png")
    draw(page, "Outline", (400, 300))
    expect(page.get_by_role("status").filter(has_text="stands out")).to_be_visible()
    expect(page.locator("[data-shape]")).to_have_count(0)


@pytest.mark.parametrize(("size", "theme"), [("desktop", "dark"), ("phone", "light")])
def test_axe_finds_nothing_in_what_was_found(browser, server, examples, size, theme):
    visit = visiting(browser, server, size, theme)
    page = opened(visit, examples / "desk.jpg")
    find(page, "Find ArUco and AprilTag markers")
    page.get_by_role("button", name="Find…").click()
    page.get_by_role("combobox", name="What is in the picture").fill("cup")
    page.locator("#find-target-list").get_by_role("option").first.click()
    page.locator("aside details").evaluate_all("all => all.forEach(one => one.open = true)")
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    assert page.evaluate("document.documentElement.scrollWidth") <= SIZES[size][0]
    visit.context.close()
    assert visit.unexpected() == []
