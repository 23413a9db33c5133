"""The calculator as people use it, in a real browser."""

import json
import re
import subprocess
import sys

import pytest
from browsing import in_browser, visiting
from playwright.sync_api import expect

pytestmark = in_browser

BELT = "focal=35+mm&sensor_width=14.1+mm&image_width=4096&size=200+mm&extent=150"


def test_the_worked_examples_to_the_digit(visit):
    page = visit.open()
    expect(page.get_by_test_id("nominal")).to_have_text("13\u202f556.50 mm")
    expect(page.get_by_test_id("value")).to_have_text("13.56")
    expect(page.get_by_test_id("interval")).to_contain_text("13.07 to 14.09")
    page.get_by_role("button", name="Statue from a drone").click()
    expect(page.get_by_test_id("nominal")).to_have_text("232\u202f851.06 mm")
    for text in ("10 167.376", "290.496"):
        page.get_by_role("button", name="Package on a conveyor belt").click()
        expect(page.get_by_role("table").filter(has_text="Focal length in pixels")).to_contain_text(
            text.replace(" ", "\u202f")
        )


def test_typing_is_answered_at_once(visit):
    page = visit.open()
    page.get_by_label("Size in the picture", exact=False).first.wait_for()
    page.locator("#extent").fill("300")
    expect(page.get_by_test_id("nominal")).to_have_text("6\u202f778.25 mm")
    page.locator("#size").fill("400")
    expect(page.get_by_test_id("nominal")).to_have_text("13\u202f556.50 mm")
    page.get_by_label("Unit of Real size").select_option("cm")
    expect(page.locator("#size")).to_have_value("40")
    expect(page.get_by_test_id("nominal")).to_have_text("13\u202f556.50 mm")


@pytest.mark.parametrize(
    ("name", "value"),
    [("focal", "35"), ("sensor_width", "14.1"), ("image_width", "4096"), ("size", "200"), ("extent", "150")],
)
def test_any_field_can_be_the_unknown(visit, name, value):
    page = visit.open()
    expect(page.get_by_test_id("nominal")).to_have_text("13\u202f556.50 mm")
    page.locator(f".field:has(#{name}) input[type=radio]").check()
    expect(page.locator("#distance")).to_have_value("13.5565")
    solved = page.locator(f"output#{name}")
    expect(solved).to_have_text(re.compile(r"\d"))
    assert float(re.sub(r"[\s\u202f]", "", solved.inner_text())) == pytest.approx(float(value), rel=1e-5)


def test_an_uncertainty_can_be_stated(visit):
    page = visit.open()
    page.get_by_role("button", name="Uncertainty of Focal length").click()
    page.get_by_label("± of Focal length", exact=True).fill("0.1")
    expect(page.locator("table.budget")).to_contain_text("95 % interval")
    before = page.get_by_test_id("interval").inner_text()
    page.get_by_label("How the ± of Focal length is meant").select_option("limits")
    expect(page.get_by_test_id("interval")).not_to_have_text(before)
    page.get_by_label("How the ± of Focal length is meant").select_option("exact")
    expect(page.locator("table.budget")).not_to_contain_text("focal length")


def test_invalid_input_is_explained_at_its_field_and_blanks_nothing(visit):
    visit.expected = "422"
    page = visit.open()
    expect(page.get_by_test_id("value")).to_have_text("13.56")
    page.locator("#focal").fill("35 bananas")
    expect(page.locator("#focal-hint")).to_contain_text("give a length")
    expect(page.locator("#focal")).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_test_id("value")).to_have_text("13.56")
    page.locator("#focal").fill("-1")
    expect(page.locator("#focal-hint")).to_contain_text("above 0")
    page.locator("#focal").fill("")
    expect(page.locator(".result")).to_contain_text("Still needed: focal length")
    expect(page.get_by_test_id("value")).to_have_text("13.56")
    page.locator("#focal").fill("70")
    expect(page.get_by_test_id("nominal")).to_have_text("27\u202f113.00 mm")


def test_a_link_restores_everything(visit):
    page = visit.open(f"/#{BELT}&tilt=0+%C2%B1+20+deg+(limits)&along=height")
    expect(page.get_by_test_id("interval")).to_contain_text("12.59 to 13.95")
    expect(page.locator("#along")).to_have_value("height")
    page.locator("#extent").fill("151 ± 3")
    expect(page.get_by_test_id("nominal")).to_have_text("13\u202f466.72 mm")
    page.wait_for_timeout(400)
    link = page.evaluate("location.href")
    other = visit.context.new_page()
    other.goto(link)
    expect(other.get_by_test_id("nominal")).to_have_text("13\u202f466.72 mm")
    expect(other.locator("#tilt")).to_have_value("0")
    expect(other.get_by_label("± of Tilt of the object", exact=True)).to_have_value("20")


