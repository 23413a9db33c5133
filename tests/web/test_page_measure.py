"""Measuring in a photo as people do it, in a real browser."""

import io
import json
import re
import zlib

import numpy as np
import pytest
from browsing import in_browser, visiting
from PIL import Image
from playwright.sync_api import Page, expect
from running import picture, serving, until

from subtense import Photo
from subtense.workflow.measure_input import measure_document

pytestmark = in_browser

HANDLE = re.compile(r"at ([-\d.]+), ([-\d.]+) px")


def opened(visit, *files) -> Page:
    page = visit.open("/measure")
    page.locator("input[type=file]").first.set_input_files(list(files))
    expect(page.get_by_test_id("stage").locator("canvas").first).to_be_visible()
    expect(page.locator("[aria-labelledby=camera-title]")).to_contain_text(re.compile("px|camera"))
    page.wait_for_timeout(300)
    return page


def at(page: Page, label: str, index: int = 0) -> tuple[float, float]:
    """Where an end stands in the picture."""
    text = page.locator(f"[data-handle^='{label}-'][data-handle$='-{index}']").first.get_attribute("aria-label")
    return tuple(float(x) for x in HANDLE.search(text).groups())


def draw(page: Page, tool: str, *points: tuple[float, float], drag: bool = False) -> None:
    """Use a tool at places of the stage."""
    button = page.get_by_role("button", name=tool, exact=True)
    if not button.is_visible():
        page.locator("summary").filter(has_text="More").click()
    button.click()
    box = page.get_by_test_id("stage").bounding_box()
    for i, (x, y) in enumerate(points):
        page.mouse.move(box["x"] + x, box["y"] + y)
        if drag and i % 2 == 0:
            page.mouse.down()
        elif drag:
            page.mouse.move(box["x"] + x, box["y"] + y, steps=4)
            page.mouse.up()
        else:
            page.mouse.down()
            page.mouse.up()


def field(page: Page, name: str = "Real size"):
    return page.get_by_test_id("details").get_by_label(name, exact=True)


def test_a_line_of_known_size_is_that_of_the_command_line(visit, examples):
    page = opened(visit, examples / "belt.jpg")
    draw(page, "Known size", (200, 300), (420, 320))
    expect(field(page)).to_be_focused()
    page.keyboard.type("200 ± 1 mm")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile(r"\d"))
    page.wait_for_timeout(300)
    ends = ",".join(f"{c}" for i in (0, 1) for c in at(page, "A", i))
    photo = Photo.load(examples / "belt.jpg")
    m = measure_document(photo, lines=[f"{ends} ± 1.372px"], sizes=["200 ± 1 mm"]).measurements[0]
    shown = float(page.get_by_test_id("answer").inner_text().split()[0].replace("\u202f", ""))
    unit = {"mm": 1e-3, "m": 1.0}[page.get_by_test_id("answer").inner_text().split()[-1]]
    assert shown * unit == pytest.approx(m.value, abs=m.u / 10)
    page.get_by_text("Why this uncertainty").click()
    expect(page.locator("table.budget")).to_contain_text("tilt")


