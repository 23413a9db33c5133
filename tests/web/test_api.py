"""What the routes do: the same numbers as the command line, photos and their tiles, searches as jobs."""

import io
import json
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator
from PIL import Image, ImageFilter
from running import picture, serving, until
from test_decode import dng, heic

from subtense.cli import main
from subtense.photo import Photo
from subtense.targets import targets
from subtense.web.children import ChildError
from subtense.web.problems import problem_of
from subtense.workflow.report_of import REPORTS
from subtense.workflow.tables import DETECTORS, METHODS

CALC = {"focal": "35", "sensor_width": "14.1", "image_width": "4096", "size": "200", "extent": "150"}


def printed(*words) -> dict:
    result = CliRunner().invoke(main, [*map(str, words), "--format", "json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.output)


def error(answer, status=422) -> dict:
    assert answer.status_code == status, answer.text
    found = answer.json()["error"]
    assert set(found) >= {"type", "name", "message"} and "\n" not in found["message"]
    return found


@pytest.fixture(scope="module")
def desk(server, examples) -> dict:
    return server.photo((examples / "desk.jpg").read_bytes(), "desk.jpg")


# -- tables and numbers ----------------------------------------------------------------------------------


def test_the_tables_are_those_of_the_house(server):
    found = server.client.get("/api/methods").json()
    assert [m["name"] for m in found["methods"]] == list(METHODS)
    assert [d["name"] for d in found["detectors"]] == list(DETECTORS)
    assert [r["name"] for r in found["reports"]] == list(REPORTS)
    assert found["units"]["mm"] == {"unit": "m", "factor": 0.001}


@pytest.mark.parametrize("name", METHODS)
def test_the_example_of_every_method_fits_its_schema_and_is_measured(server, name):
    method = next(m for m in server.client.get("/api/methods").json()["methods"] if m["name"] == name)
    Draft202012Validator.check_schema(method["inputs"])
    Draft202012Validator(method["inputs"]).validate({k: v for k, v in method["example"].items() if v is not None})
    answer = server.client.post(f"/api/measure/{name}", json={"inputs": method["example"]})
    assert answer.status_code == 200, answer.text
    found = answer.json()["measurements"]
    assert [m["what"] for m in found] == [o["what"] for o in method["outputs"]]
    again = server.client.post(f"/api/measure/{name}", json={"inputs": found[0]["given"]}).json()["measurements"]
    assert [(m["value"], m["low"], m["high"]) for m in again] == [(m["value"], m["low"], m["high"]) for m in found]


@pytest.mark.parametrize("name", METHODS)
def test_a_method_gives_what_the_command_line_prints(server, tmp_path, name):
    from subtense.workflow.given import given

    inputs = given(METHODS[name].example())
    (tmp_path / "inputs.json").write_text(json.dumps(inputs))
    expected = printed("method", name, "--inputs", tmp_path / "inputs.json", "--level", "0.9", "--seed", "3")
    assert (
        server.client.post(f"/api/measure/{name}", json={"inputs": inputs, "level": 0.9, "seed": 3}).json() == expected
    )


@pytest.mark.parametrize(
    "said",
    [CALC, {"preset": "smartphone", "size": "1.75m", "distance": "3m"}, {**CALC, "extent": "150 ± 2", "along": "width", "tilt": "10"},
     {**CALC, "extent": None, "distance": "5 m"}, {**CALC, "focal": None, "distance": "5 m", "offset": "300,-120"}],
)  # fmt: skip
def test_a_calculation_is_what_the_command_line_prints(server, said):
    words = [word for name, text in said.items() if text for word in (f"--{name.replace('_', '-')}", text)]
    answer = server.client.post("/api/calc", json=said)
    assert answer.json() == printed("calc", *words)
    assert answer.headers["content-type"] == "application/json"


def test_an_empty_field_is_one_that_is_left_out(server):
    assert server.client.post("/api/calc", json={**CALC, "distance": ""}).json() == printed(
        "calc", *[word for name, text in CALC.items() for word in (f"--{name.replace('_', '-')}", text)]
    )


@pytest.mark.parametrize("form", ["json", "text", "csv", "pdf"])
def test_a_calculation_as_every_report(server, form):
    answer = server.client.post(f"/api/calc?format={form}", json=CALC)
    assert answer.status_code == 200 and answer.headers["content-type"] == REPORTS[form].media_type
    begins = {"json": b"{", "text": b"", "csv": b"", "pdf": b"%PDF-"}[form]
    assert answer.content.startswith(begins) and len(answer.content) > 200
    as_file = answer.headers.get("content-disposition", "")
    assert (f'filename="subtense{REPORTS[form].suffix}"' in as_file) == (form in ("csv", "pdf"))
    if form != "pdf":
        words = [word for name, text in CALC.items() for word in (f"--{name.replace('_', '-')}", text)]
        assert answer.text.strip() == CliRunner().invoke(main, ["calc", *words, "--format", form]).output.strip()


def test_a_calculation_as_a_command_and_as_a_program(server):
    shell = server.client.post("/api/calc?format=shell", json=CALC).text
    program = server.client.post("/api/calc?format=python", json=CALC).text
    assert shell.startswith("subtense calc --focal 35")
    said = io.StringIO()
    exec(program, {"print": lambda *words: print(*words, file=said)})
    wanted = server.client.post("/api/calc", json=CALC).json()["measurements"][0]
    assert f"{wanted['value']}" in said.getvalue()


def test_a_command_can_carry_no_other(server):
    import shlex

    said = {**CALC, "size": "200 mm'; rm -rf / #"}
    assert error(server.client.post("/api/calc?format=shell", json=said))["name"] == "size"
    said = {**CALC, "preset": "smartphone"}
    assert shlex.split(server.client.post("/api/calc?format=shell", json=said).text)[-1] == "smartphone"


def test_a_report_of_no_such_name_or_without_its_photo(server):
    for form in ("overlay", "exe", "", "../json"):
        assert error(server.client.post("/api/calc", params={"format": form}, json=CALC))["name"] == "format"


def test_the_curve_runs_through_the_answer(server):
    curve = server.client.post("/api/calc/curve", json=CALC).json()
    answer = server.client.post("/api/calc", json=CALC).json()["measurements"][0]
    assert (curve["x_what"], curve["y_what"], curve["x_unit"], curve["y_unit"]) == ("extent", "distance", "px", "m")
    at = int(np.argmin(np.abs(np.array(curve["x"]) - 150)))
    assert curve["x"][at] == pytest.approx(150) and curve["value"][at] == pytest.approx(answer["value"])
    assert curve["low"][at] == pytest.approx(answer["low"], rel=0.01)
    assert all(
        low < value < high for low, value, high in zip(*(curve[k] for k in ("low", "value", "high")), strict=True)
    )


@pytest.mark.parametrize(
    ("change", "name"),
    [({"focal": "x"}, "focal"), ({"extent": "0"}, "extent"), ({"sensor_width": None}, "sensor_width"),
     ({"image_width": "-1"}, "image_width"), ({"size": "5 s"}, "size"), ({"preset": "no such"}, "preset"),
     ({"offset": "1"}, "offset"), ({"tilt": "95"}, "tilt"), ({"distance": "1 m"}, "the_unknown"), ({"along": "depth"}, "along"),
     ({"level": 0.2}, "level"), ({"seed": -1}, "seed"), ({"focal": "1" * 201}, "focal"), ({"focal": 35}, "focal"),
     ({"nothing": "1"}, "nothing"), ({"extent": "5000"}, "extent"), ({"size": "1 mm", "extent": "4000"}, "inside_focal_length")],
)  # fmt: skip
def test_an_error_names_its_field(server, change, name):
    found = error(server.client.post("/api/calc", json={**CALC, **change}))
    assert found["name"] == name and found["message"]


def test_an_error_of_a_measurement_names_its_field(server):
    good = {"camera": "1600x1200, f=1500 ± 10 px", "ends": "120,80;640,80 ± 0.5px", "size": "200 ± 0.5 mm"}
    assert server.client.post("/api/measure/known_size", json={"inputs": good}).status_code == 200
    for change, name in [({"size": "x"}, "size"), ({"ends": "1,2;3"}, "ends"), ({"camera": "x"}, "camera"), ({"size": 5}, "size"),
                         ({"other": "5"}, "inputs"), ({"size": None}, "inputs"), ({"size": {"value": "x", "u": 1}}, "size"),
                         ({"size": {"value": 1, "u": -1, "unit": "m"}}, "u"), ({"ends": "120,80;120,80"}, None)]:  # fmt: skip
        found = error(server.client.post("/api/measure/known_size", json={"inputs": {**good, **change}}))
        assert found["name"] == name or name is None, (change, found)
    assert error(server.client.post("/api/measure/no_such", json={"inputs": good}))["name"] == "method"


NASTY = [
    {"ends": {"points_px": [[[1, 2], [3, 4]], [[5, 6], [7, 8]]]}}, {"ends": {"points_px": []}}, {"ends": {"points_px": [[]]}},
    {"ends": {"points_px": "x"}}, {"ends": {"points_px": {"a": 1}}}, {"ends": {"points_px": [[1, 2], [3, None]]}}, {"ends": []},
    {"ends": {"points_px": [[1, 2], [3, 4], [5, 6]]}}, {"ends": {"points_px": [[1, 2], [3, 4]], "sigma_px": [1, 2, 3]}},
    {"ends": {"points_px": [[1, 2], [3, 4]], "cov": [[1]]}}, {"ends": {"points_px": [[1, 2], [3, 4]], "sigma_px": {}}},
    {"ends": {"points_px": [[1e308, 2], [-1e308, 4]]}}, {"ends": {"points_px": [[1, 2], [3, 4]], "sigma_px": 1e308}},
    {"ends": {"points_px": [[1, 2], [3, 4]], "label": ["x"], "id": {"a": 1}}}, {"ends": {"points_px": [[1, 2], [3, 4]], "id": 5}},
    {"ends": {"points_px": [[1, 2], [30, 4]], "cov": [[-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}},
    {"ends": True}, {"ends": {"$ref": "#/given/size"}}, {"ends": {"$ref": ["x"]}}, {"ends": {"$ref": "#/given/nothing"}},
    {"size": {"value": [1, 2], "u": 1, "unit": "m"}}, {"size": {"value": 1, "u": [1, 2], "unit": "m"}},
    {"size": {"value": 1, "u": 1, "unit": "parsec"}}, {"size": {"value": 1, "u": 1, "unit": ["m"]}},
    {"size": {"value": 1, "u": 0.1, "unit": "m", "distribution": "no such"}}, {"size": {"value": 1e308, "u": 1e308}},
    {"size": {"value": 1, "u": 0.1, "unit": "m", "distribution": {"name": "uniform", "low": "x"}}}, {"size": {"value": 0, "u": 0}},
    {"size": {"value": 1, "u": 0.1, "unit": "m", "dof": 0}}, {"size": {"value": 1, "u": 0.1, "unit": "m", "dof": -5}},
    {"size": {"value": 1, "u": 0.1, "unit": "px"}}, {"size": {"value": -1, "u": 0.1, "unit": "m"}}, {"size": {"value": "1", "u": "1"}},
    {"size": {"value": 10**200, "u": 0, "unit": "m"}}, {"size": {"value": None, "u": None}}, {"size": "9" * 100_000},
    {"size": {"value": 1, "u": 0.1, "unit": "m", "distribution": {}}}, {"size": {"value": 1, "u": 0.1, "distribution": []}},
    {"size": "1e308 ± 1e308 m"}, {"size": "± m"}, {"size": "1 ± 1e-320 m"}, {"size": "1" + " " * 100_000 + "m"},
    {"camera": {"width_px": 1e308, "height_px": 1, "f_px": 1, "cx_px": 0, "cy_px": 0}}, {"camera": {"width_px": -5}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 0, "cx_px": 0, "cy_px": 0}}, {"camera": {}}, {"camera": []},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 1e308, "cx_px": 1e308, "cy_px": -1e308}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 100, "cx_px": 50, "cy_px": 50, "lens": "no such"}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 100, "cx_px": 50, "cy_px": 50, "lens": ["x"]}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 100, "cx_px": 50, "cy_px": 50, "distortion": [1e308] * 4}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 100, "cx_px": 50, "cy_px": 50, "distortion": ["x"]}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 100, "cx_px": 50, "cy_px": 50, "distortion": list(range(50))}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": [100, 200], "cx_px": 50, "cy_px": 50}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 100, "cx_px": 50, "cy_px": 50, "cov": [[1e300] * 4] * 4}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 100, "cx_px": 50, "cy_px": 50, "cov": "x"}},
    {"camera": {"width_px": 100, "height_px": 100, "f_px": 100, "cx_px": 50, "cy_px": 50, "aspect": 0}},
    {"tilt": {"value": 1e9, "u": 1, "unit": "rad"}}, {"tilt": "90 ± 1 deg"}, {"tilt": "0 ± 1000 deg"}, {"focus": {"value": -1e9, "u": 1}},
]  # fmt: skip