def test_the_point_of_the_chart_can_be_dragged_and_moved_by_keys(visit):
    page = visit.open()
    chart = page.get_by_role("slider")
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.75, box["y"] + 60, steps=5)
    page.mouse.up()
    page.evaluate(
        "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )  # moves are drawn late
    dragged = float(page.locator("#extent").input_value())
    assert 200 < dragged < 4000
    expect(page.get_by_test_id("nominal")).to_have_text(re.compile("mm"))
    chart.focus()
    page.keyboard.press("ArrowLeft")
    assert float(page.locator("#extent").input_value()) == pytest.approx(dragged / 1.02, rel=1e-3)
    expected = 35 / 14.1 * 4096 * 200 / float(page.locator("#extent").input_value())
    expect(page.get_by_test_id("nominal")).to_have_text(f"{expected:,.2f} mm".replace(",", "\u202f"))


def test_the_drawing_moves_with_the_numbers(visit):
    page = visit.open()
    ray = page.get_by_label("The two triangles").locator("path.ray")
    before = ray.get_attribute("d")
    page.locator("#size").fill("3000")
    expect(ray).not_to_have_attribute("d", before)
    expect(page.get_by_label("The two triangles").get_by_role("img")).to_have_attribute("aria-label", re.compile("3 m"))


def test_presets_are_found_by_typing(visit):
    page = visit.open()
    page.get_by_role("combobox", name="Camera class or sensor").fill("smart")
    expect(page.locator("#preset-list").get_by_role("option")).to_contain_text("smartphone")
    page.keyboard.press("Enter")
    expect(page.locator("#focal")).to_have_value("5")
    expect(page.get_by_label("± of Focal length", exact=True)).to_have_value("1")
    page.get_by_role("combobox", name="Camera class or sensor").fill("2/3")
    page.locator("#preset-list").get_by_role("option").first.click()
    expect(page.locator("#sensor_width")).to_have_value(re.compile(r"^8\.\d+$"))


def test_the_camera_is_read_from_a_photo(visit, examples):
    page = visit.open()
    page.set_input_files("input[type=file]", examples / "street.jpg")
    expect(page.locator("#image_width")).to_have_value("1800")
    expect(page.locator("#focal")).to_have_value("24")
    expect(page.locator("table.budget")).to_contain_text("sensor width")


def test_history_and_reset(visit):
    page = visit.open()
    page.locator("#extent").fill("75")
    expect(page.locator(".history")).to_contain_text("27", timeout=5000)
    page.get_by_role("button", name="Reset").click()
    expect(page.get_by_test_id("value")).to_have_text("13.56")
    page.locator(".history button").filter(has_text="27").first.click()
    expect(page.locator("#extent")).to_have_value("75")
    page.reload()
    expect(page.locator(".history")).to_contain_text("27")


def test_the_result_can_be_taken_along(visit, tmp_path):
    page = visit.open()
    expect(page.get_by_test_id("value")).to_have_text("13.56")

    def copied(name: str) -> str:
        page.get_by_role("button", name=name, exact=True).click()
        expect(page.locator(".actions [role=status]")).to_contain_text("copied")
        text = page.evaluate("navigator.clipboard.readText()")
        expect(page.locator(".actions [role=status]")).to_have_text("", timeout=5000)
        return text

    assert "13 556.50 mm" in copied("text")
    assert json.loads(copied("JSON"))["measurements"][0]["value"] == pytest.approx(13.5565012, rel=1e-7)
    program = subprocess.run([sys.executable, "-c", copied("Python")], capture_output=True, text=True, check=True)
    assert "13.5565" in program.stdout
    words = copied("command line")
    assert words.startswith("subtense calc ") and "--focal '35 mm'" in words
    assert copied("link").endswith(page.evaluate("location.hash"))
    with page.expect_download() as saved:
        page.get_by_role("button", name="PDF report").click()
    assert saved.value.path().read_bytes().startswith(b"%PDF")


def test_by_keyboard_alone(visit):
    page = visit.open()
    expect(page.get_by_test_id("value")).to_have_text("13.56")
    for _ in range(40):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "extent":
            break
    page.keyboard.press("Control+a")
    page.keyboard.type("300")
    expect(page.get_by_test_id("nominal")).to_have_text("6\u202f778.25 mm")
    page.locator(".field:has(#distance) input[type=radio]").focus()
    page.keyboard.press("ArrowUp")
    expect(page.locator("output#extent")).to_be_visible()


def test_imperial_units_and_themes_are_kept(visit):
    page = visit.open()
    page.get_by_label("Units of results").select_option("imperial")
    expect(page.locator(".big .unit")).to_have_text(" ft")
    page.get_by_role("button", name="Theme").click()
    page.get_by_role("button", name="Theme").click()
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"
    page.reload()
    expect(page.locator(".big .unit")).to_have_text(" ft")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(18, 20, 23)"


def test_a_phone_shows_the_result_while_typing(browser, server):
    visit = visiting(browser, server, "phone")
    page = visit.open()
    page.locator("#focal").fill("50")
    bar = page.locator("div.bar")
    expect(bar).to_contain_text("19.37")
    box = bar.bounding_box()
    assert box["y"] + box["height"] == pytest.approx(800, abs=1)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    visit.context.close()
    assert visit.unexpected() == []