def test_drawing_by_drag_and_by_keys_and_the_other_tools(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known distance", (300, 300), (500, 340), drag=True)
    page.keyboard.type("0.7 m")
    expect(page.get_by_test_id("answer")).to_contain_text("mm")
    draw(page, "Same plane", (230, 250), (430, 250), (500, 400), (600, 420))
    expect(field(page, "Length of the reference")).to_be_focused()
    page.keyboard.type("210 mm")
    expect(page.locator("[data-shape=B]")).to_contain_text("mm")
    page.locator("body").click(position={"x": 5, "y": 5})
    page.keyboard.press("1")
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("Enter")
    for _ in range(9):
        page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("Enter")
    (x1, y1), (x2, y2) = at(page, "C", 0), at(page, "C", 1)
    assert (x2 - x1, y2 - y1) == (90, 0)


def test_a_rectangle_names_its_sides(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Rectangle", (229, 240), (436, 238), (442, 607), (173, 617))
    page.get_by_role("combobox", name="Known rectangles").fill("a4")
    page.locator("#target-target-list").get_by_role("option").filter(has_text="A4").first.click()
    expect(page.get_by_test_id("answer")).to_have_text(re.compile("mm|m"))
    before = page.locator("[data-shape=A] .side").all_text_contents()
    page.get_by_role("button", name="Swap sides").click()
    page.wait_for_timeout(200)
    assert (
        page.locator("[data-shape=A] .side").all_text_contents() == before
    )  # the texts stay, the edges they stand at change
    assert {text.split()[0] for text in before if text} == {"297", "210"}


def test_a_handle_stays_under_the_pointer(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (300, 300), (500, 340))
    page.keyboard.type("200 mm")
    box = page.get_by_test_id("stage").bounding_box()
    handle = page.locator("[data-handle='A-ends-1']")
    page.mouse.move(box["x"] + 500, box["y"] + 340)
    page.mouse.down()
    for x, y in ((520, 300), (610, 420), (333, 222)):
        page.mouse.move(box["x"] + x, box["y"] + y)
        spot = handle.bounding_box()
        assert spot["x"] + spot["width"] / 2 == pytest.approx(box["x"] + x, abs=0.6)
        assert spot["y"] + spot["height"] / 2 == pytest.approx(box["y"] + y, abs=0.6)
    expect(page.locator(".loupe canvas")).to_be_visible()
    page.mouse.up()
    expect(page.locator(".loupe")).to_have_count(0)


def test_undo_and_redo_take_whole_steps(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (300, 300), (500, 340))
    page.keyboard.type("200 mm")
    page.keyboard.press("Tab")
    box = page.get_by_test_id("stage").bounding_box()
    first = at(page, "A", 1)
    page.mouse.move(box["x"] + 500, box["y"] + 340)
    page.mouse.down()
    page.mouse.move(box["x"] + 600, box["y"] + 400, steps=8)
    page.mouse.up()
    moved = at(page, "A", 1)
    assert moved != first
    page.get_by_role("button", name="Undo").click()
    assert at(page, "A", 1) == first
    page.get_by_role("button", name="Redo").click()
    assert at(page, "A", 1) == moved
    page.locator("[data-handle='A-ends-1']").focus()
    page.keyboard.press("Delete")
    expect(page.locator("[data-shape]")).to_have_count(0)
    page.keyboard.press("Control+z")
    expect(page.locator("[data-shape=A]")).to_contain_text("mm")


def test_arrows_move_an_end_by_one_ten_and_a_tenth(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (300, 300), (500, 340))
    page.keyboard.press("Escape")
    page.locator("[data-handle='A-ends-0']").focus()
    x, y = at(page, "A")
    for key, dx, dy in (("ArrowRight", 1, 0), ("Shift+ArrowDown", 0, 10), ("Alt+ArrowLeft", -0.1, 0)):
        page.keyboard.press(key)
        x, y = x + dx, y + dy
        assert at(page, "A") == pytest.approx((x, y), abs=0.051)
    page.keyboard.press("Tab")
    assert "ends 2" in page.evaluate("document.activeElement.getAttribute('aria-label')")


def test_shift_holds_the_direction(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    page.get_by_role("button", name="Known size", exact=True).click()
    box = page.get_by_test_id("stage").bounding_box()
    page.mouse.click(box["x"] + 300, box["y"] + 300)
    page.keyboard.down("Shift")
    page.mouse.move(box["x"] + 500, box["y"] + 320)
    page.mouse.down()
    page.mouse.move(box["x"] + 520, box["y"] + 321, steps=3)
    page.mouse.up()
    page.keyboard.up("Shift")
    assert at(page, "A", 0)[1] == pytest.approx(at(page, "A", 1)[1], abs=0.02)


def test_the_wheel_keeps_the_place_under_the_mouse(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (400, 300), (500, 340))
    handle = page.locator("[data-handle='A-ends-0']")
    before = handle.bounding_box()
    place = (round(before["x"] + before["width"] / 2), round(before["y"] + before["height"] / 2))
    page.mouse.move(*place)
    page.mouse.wheel(0, -300)
    page.wait_for_timeout(700)
    after = handle.bounding_box()
    assert after["x"] + after["width"] / 2 == pytest.approx(place[0], abs=2)
    assert after["y"] + after["height"] / 2 == pytest.approx(place[1], abs=2)
    other = page.locator("[data-handle='A-ends-1']").bounding_box()
    assert abs(other["x"] - after["x"]) > 115  # 100 before: it did zoom
    page.keyboard.press("Escape")
    page.keyboard.press("0")
    page.wait_for_timeout(700)
    assert handle.bounding_box()["x"] == pytest.approx(before["x"], abs=1)


def test_nothing_is_lost_by_a_reload(visit, examples):
    page = opened(visit, examples / "desk.jpg", examples / "street.jpg")
    expect(page.locator(".tab")).to_have_count(2)
    page.get_by_role("button", name="desk.jpg", exact=True).click()
    draw(page, "Known size", (300, 300), (500, 340))
    page.keyboard.type("200 mm")
    expect(page.get_by_test_id("answer")).to_have_text("698\u00a0mm")
    value, place = page.get_by_test_id("answer").inner_text(), at(page, "A")
    page.wait_for_timeout(400)
    page.reload()
    expect(page.locator("[data-shape=A]")).to_contain_text(value)
    assert at(page, "A") == place
    expect(page.locator(".tab")).to_have_count(2)


def test_the_server_may_be_stopped_and_started_again(browser, examples, tmp_path):
    with serving(tmp_path / "one") as first:
        visit = visiting(browser, first)
        visit.expected = "ERR_CONNECTION_REFUSED|404|ERR_EMPTY|ERR_CONNECTION_RESET"
        page = opened(visit, examples / "desk.jpg")
        draw(page, "Known size", (300, 300), (500, 340))
        page.keyboard.type("200 mm")
        expect(page.get_by_test_id("answer")).to_have_text(re.compile("mm"))
        value = page.get_by_test_id("answer").inner_text()
        first.stop()
        field(page).fill("400 mm")
        expect(page.get_by_role("alert")).to_contain_text("does not answer")
        with serving(tmp_path / "two", port=first.port, state=tmp_path / "one" / "state"):
            expect(page.get_by_role("alert")).to_have_count(0, timeout=15_000)
            expect(page.get_by_test_id("answer")).not_to_have_text(value, timeout=15_000)
            visit.context.close()
    assert visit.unexpected() == []


def test_markers_are_found(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    page.get_by_role("button", name="Find…").click()
    page.get_by_label("side of the markers' black square").fill("50 ± 0.2 mm")
    page.get_by_role("button", name="Find ArUco and AprilTag markers").click()
    expect(page.get_by_test_id("details")).to_contain_text("36h11 id 7", timeout=20_000)
    photo = Photo.load(examples / "desk.jpg")
    m = measure_document(photo, marker_size="50 ± 0.2 mm").measurements[0]
    assert float(page.get_by_test_id("answer").inner_text().split()[0]) == pytest.approx(m.value * 1000, abs=m.u * 100)


def test_a_search_can_be_cancelled(visit, server, tmp_path):
    (tmp_path / "big.jpg").write_bytes(picture(6000, 4000, "JPEG"))
    page = opened(visit, tmp_path / "big.jpg")
    page.keyboard.press("f")
    page.get_by_role("button", name="Find ArUco and AprilTag markers").click()
    expect(page.get_by_role("progressbar")).to_be_visible()
    expect(page.get_by_role("status").filter(has_text="Looking for ArUco and AprilTag markers")).to_be_visible()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("status").filter(has_text="ended")).to_be_visible()
    assert until(lambda: not server.children())


def test_a_broken_picture_is_explained(visit, tmp_path):
    visit.expected = "422"
    (tmp_path / "broken.jpg").write_bytes(picture(640, 480, "JPEG")[:3000])
    page = visit.open("/measure")
    page.locator("input[type=file]").first.set_input_files(tmp_path / "broken.jpg")
    expect(page.get_by_role("alert")).to_contain_text("broken.jpg")
    expect(page.get_by_role("alert")).to_contain_text("cut or damaged")


def test_a_picture_of_fifty_million_pixels(visit, tmp_path):
    """A flat PNG of 8660 x 5773, written without holding it."""
    wide, high = 8660, 5773
    row = b"\0" + bytes(
        np.tile(np.arange(0, 256, 2, dtype=np.uint8), 203)[: 3 * wide // 3 * 3]
        .tobytes()
        .ljust(3 * wide, b"\x80")[: 3 * wide]
    )
    data = zlib.compress(row * high, 1)

    def chunk(kind: bytes, body: bytes) -> bytes:
        return len(body).to_bytes(4, "big") + kind + body + zlib.crc32(kind + body).to_bytes(4, "big")

    head = wide.to_bytes(4, "big") + high.to_bytes(4, "big") + bytes([8, 2, 0, 0, 0])
    path = tmp_path / "large.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b""))
    page = visit.open("/measure")
    page.locator("input[type=file]").first.set_input_files(path)
    expect(page.get_by_test_id("stage").locator("canvas").first).to_be_visible(timeout=20_000)
    page.wait_for_timeout(500)
    draw(page, "Known distance", (300, 300), (500, 340))
    page.get_by_text("Replace it").click()
    page.get_by_label("Camera as text").fill("fov=70deg")
    page.get_by_role("button", name="Use", exact=True).click()
    field(page, "Distance to its middle").fill("10 m")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile("m"))


def test_the_camera_can_be_replaced(visit, examples, tmp_path):
    page = opened(visit, examples / "desk.jpg")
    card = page.locator("[aria-labelledby=camera-title]")
    expect(card).to_contain_text("EXIF")
    card.get_by_text("Replace it").click()
    card.get_by_label("Camera as text").fill("f=1300px")
    card.get_by_role("button", name="Use", exact=True).click()
    expect(card).to_contain_text("1\u202f300")
    calibration = {"width_px": 1600, "height_px": 1200, "f_px": 1250.0, "cx_px": 799.5, "cy_px": 599.5}
    (tmp_path / "calibration.json").write_text(json.dumps(calibration))
    card.locator("input[type=file]").set_input_files(tmp_path / "calibration.json")
    expect(card).to_contain_text("1\u202f250")
    card.get_by_role("combobox").fill("aps-c")
    page.locator("#camera-preset-list").get_by_role("option").first.click()
    expect(card).to_contain_text("preset")
    card.get_by_role("button", name="use the photo's own").click()
    expect(card).to_contain_text("EXIF")
    visit.expected = "422"
    card.get_by_label("Camera as text").fill("/etc/passwd")
    card.get_by_role("button", name="Use", exact=True).click()
    expect(card.get_by_role("alert")).to_contain_text("known are")


def test_a_project_with_and_without_its_picture(visit, browser, server, examples, tmp_path):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (300, 300), (500, 340))
    page.keyboard.type("200 mm")
    expect(page.get_by_test_id("answer")).to_have_text("698\u00a0mm")
    value = page.get_by_test_id("answer").inner_text()
    for name, whole in (("Project with the pictures", True), ("Project with their hashes", False)):
        page.locator("summary").filter(has_text="Save").click()
        with page.expect_download() as saved:
            page.get_by_role("button", name=name).click()
        project = json.loads(saved.value.path().read_text())
        assert ("data" in project["sheets"][0]) is whole
        path = tmp_path / f"{whole}.json"
        path.write_text(json.dumps(project))
        server.client.delete(f"/api/photos/{project['sheets'][0]['photo']['sha256'][:32]}")
        other = visiting(browser, server)
        other.expected = "404"
        reopened = other.open("/measure")
        reopened.locator("input[type=file]").last.set_input_files(path)
        if not whole:
            reopened.get_by_text("Choose desk.jpg").locator("input").set_input_files(examples / "desk.jpg")
        expect(reopened.locator("[data-shape=A]")).to_contain_text(value)
        other.context.close()
        assert other.unexpected() == []
    (tmp_path / "no.json").write_text('{"schema": "other"}')
    page.locator("input[type=file]").first.set_input_files(tmp_path / "no.json")
    expect(page.get_by_role("alert")).to_contain_text("not a project of subtense")


def test_reports_can_be_saved(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (300, 300), (500, 340))
    page.keyboard.type("200 mm")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile("mm"))
    begins = {
        "text": b"desk.jpg",
        "JSON": b"{",
        "CSV table": b"photo,",
        "PDF report": b"%PDF",
        "annotated picture": b"\x89PNG",
    }
    for name, start in begins.items():
        page.locator("summary").filter(has_text="Save").click()
        with page.expect_download() as saved:
            page.get_by_role("button", name=re.compile(f"^{name}")).click()
        content = saved.value.path().read_bytes()
        assert content.startswith(start)
        assert saved.value.suggested_filename.startswith("desk.")
    assert Image.open(io.BytesIO(content)).size == (1600, 1200)


def test_names_of_strangers_stay_text(visit, examples, tmp_path):
    name = "<img src=x onerror=alert(1)>.jpg"
    (tmp_path / name).write_bytes((examples / "desk.jpg").read_bytes())
    page = opened(visit, tmp_path / name)
    expect(page.locator(".tab")).to_contain_text(name)
    draw(page, "Known size", (300, 300), (500, 340))
    page.get_by_role("textbox", name="Name", exact=True).fill("<b>bold</b>")
    page.keyboard.press("Tab")
    expect(page.locator("table.rows")).to_contain_text("<b>bold</b>")
    assert page.locator("b").count() == 0


def test_wrong_input_is_explained_at_its_field(visit, examples):
    visit.expected = "422"
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (300, 300), (500, 340))
    field(page).fill("two apples")
    expect(page.get_by_test_id("details").get_by_role("alert")).to_contain_text("give a length")
    expect(field(page)).to_have_attribute("aria-invalid", "true")
    field(page).fill("20 cm")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile("mm"))