@pytest.mark.parametrize("change", NASTY, ids=lambda change: json.dumps(change)[:60])
def test_nonsense_is_refused_and_never_breaks(server, change):
    good = {"camera": "1600x1200, f=1500 ± 10 px", "ends": "120,80;640,80 ± 0.5px", "size": "200 ± 0.5 mm"}
    answer = server.client.post("/api/measure/known_size", json={"inputs": {**good, **change}})
    assert answer.status_code in (200, 422), answer.text
    if answer.status_code == 422:
        error(answer)


def test_nonsense_for_every_method(server):
    wrong = [5, {"value": [], "u": 1}, {"points_px": [[0, 0]] * 3}, {"points_m": [[[0, 0, 0]]], "name": "x"}]
    for method in server.client.get("/api/methods").json()["methods"]:
        for name in method["inputs"]["properties"]:
            for value in wrong:
                inputs = {**method["example"], name: value}
                answer = server.client.post(f"/api/measure/{method['name']}", json={"inputs": inputs})
                assert answer.status_code in (200, 422), (method["name"], name, value, answer.text)


# -- photos ----------------------------------------------------------------------------------------------


def as_form(form: str) -> bytes:
    return picture(700, 600, form)


@pytest.mark.parametrize("form", ["JPEG", "PNG", "WEBP", "TIFF", "BMP", "HEIC", "DNG"])
def test_a_photo_of_every_form_is_what_the_loader_reads(server, tmp_path, form):
    if form == "HEIC":
        data = heic(Image.open(io.BytesIO(picture(700, 600))))
    elif form == "DNG":
        pytest.importorskip("rawpy")
        data = dng()
    else:
        data = as_form(form)
    path = tmp_path / f"IMG 1.{form.lower()}"
    path.write_bytes(data)
    photo = Photo.load(path)
    held = server.photo(data, path.name)
    assert {k: held[k] for k in photo.to_json()} == photo.to_json()
    assert held["id"] == photo.digest[:32] and not held["kept"]
    assert np.array_equal(whole(server, held), photo.pixels)