def test_photos_named_on_the_command_line_are_there(browser, examples, tmp_path):
    with serving(tmp_path, str(examples / "desk.jpg"), str(examples / "belt.jpg")) as server:
        visit = visiting(browser, server)
        page = visit.open("/measure")
        expect(page.locator(".tab")).to_have_count(2)
        expect(page.get_by_test_id("stage").locator("canvas").first).to_be_visible()
        visit.context.close()
        assert visit.unexpected() == []


def test_help_opens_by_its_key(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_contain_text("Ctrl+Z")
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)


def test_two_fingers_zoom(browser, server, examples):
    visit = visiting(browser, server, "phone")
    page = opened(visit, examples / "desk.jpg")
    page.get_by_role("button", name="Known size", exact=True).click()
    box = page.get_by_test_id("stage").bounding_box()
    for x in (150, 230):
        page.touchscreen.tap(box["x"] + x, box["y"] + 150)
        page.wait_for_timeout(100)
    first, second = page.locator("[data-handle='A-ends-0']"), page.locator("[data-handle='A-ends-1']")
    before = second.bounding_box()["x"] - first.bounding_box()["x"]
    session = visit.context.new_cdp_session(page)

    def touch(kind: str, apart: float) -> None:
        points = (
            []
            if kind == "touchEnd"
            else [{"x": 190 - apart, "y": box["y"] + 90, "id": 0}, {"x": 190 + apart, "y": box["y"] + 90, "id": 1}]
        )
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", 30)
    for step in range(10):
        touch("touchMove", 30 + 5 * step)
        page.wait_for_timeout(20)
    touch("touchEnd", 0)
    page.wait_for_timeout(600)
    assert second.bounding_box()["x"] - first.bounding_box()["x"] > 1.5 * before
    visit.context.close()
    assert visit.unexpected() == []