def tile(server, held, level, column, row, form="png"):
    return server.client.get(f"/api/photos/{held['id']}/tiles/{level}/{column}_{row}.{form}")


def pixels_of(answer):
    assert answer.status_code == 200, answer.text
    return np.asarray(Image.open(io.BytesIO(answer.content)).convert("RGB"))


def whole(server, held, level=None):
    """A level put together from its tiles."""
    level = held["levels"] - 1 if level is None else level
    width, height = size_of(held, level)
    rows = [
        np.hstack([pixels_of(tile(server, held, level, c, r)) for c in range(-(-width // 512))])
        for r in range(-(-height // 512))
    ]
    return np.vstack(rows)


def size_of(held, level):
    width, height = held["width_px"], held["height_px"]
    for _ in range(held["levels"] - 1 - level):
        width, height = (width + 1) // 2, (height + 1) // 2
    return width, height


def test_a_photo_sent_twice_is_one(server):
    data = picture(120, 90, seed=5)
    first, second = server.photo(data, "a.png"), server.photo(data, "b.png")
    assert second == {**first, "name": "b.png"}
    assert [p["id"] for p in server.client.get("/api/photos").json()["photos"]].count(first["id"]) == 1
    assert server.client.get(f"/api/photos/{first['id']}").json() == second


def test_several_photos_at_once(server):
    files = [("file", (f"{i}.png", picture(30, 20, seed=20 + i))) for i in range(3)]
    answer = server.client.post("/api/photos", files=files)
    assert answer.status_code == 201 and [p["name"] for p in answer.json()["photos"]] == ["0.png", "1.png", "2.png"]


def test_levels_and_tiles(server, tmp_path):
    data = picture(1300, 1026, seed=6)
    (tmp_path / "a.png").write_bytes(data)
    held, photo = server.photo(data), Photo.load(tmp_path / "a.png")
    assert (held["levels"], held["tile_px"]) == (3, 512)
    assert np.array_equal(whole(server, held), photo.pixels)
    for level in range(3):
        assert whole(server, held, level).shape[1::-1] == size_of(held, level)
    assert max(size_of(held, 0)) <= 512
    corner = pixels_of(tile(server, held, 2, 2, 2))
    assert corner.shape == (1026 - 1024, 1300 - 1024, 3) and np.array_equal(corner, photo.pixels[1024:, 1024:])
    half = photo.pixels.astype(float).reshape(513, 2, 650, 2, 3).mean((1, 3))
    assert np.abs(whole(server, held, 1) - half).max() <= 1
    jpeg = tile(server, held, 2, 0, 0, "jpg")
    assert jpeg.headers["content-type"] == "image/jpeg" and "private" in jpeg.headers["cache-control"]
    assert np.abs(pixels_of(jpeg).astype(int) - photo.pixels[:512, :512]).mean() < 3


@pytest.mark.parametrize("place", ["3/0_0", "40/0_0", "2/3_0", "2/0_3", "0/1_0", "1/0_2", "2/1000000_1000000"])
def test_tiles_beside_the_picture_do_not_exist(server, place):
    held = server.photo(picture(1300, 1026, seed=6))
    answer = server.client.get(f"/api/photos/{held['id']}/tiles/{place}.png")
    assert error(answer, 404)["type"] == "Absent"


@pytest.mark.parametrize(
    "place", ["-1/0_0.png", "0/-1_0.png", "0/0_0.gif", "x/0_0.png", "0/1e9_0.png", "41/0_0.png", "0/0_9999999.png"]
)
def test_nonsense_tiles_are_refused(server, place):
    held = server.photo(picture(1300, 1026, seed=6))
    assert server.client.get(f"/api/photos/{held['id']}/tiles/{place}").status_code == 422


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_photo_is_upright(server, tmp_path, orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    data = picture(80, 48, "PNG", exif=exif)
    (tmp_path / "a.png").write_bytes(data)
    held, photo = server.photo(data), Photo.load(tmp_path / "a.png")
    assert (held["width_px"], held["height_px"]) == ((80, 48) if orientation < 5 else (48, 80))
    assert np.array_equal(whole(server, held), photo.pixels)


def test_neither_place_nor_number_of_the_camera_leaves_a_photo(server):
    exif = Image.Exif()
    exif[0x010F], exif[0x0110] = "Maker", "Model"
    exif.get_ifd(0x8769)[0xA431] = "SERIAL-123"
    exif.get_ifd(0x8825)[0x0002] = (52.0, 31.0, 12.0)
    held = server.photo(picture(40, 30, "JPEG", exif=exif), "a.jpg")
    assert held["tags"] == {"make": "Maker", "model": "Model"}
    assert "SERIAL" not in json.dumps(held) and "52" not in json.dumps(held["tags"])


@pytest.mark.parametrize(
    "data", [b"", b"x", b"%PDF-1.7", b"<svg/>", b"\xff\xd8\xff", b"PK\x03\x04", picture(90, 60)[:200]]
)
def test_what_is_no_picture_is_told(server, data):
    found = error(server.send(data, "a.jpg"))
    assert found["type"] == "FileFormatError" and found["message"].startswith("a.jpg: ")
    assert str(server.temp) not in found["message"]


def test_a_request_without_a_photo(server):
    assert error(server.client.post("/api/photos", files={"file": (None, "x")}))["name"] == "file"
    broken = {"content-type": "multipart/form-data"}
    assert error(server.client.post("/api/photos", content=b"x", headers=broken))["name"] == "body"
    broken = {"content-type": "multipart/form-data; boundary=a"}
    assert error(server.client.post("/api/photos", content=b"--b\r\n", headers=broken))["name"] in ("body", "file")


def test_a_dropped_photo_is_gone(server):
    held = server.photo(picture(64, 48, seed=9))
    assert server.client.post("/api/photos/keep", json={"photos": [held["id"], "0" * 32]}).json() == {
        "absent": ["0" * 32]
    }
    assert server.client.delete(f"/api/photos/{held['id']}").status_code == 204
    assert error(server.client.delete(f"/api/photos/{held['id']}"), 404)
    assert error(tile(server, held, 0, 0, 0), 404)["type"] == "Absent"
    assert error(server.client.post("/api/camera", json={"photo": held["id"]}), 404)
    assert error(server.client.post("/api/measure", json={"photo": held["id"]}), 404)
    assert error(server.client.post("/api/detect/markers", json={"photo": held["id"]}), 404)
    assert error(server.client.post("/api/jobs", json={"detector": "markers", "photo": held["id"]}), 404)
    assert server.client.post("/api/photos/keep", json={"photos": [held["id"]]}).json() == {"absent": [held["id"]]}
    assert server.photo(picture(64, 48, seed=9)) == held


def test_photos_of_the_command_line_stay(tmp_path, examples):
    with serving(
        tmp_path, "--limit", "idle_s=0.01", "--limit", "photos=1", str(examples / "desk.jpg"), str(tmp_path / "log")
    ) as own:
        assert until(lambda: "log" in own.log.read_text())  # no picture: told, and no reason to end
        [kept] = own.client.get("/api/photos").json()["photos"]
        assert kept["kept"] and kept["name"] == "desk.jpg"
        time.sleep(0.05)
        assert own.client.post("/api/photos/keep", json={"photos": [kept["id"]]}).json() == {"absent": []}
    assert (examples / "desk.jpg").exists()


# -- the camera ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("camera", [None, "f=1500px", "f=35mm,sensor=14.1mm", "fov=50deg", "smartphone"])
def test_the_camera_is_what_the_command_line_prints(server, desk, examples, camera):
    answer = server.client.post("/api/camera", json={"photo": desk["id"], "camera": camera})
    assert answer.json() == printed("camera", examples / "desk.jpg", *(["--camera", camera] if camera else []))


def test_the_camera_as_every_report(server, desk):
    for form, report in REPORTS.items():
        answer = server.client.post(f"/api/camera?format={form}", json={"photo": desk["id"]})
        assert answer.status_code == 200 and answer.headers["content-type"] == report.media_type


def test_what_a_photo_fills_into_the_calculator(server, desk):
    texts = server.client.post("/api/camera/calculator", json={"photo": desk["id"]}).json()
    camera = server.client.post("/api/camera", json={"photo": desk["id"]}).json()["camera"]
    answer = server.client.post("/api/calc", json={**texts, "size": "200 mm", "extent": "150"}).json()
    assert answer["camera"]["f_px"] == pytest.approx(camera["f_px"], rel=1e-5)
    assert answer["camera"]["u_f_px"] == pytest.approx(camera["u_f_px"], rel=0.01)


def test_what_a_photos_xmp_tells_reaches_the_camera(server):
    """Decoded in a child, sent as JSON, resolved in the server: the same camera, pose and notes as on the command line."""
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 26
    said = 'GimbalPitchDegree="-45.0" drone-dji:RelativeAltitude="+12.5" drone-dji:GpsLatitude="47.123456"'
    crop = 'crs:HasCrop="True" crs:AlreadyApplied="True" crs:CropLeft="0" crs:CropTop="0" crs:CropRight="0.5" crs:CropBottom="0.5"'
    xmp = (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><r:RDF xmlns:r="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><r:Description '
        f'xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/" xmlns:crs="http://ns.adobe.com/camera-raw-settings/1.0/" '
        f"drone-dji:{said} {crop}/></r:RDF></x:xmpmeta>"
    )
    held = server.photo(picture(400, 300, "JPEG", seed=12, exif=exif, xmp=xmp.encode()))
    found = server.client.post("/api/camera", json={"photo": held["id"]}).json()
    assert found["camera"]["f_px"] == pytest.approx(26 * 1000 / 43.2666, rel=1e-5)
    assert found["camera"]["cx_px"] == pytest.approx(399.5)
    assert found["camera"]["pose"]["height_above_start_m"] == 12.5
    assert [note["code"] for note in found["notes"]] == ["cropped"]
    assert "47.123" not in json.dumps(found) + json.dumps(held)


def test_a_photo_without_a_camera_says_what_to_give(server):
    held = server.photo(picture(64, 48, seed=11))
    found = server.client.post("/api/camera", json={"photo": held["id"]}).json()
    assert found["camera"] is None and found["measurements"] == []
    assert found["notes"][-1]["code"] == "unknown_camera" and "f=1500px" in found["notes"][-1]["text"]
    assert (
        error(server.client.post("/api/camera/calculator", json={"photo": held["id"]}))["type"] == "UnknownCameraError"
    )
    body = {"photo": held["id"], "items": [{"method": "known_size", "inputs": {"ends": "1,2;30,2", "size": "20"}}]}
    sheet = server.client.post("/api/measure", json=body).json()
    assert sheet["measurements"] == [] and sheet["notes"][-1]["code"] == "refused"


def test_a_calibration_file_is_sent_as_content(server, desk, examples, tmp_path):
    content = json.dumps(printed("camera", examples / "desk.jpg", "--camera", "f=1500px"))
    (tmp_path / "mine.json").write_text(content)
    body = {"photo": desk["id"], "camera": {"name": "mine.json", "content": content}}
    expected = printed("camera", examples / "desk.jpg", "--camera", tmp_path / "mine.json")
    assert server.client.post("/api/camera", json=body).json() == expected
    for wrong in (
        "",
        "x",
        "[]",
        "{}",
        '{"f_px": NaN}',
        '{"width_px": 1e999}',
        "[" * 100_000,
        content.replace("1500", '"x"'),
    ):
        body["camera"]["content"] = wrong
        assert error(server.client.post("/api/camera", json=body))["type"] == "FileFormatError"
    for wrong in ({"name": "x"}, {"content": "x"}, {"name": 5, "content": "x"}, 5, [], True):
        body["camera"] = wrong
        assert error(server.client.post("/api/camera", json=body))["name"] == "camera"


@pytest.fixture(scope="module")
def secrets(tmp_path_factory, server, desk, examples) -> list[Path]:
    """Files that exist on the machine of the server, each of them a good camera or noun."""
    folder = tmp_path_factory.mktemp("secrets")
    camera = json.dumps({"width_px": 1600, "height_px": 1200, "f_px": 4321.5, "cx_px": 799.5, "cy_px": 599.5})
    for name in ("camera.json", "camera.txt", "camera", "camera.yaml"):
        (folder / name).write_text(camera)
    return sorted(folder.iterdir())


def test_a_text_for_a_camera_never_reads_a_file(server, desk, secrets):
    """Neither what is in a file nor whether there is one can be told from the answer."""
    here = [str(path) for path in secrets] + ["/etc/passwd"]
    absent = [str(path.with_name(f"no-{path.name}")) for path in secrets] + ["/etc/nopassw"]
    for there, gone in zip(here, absent, strict=True):
        for form in ("{}", "@{}", "file://{}", " {}", "f={}"):
            said = []
            for path in (there, gone):
                text = form.format(path)
                found = error(server.client.post("/api/camera", json={"photo": desk["id"], "camera": text}))
                assert found["name"] == "camera" and "4321" not in found["message"] and "root:" not in found["message"]
                said.append(found["message"].replace(text, "").split(";")[-1])
            assert "no such file" not in said[0] and said[0].split("known are")[0] == said[1].split("known are")[0]


def test_a_text_for_an_input_never_reads_a_file(server, secrets):
    good = {"camera": "1600x1200, f=1500 ± 10 px", "ends": "120,80;640,80 ± 0.5px", "size": "200 ± 0.5 mm"}
    for path in [*map(str, secrets), "/etc/passwd", "/dev/zero", "/etc/nopassw"]:
        for field in good:
            for text in (path, f"@{path}"):
                answer = server.client.post("/api/measure/known_size", json={"inputs": {**good, field: text}})
                found = error(answer)
                assert found["name"] == field and "4321" not in answer.text and "root:" not in answer.text
                assert "no such file" not in found["message"]
    assert error(server.client.post("/api/measure/known_size", json={"inputs": {**good, "inputs": f"@{secrets[0]}"}}))


def test_a_calibration_reads_its_content_and_no_file_of_its_name(server, desk, secrets):
    for path in secrets:
        body = {"photo": desk["id"], "camera": {"name": str(path), "content": "{}"}}
        found = error(server.client.post("/api/camera", json=body))
        assert "4321" not in found["message"] and str(path.parent) not in found["message"]


# -- measuring -------------------------------------------------------------------------------------------


def test_a_line_in_a_photo_is_what_the_command_line_prints(server, examples):
    belt = server.photo((examples / "belt.jpg").read_bytes(), "belt.jpg")
    words = ["measure", examples / "belt.jpg", "--line", "500,600,1033,600", "--size", "200"]
    body = {"photo": belt["id"], "inputs": {"ends": "500,600;1033,600", "size": "200"}}
    assert server.client.post("/api/measure/known_size", json=body).json() == printed(*words)
    body["camera"] = "f=1500px"
    assert server.client.post("/api/measure/known_size", json=body).json() == printed(*words, "--camera", "f=1500px")
    body["inputs"]["ends"] = "500,600;9000,600"
    assert error(server.client.post("/api/measure/known_size", json=body))["name"] == "ends"


def test_points_set_on_a_blurred_picture_are_doubted_as_the_command_doubts_them(server, examples, tmp_path):
    with Image.open(examples / "desk.jpg") as sharp:
        exif = sharp.info["exif"]
        sharp.filter(ImageFilter.GaussianBlur(6)).save(tmp_path / "blurred.jpg", quality=95, exif=exif)
    held = server.photo((tmp_path / "blurred.jpg").read_bytes(), "blurred.jpg")
    line = "346,600,753,600"
    body = {"photo": held["id"], "inputs": {"ends": "346,600;753,600", "size": "260"}}
    found = server.client.post("/api/measure/known_size", json=body).json()
    assert "blurred" in [note["code"] for note in found["measurements"][0]["notes"]]
    assert found == printed("measure", tmp_path / "blurred.jpg", "--line", line, "--size", "260")


OBSERVED = ("points_px", "sigma_px", "cov", "label", "score", "source")


def to_measure(one: dict, size: str | None = None) -> dict:
    """An item of POST /api/measure, from what a detection says of how it is measured."""
    told = one["size_prefix"] + size if size else one["size"]
    tilt = {"tilt": one["tilt"]} if one["tilt"] else {}
    inputs = {one["points_field"]: {key: one[key] for key in OBSERVED}, one["size_field"]: told, **tilt}
    return {"method": one["method"], "inputs": inputs, "label": one["label"], "notes": one["notes"]}


def test_markers_are_what_the_command_line_finds(server, desk, examples):
    seen = server.client.post("/api/detect/markers", json={"photo": desk["id"]}).json()["detections"]
    items = [to_measure(one, "50 mm") for one in seen]
    sheet = server.client.post("/api/measure", json={"photo": desk["id"], "items": items}).json()
    expected = printed("measure", examples / "desk.jpg", "--marker-size", "50mm")
    assert len(sheet["measurements"]) == len(expected["measurements"]) > 0
    for mine, theirs in zip(sheet["measurements"], expected["measurements"], strict=True):
        assert (mine["label"], mine["what"]) == (theirs["label"], theirs["what"])
        assert mine["value"] == pytest.approx(theirs["value"], rel=1e-9)
        assert mine["u"] == pytest.approx(theirs["u"], rel=1e-6)


def test_a_sheet_as_every_report_and_one_refused_item_loses_no_other(server, desk):
    line = {"ends": "500,600;900,600", "size": "200"}
    items = [{"method": "known_size", "inputs": line, "label": "<b>&\"'=1+1"}, {"method": "known_size", "inputs": {}},
             {"method": "known_distance", "inputs": {"ends": "500,600;900,600", "distance": "2 m"}}]  # fmt: skip
    body = {"photo": desk["id"], "items": items}
    sheet = server.client.post("/api/measure", json=body).json()
    assert {m["label"] for m in sheet["measurements"]} == {"<b>&\"'=1+1", "known_distance 3"}
    assert [n["code"] for n in sheet["notes"]].count("refused") == 1
    for form, report in REPORTS.items():
        answer = server.client.post(f"/api/measure?format={form}", json=body)
        assert answer.status_code == 200 and answer.headers["content-type"] == report.media_type, answer.text
        assert len(answer.content) > 100
    overlay = server.client.post("/api/measure?format=overlay", json=body)
    assert Image.open(io.BytesIO(overlay.content)).size == (desk["width_px"], desk["height_px"])
    assert server.client.post("/api/measure", json={"photo": desk["id"]}).json()["measurements"] == []


# -- searches and jobs -----------------------------------------------------------------------------------


def events(server, job: str) -> list[tuple[str, dict]]:
    """All events of a job, to its end."""
    found = []
    with server.client.stream("GET", f"/api/jobs/{job}/events") as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        assert answer.headers["cache-control"] == "no-store"
        for block in "".join(answer.iter_text()).split("\n\n"):
            if block.startswith("event: "):
                name, data = block.split("\n")
                found.append((name.removeprefix("event: "), json.loads(data.removeprefix("data: "))))
    return found


def test_a_job_tells_its_progress_until_it_is_done(server, desk):
    answer = server.client.post("/api/jobs", json={"detector": "markers", "photo": desk["id"]})
    assert answer.status_code == 202
    job = answer.json()
    assert job["state"] == "running" and job["result"] is None
    seen = events(server, job["id"])
    assert [name for name, _ in seen[:-1]] == ["running"] * (len(seen) - 1) and seen[-1][0] == "done"
    progress = [data["progress"] for _, data in seen]
    assert progress == sorted(progress) and progress[-1] == 1 and len(set(progress)) > 1
    waited = server.client.post("/api/detect/markers", json={"photo": desk["id"]}).json()
    assert seen[-1][1]["result"] == waited and len(waited["detections"]) > 0
    assert seen[-2][1]["doing"] == DETECTORS["markers"].title
    assert server.client.get(f"/api/jobs/{job['id']}").json() == seen[-1][1]
    assert [name for name, _ in events(server, job["id"])] == ["done"]
    assert server.client.delete(f"/api/jobs/{job['id']}").status_code == 204  # it has ended, and stays as it is
    assert server.client.get(f"/api/jobs/{job['id']}").json()["state"] == "done"


def test_everything_that_looks_unasked_is_found_at_once(server, desk, examples):
    """What has a usual size is measured as by the command, to the last note and line of the budget."""
    found = server.client.post("/api/detect/all", json={"photo": desk["id"]}).json()
    by = {one["detector"] for one in found["detections"]}
    assert "markers" in by and by <= {name for name, row in DETECTORS.items() if row.automatic}
    for one in found["detections"]:
        assert (one["target"] is None) == (one["size_text"] is None)
        codes = [note["code"] for note in one["notes"]]
        assert ("assumed_size" in codes) == (one["target"] is not None)
    sized = [to_measure(one) for one in found["detections"] if one["size_text"]]
    sheet = server.client.post("/api/measure", json={"photo": desk["id"], "items": sized}).json()
    expected = printed("measure", examples / "desk.jpg")["measurements"]
    assert len(sheet["measurements"]) == len(expected) and len({m["label"] for m in expected}) == len(sized) > 0
    for mine, theirs in zip(sheet["measurements"], expected, strict=True):
        for key in ("label", "what", "value", "u", "low", "high", "notes", "budget"):
            assert mine[key] == theirs[key], key


def test_what_a_person_says_narrows_the_search(server, desk):
    body = {"photo": desk["id"], "targets": ["cup"]}
    for one in server.client.post("/api/detect/all", json=body).json()["detections"]:
        assert one["detector"] != "markers"
        assert one["target"] != "cup" or "assumed_size" not in [note["code"] for note in one["notes"]]
    seen = {}
    for curve in (None, "linear", "2.6"):
        answer = server.client.post(
            "/api/detect/markers", json={"photo": desk["id"], "family": "36h11", "curve": curve}
        )
        [seen[curve]] = answer.json()["detections"]
    assert len({json.dumps(one["points_px"]) for one in seen.values()}) == 3


@pytest.mark.parametrize(
    ("said", "field", "words"),
    [({"targets": ["no such thing"]}, "targets", "known are"), ({"targets": ["floor-to-floor"]}, "targets", "known are"),
     ({"family": "0h0"}, "family", "36h11"), ({"curve": "9"}, "curve", "between 0.4 and 4"),
     ({"camera": "no such camera"}, "camera", "known are"), ({"thorough": "yes"}, "thorough", "bool"),
     ({"targets": ["a4"] * 51}, "targets", "50")],
)  # fmt: skip
def test_a_search_that_can_not_be_made_says_which_word_is_wrong(server, desk, said, field, words):
    body = {"photo": desk["id"], **said}
    for answer in (
        server.client.post("/api/detect/all", json=body),
        server.client.post("/api/jobs", json={**body, "detector": "all"}),
    ):
        found = error(answer)
        assert found["name"].startswith(field) and words in found["message"]


def test_a_kind_that_nothing_finds_is_told_from_one_that_is_not_known(server, desk):
    name = next(t.name for t in targets().values() if not any(t.group in row.groups for row in DETECTORS.values()))
    found = error(server.client.post("/api/detect/all", json={"photo": desk["id"], "targets": [name]}))
    assert found["name"] == "targets" and "nothing finds it" in found["message"]
    found = error(server.client.post("/api/detect/all", json={"photo": desk["id"], "targets": ["no-such-thing"]}))
    assert found["name"] == "targets" and "known are" in found["message"]


def test_a_kind_that_is_said_is_looked_for_beside_the_detector_that_is_named(server, desk):
    found = server.client.post("/api/detect/markers", json={"photo": desk["id"], "targets": ["cup"]}).json()[
        "detections"
    ]
    assert {one["detector"] for one in found} == {"markers", "objects"}


def test_a_missing_extra_of_a_child_keeps_its_status():
    status, found = problem_of(ChildError("MissingExtraError", "needs an extra", "networks"))
    assert (status, found["type"], found["name"]) == (501, "MissingExtraError", "networks")


def test_marked_points_go_to_the_edges_near_them(server, desk):
    """The corners of the sheet on the desk, marked by hand."""
    marked = [[396.0, 371.0], [746.0, 369.5]]
    body = {"photo": desk["id"], "points_px": marked}
    found = server.client.post("/api/snap", json=body).json()
    seen = found["observation"]
    assert np.shape(seen["cov"]) == (4, 4) and np.sqrt(np.diag(seen["cov"])).max() < 0.5
    assert np.hypot(*(np.array(seen["points_px"]) - marked).T).max() < 10
    assert found["notes"][0]["code"] == "snapped"
    one = server.client.post("/api/snap", json={**body, "points_px": marked[:1]}).json()
    assert one["observation"]["points_px"][0] == pytest.approx([394.4, 372.3], abs=1)
    item = {"inputs": {"ends": seen, "size": "210 mm"}, "photo": desk["id"], "notes": found["notes"]}
    m = server.client.post("/api/measure/known_size", json=item).json()["measurements"][0]
    assert "snapped" in [note["code"] for note in m["notes"]]


def test_snapping_where_nothing_is_says_so(server, desk):
    flat = server.photo(encoded(np.full((60, 80, 3), 128, np.uint8)), "flat.png")
    body = {"photo": flat["id"], "points_px": [[20, 20]]}
    found = error(server.client.post("/api/snap", json=body))
    assert found["type"] == "NothingFoundError" and "no corner" in found["message"]
    for points, word in (([[200, 20]], "in the picture"), ([[20, 20], [20, 20]], "")):
        assert word in error(server.client.post("/api/snap", json={**body, "points_px": points}))["message"]
    assert error(server.client.post("/api/snap", json={**body, "curve": "x"}))["name"] == "curve"
    assert error(server.client.post("/api/snap", json={**body, "points_px": []}))["name"] == "points_px"


def test_an_outline_gives_extents_that_are_measured(server, desk):
    """Of the bank card on the desk, by a box around it."""
    body = {"photo": desk["id"], "place": [860, 680, 1085, 825]}
    found = server.client.post("/api/outline", json=body).json()
    assert {"longest", "shortest", "width", "height", "box"} == set(found["extents"])
    contour = np.array(found["contour_px"])
    assert contour.min(axis=0) == pytest.approx([871.7, 688.7], abs=2) and contour.max(axis=0) == pytest.approx(
        [1073.6, 814.5], abs=2
    )
    ends = {key: found["extents"]["longest"][key] for key in OBSERVED}
    item = {
        "inputs": {found["points_field"]: ends, found["size_field"]: "101.2 mm"},
        "photo": desk["id"],
        "notes": found["notes"],
    }
    m = server.client.post(f"/api/measure/{found['method']}", json=item).json()["measurements"][0]
    assert m["low"] < 0.59 < m["high"]
    for place, word in (([10, 10, 12, 12], "box needs"), ([5000, 10], "1600 x 1200"), ([1, 2, 3], "give x, y")):
        assert word in error(server.client.post("/api/outline", json={**body, "place": place}))["message"]
    flat = server.photo(encoded(np.full((60, 80, 3), 128, np.uint8)), "flat.png")
    found = error(server.client.post("/api/outline", json={"photo": flat["id"], "place": [40, 30]}))
    assert found["type"] == "NothingFoundError" and "stands out" in found["message"]


def encoded(pixels: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG")
    return out.getvalue()


def test_a_cancelled_job_leaves_no_process(server):
    held = server.photo(picture(2000, 1600, "JPEG", seed=3, quality=80), "large.jpg")
    job = server.client.post("/api/jobs", json={"detector": "markers", "photo": held["id"]}).json()["id"]
    assert until(lambda: server.client.get(f"/api/jobs/{job}").json()["progress"] > 0)
    assert len(server.children()) == 1
    began = time.monotonic()
    assert server.client.delete(f"/api/jobs/{job}").status_code == 204
    assert until(lambda: not server.children(), 5)
    assert time.monotonic() - began < 5
    assert until(lambda: server.client.get(f"/api/jobs/{job}").json()["state"] == "cancelled", 2)
    name, data = events(server, job)[-1]
    assert name == "cancelled" and data["result"] is None and data["error"] is None


def test_a_job_whose_photo_is_dropped_ends(server):
    held = server.photo(picture(600, 400, seed=13))
    job = server.client.post("/api/jobs", json={"detector": "markers", "photo": held["id"]}).json()["id"]
    server.client.delete(f"/api/photos/{held['id']}")
    name, data = events(server, job)[-1]
    assert name in ("done", "failed") and (data["error"] is None or data["error"]["type"] != "Failure")


def test_a_job_of_nothing_is_refused(server, desk):
    body = {"detector": "no such", "photo": desk["id"]}
    assert error(server.client.post("/api/jobs", json=body))["name"] == "detector"
    assert error(server.client.post("/api/detect/no_such", json={"photo": desk["id"]}))["name"] == "detector"
    assert error(server.client.post("/api/jobs", json={**body, "kind": "mine"}))["name"] == "kind"
    for line in ("GET", "DELETE"):
        assert error(server.client.request(line, "/api/jobs/aaaaaaaaaaaaaaaa"), 404)["type"] == "Absent"
    assert error(server.client.get("/api/jobs/aaaaaaaaaaaaaaaa/events"), 404)["type"] == "Absent"


def test_who_leaves_a_job_early_stops_nothing(server, desk):
    job = server.client.post("/api/jobs", json={"detector": "markers", "photo": desk["id"]}).json()["id"]
    with server.client.stream("GET", f"/api/jobs/{job}/events") as answer:
        next(answer.iter_text())
    assert events(server, job)[-1][0] == "done"


def test_the_file_of_a_sent_photo_is_not_kept(server):
    held = server.photo(picture(40, 30, seed=77))
    assert error(server.client.get(f"/api/photos/{held['id']}/file"), 404)["type"] == "Absent"


def test_distances_between_items_and_one_number_from_several(server, desk):
    line = {"method": "known_size", "inputs": {"ends": "100,100;400,100 ± 1px", "size": "300 ± 3 mm"}, "label": "near"}
    other = {"method": "known_size", "inputs": {"ends": "900,700;1000,700 ± 1px", "size": "300 ± 3 mm"}, "label": "far"}
    body = {"photo": desk["id"], "items": [line, other], "between": ["1,2"]}
    found = server.client.post("/api/measure", json=body).json()["measurements"]
    length = next(m for m in found if m["method"] == "between" and m["what"] == "length")
    assert length["label"] == "near to far" and length["low"] < length["value"] < length["high"]
    twice = {**body, "items": [line, {**line, "label": "again"}], "between": [], "same": ["near,again"]}
    found = server.client.post("/api/measure", json=twice).json()["measurements"]
    assert next(m for m in found if m["method"] == "fuse")["label"] == "near and again"
    for field, text in (("between", "1,9"), ("same", "near"), ("between", "nobody,near")):
        told = error(server.client.post("/api/measure", json={**body, "between": [], field: [text]}))
        assert told["name"] == field