def test_what_is_typed_stays_with_its_measurement(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    for y, size in ((250, "50 mm"), (420, "60 mm")):
        draw(page, "Known size", (300, y), (500, y + 20))
        field(page).fill(size)
        expect(page.get_by_test_id("answer")).to_have_text(re.compile("mm"))
    field(page).fill("77")
    handle = page.locator("[data-handle='A-ends-0']").bounding_box()
    page.mouse.click(handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2)
    expect(field(page)).to_have_value("50 mm")
    page.wait_for_timeout(600)
    expect(field(page)).to_have_value("50 mm")
    page.locator("table.rows").get_by_role("button", name="B", exact=True).click()
    expect(field(page)).to_have_value("77")


def test_an_end_whose_doubt_can_not_be_read_has_no_answer(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    draw(page, "Known size", (300, 300), (500, 340))
    field(page).fill("200 mm")
    expect(page.get_by_test_id("answer")).to_have_text("698\u00a0mm")
    sigma = page.get_by_label("Each end is known to")
    for text in ("-1", "abc", "1e400", "0"):
        sigma.fill(text)
        expect(page.get_by_test_id("details").get_by_role("alert")).to_contain_text("pixels above 0")
    sigma.fill("5 px")
    expect(page.get_by_test_id("answer")).to_have_text(re.compile("69"))
    expect(page.get_by_test_id("details")).to_contain_text("95 % 6")


def test_a_photo_of_the_command_line_is_in_the_project_and_survives_it(browser, examples, tmp_path):
    with serving(tmp_path / "one", str(examples / "desk.jpg")) as first:
        visit = visiting(browser, first)
        visit.expected = "ERR_CONNECTION|404|ERR_EMPTY"
        page = visit.open("/measure")
        expect(page.get_by_test_id("stage").locator("canvas").first).to_be_visible()
        page.wait_for_timeout(800)
        draw(page, "Known size", (300, 300), (500, 340))
        field(page).fill("200 mm")
        expect(page.get_by_test_id("answer")).to_have_text("698\u00a0mm")
        page.locator("summary").filter(has_text="Save").click()
        with page.expect_download() as saved:
            page.get_by_role("button", name="Project with the pictures").click()
        assert "data" in json.loads(saved.value.path().read_text())["sheets"][0]
        first.stop()
        with serving(tmp_path / "two", port=first.port, state=tmp_path / "one" / "state"):
            page.wait_for_timeout(1500)
            field(page).fill("400 mm")
            expect(page.get_by_test_id("answer")).to_have_text(re.compile(r"1\.\d+"), timeout=15_000)
            visit.context.close()


def test_two_tabs_share_one_session(visit, examples):
    page = opened(visit, examples / "desk.jpg")
    other = visit.open("/measure")
    expect(other.get_by_test_id("stage").locator("canvas").first).to_be_visible()
    draw(page, "Known size", (300, 300), (500, 340))
    expect(other.locator("[data-shape=A]")).to_be_visible()
    other.wait_for_timeout(300)
    draw(other, "Known size", (300, 400), (500, 440))
    expect(page.locator("[data-shape=B]")).to_be_visible()
