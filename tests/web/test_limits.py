"""Each limit on what is sent: it holds, the error has its name, and the server goes on."""

import io
import json
import shutil
import socket
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import httpx
import pytest
from PIL import Image
from running import awaited, picture, read_answer, serving, until

from subtense.web import photos
from subtense.web.bodies import depth_over
from subtense.web.children import Children
from subtense.web.settings import Limits
from subtense.web.uploads import shown_name

JSON = "Content-Type: application/json"
MULTIPART = "Content-Type: multipart/form-data; boundary=x"
CALC = {"focal": "35", "sensor_width": "14.1", "image_width": "4096", "size": "200", "extent": "150"}


def part(content: bytes, *headers: str, name: str = "file", file: str | None = "a.png") -> bytes:
    said = f'Content-Disposition: form-data; name="{name}"' + (f'; filename="{file}"' if file is not None else "")
    return "\r\n".join(["--x", said, *headers, "", ""]).encode() + content + b"\r\n"


def flat(width: int, height: int, mode: str = "1", form: str = "PNG", **options) -> bytes:
    """A large picture in a small file."""
    out = io.BytesIO()
    Image.new(mode, (width, height)).save(out, form, **options)
    return out.getvalue()


def png(width: int, height: int, data: bytes = b"", *chunks: tuple[bytes, bytes]) -> bytes:
    """A PNG by its chunks, whatever they say."""
    head = struct.pack(">LLBBBBB", width, height, 8, 0, 0, 0, 0)
    found = b"\x89PNG\r\n\x1a\n"
    for name, content in ((b"IHDR", head), *chunks, (b"IDAT", data), (b"IEND", b"")):
        found += struct.pack(">L", len(content)) + name + content + struct.pack(">L", zlib.crc32(name + content))
    return found


def error(answer, status: int = 413) -> dict:
    found = answer.error if hasattr(answer, "error") else answer.json()["error"]
    code = answer.status if hasattr(answer, "status") else answer.status_code
    assert code == status, (code, found)
    assert "\n" not in found["message"]
    return found


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A server with small limits, so that the tests are quick."""
    limits = {"upload_bytes": 60_000, "request_bytes": 150_000, "pixels": 4_000_000, "json_bytes": 40_000, "calibration_bytes": 2_000,
              "photos": 50}  # fmt: skip
    words = [word for name, value in limits.items() for word in ("--limit", f"{name}={value}")]
    with serving(tmp_path_factory.mktemp("small"), *words) as found:
        yield found


# -- sizes of requests -----------------------------------------------------------------------------------


def test_a_file_over_its_limit(small):
    found = error(small.send(b"x" * 60_001))
    assert (found["type"], found["name"]) == ("Limit", "upload_bytes") and "60000" in found["message"]
    assert error(small.send(b"x" * 60_000), 422)["type"] == "FileFormatError"
    assert not list(small.temp.glob("**/input"))


def test_a_request_over_its_limit_is_refused_before_it_is_sent(small):
    """By its announced length alone: no byte of the body is awaited."""
    found = error(small.ask("POST /api/photos", MULTIPART, "Content-Length: 150001"))
    assert (found["type"], found["name"]) == ("Limit", "request_bytes")
    assert error(small.ask("POST /api/calc", JSON, "Content-Length: 40001"))["name"] == "json_bytes"
    assert error(small.ask("POST /api/calc", JSON, "Content-Length: 99999999999999999999"), 413)["name"] == "json_bytes"


def chunked(size: int, piece: int = 10_000) -> bytes:
    body = part(b"x" * 50_000) + part(b"x" * 50_000) + part(b"x" * size)
    pieces = [body[i : i + piece] for i in range(0, len(body), piece)]
    return b"".join(f"{len(p):x}\r\n".encode() + p + b"\r\n" for p in pieces) + b"0\r\n\r\n"


def test_a_request_over_its_limit_without_a_length(small):
    head = f"POST /api/photos HTTP/1.1\r\nHost: {small.host}\r\nAuthorization: Bearer {small.token}\r\n{MULTIPART}\r\n"
    found = error(small.raw(head.encode() + b"Transfer-Encoding: chunked\r\n\r\n" + chunked(59_000)))
    assert (found["type"], found["name"]) == ("Limit", "request_bytes")
    head = head.replace("/api/photos", "/api/calc").replace(MULTIPART, JSON)
    endless = b"".join(b"2710\r\n" + b" " * 10_000 + b"\r\n" for _ in range(10))
    assert error(small.raw(head.encode() + b"Transfer-Encoding: chunked\r\n\r\n" + endless))["name"] == "json_bytes"


def test_a_login_over_its_limit(small):
    headers = {"content-type": "application/x-www-form-urlencoded"}
    assert (
        error(small.client.post("/login", content=b"secret=" + b"x" * 40_000, headers=headers))["name"] == "json_bytes"
    )


def test_too_many_parts(server):
    tiny = picture(9, 9)
    for parts in ([part(b"1", file=None)] * 33, [part(tiny)] * 33, [part(tiny)] * 17 + [part(b"1", file=None)] * 16):
        found = error(server.ask("POST /api/photos", MULTIPART, body=b"".join(parts) + b"--x--\r\n"))
        assert (found["type"], found["name"]) == ("Limit", "parts") and "32" in found["message"]
    good = b"".join([part(b"1", file=None)] * 31 + [part(tiny)]) + b"--x--\r\n"
    assert server.ask("POST /api/photos", MULTIPART, body=good).status == 201


@pytest.mark.parametrize(
    "headers",
    [["X: " + "a" * 9_000], ["X: " + "a" * 5_000], ["X: " + "a" * 3_000] * 3, [f"X{i}: a" for i in range(1_000)], ["X" * 9_000 + ": a"]],
    ids=["one", "one line", "three", "many", "name"],
)  # fmt: skip
def test_headers_of_a_part_that_are_too_long(server, headers):
    found = error(server.ask("POST /api/photos", MULTIPART, body=part(picture(9, 9), *headers) + b"--x--\r\n"))
    assert (found["type"], found["name"]) == ("Limit", "part_header_bytes")


def test_a_part_that_is_no_file_is_not_kept_without_end(server):
    body = part(b"x" * 2 * 2**20, file=None) + b"--x--\r\n"
    assert server.ask("POST /api/photos", MULTIPART, body=body).status == 422


# -- JSON ------------------------------------------------------------------------------------------------


def send(server, text: bytes | str, path: str = "/api/calc") -> httpx.Response:
    return server.client.post(path, content=text, headers={"content-type": "application/json"})


def test_json_over_its_limit(server):
    text = json.dumps({**CALC, "focal": "x" * 2**21})
    found = error(send(server, text))
    assert (found["type"], found["name"]) == ("Limit", "json_bytes")
    assert send(server, json.dumps(CALC) + " " * (2**21 - 200)).status_code == 200


@pytest.mark.parametrize(
    "text", ["[" * 33 + "]" * 33, '{"a":' * 33 + "1" + "}" * 33, "[" * 100_000, '["[[[", ' + "[" * 32 + "]" * 33]
)
def test_json_nested_too_deep(server, text):
    found = error(send(server, text))
    assert (found["type"], found["name"]) == ("Limit", "json_depth") and "32" in found["message"]


def test_brackets_in_a_string_are_no_nesting(server):
    said = {"inputs": {"camera": "[" * 100 + '"\\"' + "{" * 100}}
    assert error(send(server, json.dumps(said), "/api/measure/known_size"), 422)["name"] in ("camera", "inputs")
    assert not depth_over(b'["' + rb"\"[[[" * 50 + b'"]', 2)
    assert depth_over(b'["a\\\\", [[]]]', 2) and not depth_over(b'["a\\\\", []]', 2)


@pytest.mark.parametrize(
    "text", [b'"' + rb"\"" * 500_000, b'"' + b"\\\n" * 500_000, b'"' + b"[" * 1_000_000, rb"\"" * 500_000]
)
def test_depth_takes_no_time_whatever_the_text(text):
    began = time.perf_counter()
    depth_over(b"[" * 20 + b"{" * 20 + b"]" * 20 + text, 32)
    assert time.perf_counter() - began < 2


@pytest.mark.parametrize(
    ("text", "said"),
    [(b'{"level": NaN}', "NaN"), (b'{"level": Infinity}', "Infinity"), (b'{"level": -Infinity}', "Infinity"),
     (b'{"level": 1e999}', "1e999"),
     (b'{"level": ' + b"9" * 400 + b"}", "digits"), (b'{"level": ' + b"9" * 100_000 + b"}", "digits"), (b"\xff\xfe{\x00}\x00", "UTF-8"),
     (b'{"focal": "\xff"}', "UTF-8"), (b'{"focal": "1", "focal": "2"}', "twice"), (b'{"focal": "\\ud800"}', "surrogate"), (b"{", "JSON"),
     (b"", None), (b"\xef\xbb\xbf{}", "JSON"), (b'{"focal": "\x00"}', "JSON"), (b"{'focal': 1}", "JSON"), (b"{} {}", "JSON")],
)  # fmt: skip
def test_only_json_that_all_read_alike(server, text, said):
    found = error(send(server, text), 422 if said is None else 400)
    assert found["name"] == "body" and (said or "") in found["message"]


@pytest.mark.parametrize("text", ["null", "[]", "5", '"x"', "true"])
def test_json_that_is_no_object(server, text):
    assert error(send(server, text), 422)["name"] == "body"


def test_a_calibration_file_over_its_limit(small):
    held = small.photo(picture(60, 40))
    body = {"photo": held["id"], "camera": {"name": "a.json", "content": "é" * 1001}}
    found = error(small.client.post("/api/camera", json=body))
    assert (found["type"], found["name"]) == ("Limit", "calibration_bytes")


# -- pictures --------------------------------------------------------------------------------------------


BOMBS = {
    "a head of 4 gigapixels": png(65_535, 65_535),
    "a head of the greatest size": png(2**31 - 1, 2**31 - 1),
    "a flat PNG": flat(2_001, 2_000),
    "a flat TIFF": flat(2_001, 2_000, form="TIFF", compression="group4"),
    "a flat JPEG": flat(2_001, 2_000, "L", "JPEG", quality=5),
    "a flat WebP": flat(2_001, 2_000, "RGB", "WEBP", lossless=True),
}


@pytest.mark.parametrize("name", BOMBS)
def test_more_pixels_than_the_limit(small, name):
    found = error(small.send(BOMBS[name], "bomb.png"), 422)
    assert found["name"] == "pixels" and "million" in found["message"] and "bomb.png" in found["message"]


@pytest.mark.parametrize(
    "data",
    [png(100, 100, zlib.compress(bytes(2**24), 9)),
     png(100, 100, zlib.compress(bytes(100 * 101)), (b"iTXt", b"a\0\1\0\0\0" + zlib.compress(bytes(2**24)))),
     png(100, 100, zlib.compress(bytes(100 * 101)), (b"iCCP", b"a\0\0" + zlib.compress(bytes(2**25)))),
     png(100, 100, zlib.compress(bytes(100 * 101)), (b"zTXt", b"a\0\0" + zlib.compress(bytes(2**25)))), png(0, 0), png(1, 0)],
    ids=["pixels", "iTXt", "iCCP", "zTXt", "nothing", "a line"],
)  # fmt: skip
def test_more_inside_than_outside(small, data):
    """It is decoded or refused, with the memory that its pixels need."""
    answer = small.send(data, "bomb.png")
    assert answer.status_code in (201, 422), answer.text
    assert small.client.get("/api/presets").status_code == 200


def test_a_limit_on_processor_time(tmp_path):
    with serving(tmp_path, "--limit", "cpu_s=1") as own:
        found = error(own.send(flat(15_000, 14_000), "slow.png"), 422)
        assert found["name"] == "cpu_s" and "1 s" in found["message"]
        assert own.children() == [] and not list(own.temp.glob("*/*"))
        assert own.send(picture(50, 40)).status_code == 201


def test_a_limit_on_time(tmp_path):
    with serving(tmp_path, "--limit", "wall_s=0.02", "--limit", "job_s=1") as own:
        found = error(own.send(picture(50, 40), "slow.png"), 422)
        assert found["name"] == "wall_s" and "0.02 s" in found["message"]
        assert own.children() == [] and not list(own.temp.glob("*/*"))


def test_a_limit_on_memory(tmp_path):
    with serving(tmp_path, "--limit", f"memory_bytes={700 * 2**20}") as own:
        found = error(own.send(flat(16_000, 15_000), "large.png"), 422)
        assert found["name"] == "memory_bytes" and "700 MiB" in found["message"]
        assert own.send(picture(50, 40)).status_code == 201
    shutil.rmtree(tmp_path)
    with serving(tmp_path, "--limit", f"memory_bytes={40 * 2**20}") as own:
        assert error(own.send(picture(50, 40), "a.png"), 422)["name"] == "memory_bytes"


# -- how many ------------------------------------------------------------------------------------------


def test_more_than_may_wait_are_sent_away(tmp_path):
    with serving(tmp_path, "--limit", "at_once=1", "--limit", "queue=1") as own:
        body = {
            "detector": "markers",
            "photo": own.photo(picture(2000, 1600, "JPEG", seed=3, quality=80), "a.jpg")["id"],
        }
        jobs = [own.client.post("/api/jobs", json=body).json()["id"] for _ in range(2)]
        assert until(lambda: len(own.children()) == 1)
        wait = own.client.post("/api/detect/markers", json={"photo": body["photo"]})
        for answer in (own.client.post("/api/jobs", json=body), wait, own.send(picture(40, 30))):
            assert answer.status_code == 503, answer.text
            assert int(answer.headers["retry-after"]) > 0
            assert answer.json()["error"]["type"] == "Busy" and "waiting" in answer.json()["error"]["message"]
        assert len(own.children()) == 1
        assert own.client.post("/api/calc", json=CALC).status_code == 200  # numbers need no place
        own.client.delete(f"/api/jobs/{jobs[0]}")
        assert until(lambda: own.client.get(f"/api/jobs/{jobs[1]}").json()["progress"] > 0)  # the next one's turn
        own.client.delete(f"/api/jobs/{jobs[1]}")
        assert until(lambda: own.send(picture(40, 30)).status_code == 201)


@pytest.fixture
def clock(monkeypatch):
    """A clock that a test moves."""
    now = [1000.0]
    monkeypatch.setattr(photos.time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def few(tmp_path):
    """Photos of a server that holds three for 60 s, without a server."""
    limits = Limits(photos=3, idle_s=60)
    found = photos.Photos(limits, Children(limits))

    def add(seed: int, kept: bool = False) -> str:
        file = tmp_path / f"{seed}.png"
        file.write_bytes(picture(50, 40, seed=seed))
        return awaited(found.add(file, file.name, kept=kept)).id

    yield found, add
    found.close()
    assert not found.folder.exists()


def test_photos_that_no_page_shows_are_dropped(few, clock):
    held, add = few
    shown, left, kept = add(1), add(2), add(3, kept=True)
    folders = [held.held[one].folder for one in (shown, left)]
    for _ in range(3):
        clock[0] += 30
        assert held.find(shown)
        held.sweep()
    assert set(held.held) == {shown, kept}
    assert [folder.exists() for folder in folders] == [True, False]


def test_the_longest_unasked_for_goes_where_there_are_too_many(few, clock):
    held, add = few
    ids = []
    for seed in range(1, 5):
        clock[0] += 1
        ids.append(add(seed, kept=seed == 2))
    assert list(held.held) == ids[1:]
    clock[0] += 1
    held.find(ids[2])
    ids.append(add(5))
    assert list(held.held) == [ids[1], ids[2], ids[4]]


def test_a_server_drops_photos_by_itself(tmp_path):
    with serving(tmp_path, "--limit", "idle_s=0.1") as own:
        left = own.photo(picture(50, 40))
        assert until(lambda: own.client.post("/api/photos/keep", json={"photos": []}).is_success
                     and own.client.get("/api/photos").json() == {"photos": []})  # fmt: skip
        assert own.client.get(f"/api/photos/{left['id']}").status_code == 404
        assert not list(own.temp.glob("*/*"))


def test_nothing_stays_behind(tmp_path, examples):
    """After a friendly end, with a job that runs and a page that watches it."""
    with serving(tmp_path) as own:
        held = own.photo(picture(2000, 1600, "JPEG", seed=3, quality=80), "large.jpg")
        [folder] = own.temp.iterdir()
        assert folder.stat().st_mode & 0o077 == 0  # nobody else looks in
        job = own.client.post("/api/jobs", json={"detector": "markers", "photo": held["id"]}).json()["id"]
        with socket.create_connection(("127.0.0.1", own.port), 20) as watching:
            head = (
                f"GET /api/jobs/{job}/events HTTP/1.1\r\nHost: {own.host}\r\nAuthorization: Bearer {own.token}\r\n\r\n"
            )
            watching.sendall(head.encode())
            assert until(own.children)
            [child] = own.children()
            own.process.terminate()
            assert own.process.wait(15) is not None
            read_answer(watching)
        assert until(lambda: not alive(child))
        assert list(own.temp.iterdir()) == []
        assert "Traceback" not in own.log.read_text()


def test_a_server_that_is_killed_takes_its_children_along(tmp_path):
    if sys.platform != "linux":
        pytest.skip("Linux only")
    with serving(tmp_path) as own:
        held = own.photo(picture(2000, 1600, "JPEG", seed=3, quality=80), "large.jpg")
        job = own.client.post("/api/jobs", json={"detector": "markers", "photo": held["id"]}).json()["id"]
        assert until(lambda: own.client.get(f"/api/jobs/{job}").json()["progress"] > 0)
        [child] = own.children()
        own.process.kill()
        own.process.wait()
        assert until(lambda: not alive(child), 3)


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


# -- names -----------------------------------------------------------------------------------------------


NAMES = {
    '<img src=x onerror="alert(1)">.png': None, "../../etc/passwd": "passwd", "/etc/cron.d/x.png": "x.png", "C:\\a\\b.png": "b.png",
    "a\x00b\x1b[31m\x7f\r\nSet-Cookie: x.png": "a b [31m Set-Cookie: x.png", "": "photo", ".": ".", "..": "..", "/": "photo",
    "a" * 4000 + ".png": "a" * 200, "\u202egnp.exe": "gnp.exe", "名前 é.png": "名前 é.png", "a;b'c`$(x)|.png": "a;b'c`$(x)|.png",
    "-rf.png": "-rf.png", "%00%2e%2e.png": "%00%2e%2e.png",
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES, ids=lambda name: ascii(name)[:30])
def test_a_hostile_name_is_only_text(name):
    expected = NAMES[name]
    assert shown_name(name) == (name if expected is None else expected)
    assert shown_name(name).isprintable() and 0 < len(shown_name(name)) <= 200


@pytest.mark.parametrize("name", [name for name in NAMES if name], ids=lambda name: ascii(name)[:30])
def test_a_hostile_name_goes_nowhere(server, name):
    before = set(server.temp.glob("*/*"))
    escaped = name.replace('"', "%22").replace("\r\n", "%0D%0A")
    body = part(picture(32, 24, seed=50), file=escaped) + b"--x--\r\n"
    answer = server.ask("POST /api/photos", MULTIPART, body=body)
    assert answer.status == 201, answer.body
    held = json.loads(answer.body)["photos"][0]
    assert "/" not in held["name"] and held["name"].isprintable() and len(held["name"]) <= 200
    assert answer.get("set-cookie") is None and answer.get("content-type") == "application/json"
    added = set(server.temp.glob("*/*")) - before
    assert len(added) <= 1
    wrong = server.ask("POST /api/photos", MULTIPART, body=part(b"x", file=escaped) + b"--x--\r\n")
    assert wrong.status == 422 and wrong.error["message"].isprintable()
    server.client.delete(f"/api/photos/{held['id']}")


def test_a_hostile_name_and_label_in_every_report(server):
    held = server.photo(picture(32, 24, seed=52), '<img src=x onerror="alert(1)">&.png')
    items = [{"method": "known_size", "inputs": {"ends": "2,2;20,2", "size": "20"}, "label": "<b>x</b>&"}]
    sheet = {"photo": held["id"], "camera": "f=100px", "items": items}
    for form in ("pdf", "csv", "text", "overlay"):
        assert server.client.post(f"/api/measure?format={form}", json=sheet).status_code == 200


@pytest.mark.parametrize("name", [b"\xff\xfe.png", b"a\xed\xa0\x80.png"])
def test_a_name_that_is_no_text(server, name):
    body = part(picture(32, 24, seed=51), file="NAME").replace(b"NAME", name) + b"--x--\r\n"
    assert server.ask("POST /api/photos", MULTIPART, body=body).status == 201


# -- the child -------------------------------------------------------------------------------------------


def in_child(code: str, folder: Path = Path()) -> str:
    """What code prints in a process under the child's limits."""
    start = ("from subtense.web.child import limit\n"
             "limit({'memory_bytes': 2**31, 'cpu_s': 20, 'file_bytes': 10**6})\n"
             "def tried(what):\n"
             "    try:\n        what()\n    except Exception as error:\n        return getattr(error, 'errno', type(error).__name__)\n"
             "    return 'done'\n")  # fmt: skip
    ended = subprocess.run(
        [sys.executable, "-I", "-c", start + code], cwd=folder, capture_output=True, text=True, timeout=60
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.strip()


linux = pytest.mark.skipif(sys.platform != "linux", reason="seccomp is Linux's")


@linux
def test_the_child_has_no_network():
    code = "import socket\nprint(*(tried(lambda: socket.socket(f)) for f in (socket.AF_INET, socket.AF_INET6, socket.AF_UNIX)))"
    assert in_child(code) == "1 1 1"
    assert in_child("import socket\nprint(tried(lambda: socket.create_connection(('127.0.0.1', 9))))") == "1"


@linux
def test_the_child_starts_no_program():
    assert in_child("import os\nprint(tried(lambda: os.execv('/bin/true', ['true'])))") == "1"
    assert in_child("import subprocess\nprint(tried(lambda: subprocess.run(['/bin/true'])))") == "1"


@linux
def test_the_child_reaches_no_network_or_process_by_another_door():
    """io_uring opens sockets too; ptrace would borrow those of the server."""
    code = ("import ctypes\nlibc = ctypes.CDLL(None, use_errno=True)\n"
            "def call(*words):\n    ctypes.set_errno(0)\n    libc.syscall(*words)\n    return ctypes.get_errno()\n"
            "import platform\nx86 = platform.machine() == 'x86_64'\n"
            "print(call(425, 1, 0), call(438, 0, 0, 0), "
            "call(101 if x86 else 117, 16, 1, 0, 0), call(310 if x86 else 270, 1, 0, 0, 0, 0, 0),"
            " call(311 if x86 else 271, 1, 0, 0, 0, 0, 0), call(0x40000029, 2, 1, 0) if x86 else 1)")  # fmt: skip
    assert in_child(code) == "1 1 1 1 1 1"


@linux
def test_the_child_ends_when_the_server_does():
    """Whatever it is at: PR_GET_PDEATHSIG says SIGKILL."""
    code = "import ctypes\nfound = ctypes.c_int()\nctypes.CDLL(None).prctl(2, ctypes.byref(found), 0, 0, 0)\nprint(found.value)"
    assert in_child(code) == "9"


def test_the_child_writes_no_large_file_and_opens_not_many(tmp_path):
    assert in_child("print(tried(lambda: open('a', 'wb').write(bytes(2 * 10**6))))", tmp_path) == "27"  # EFBIG
    assert in_child("print(tried(lambda: [open('/dev/null') for _ in range(100)]))") == "24"  # EMFILE
    assert in_child("print(tried(lambda: bytearray(2**32)))") == "MemoryError"


@linux
def test_the_child_writes_in_its_own_folder_only(tmp_path):
    own, other = tmp_path / "own", tmp_path / "other"
    own.mkdir()
    other.mkdir()
    (other / "there").write_text("kept")
    inside = "import os\nopen('a', 'w').write('x')\nos.mkdir('b')\n"
    inside += "os.rename('a', 'b/a')\nopen('b/a', 'a').truncate(0)\nos.unlink('b/a')\nprint('fine')"
    assert in_child(inside, own) == "fine"
    if (
        in_child(
            f"from pathlib import Path\nfrom subtense.web.child import write_only_in\nprint(write_only_in(Path({str(own)!r})))",
            own,
        )
        != "True"
    ):
        pytest.skip("this kernel has no Landlock")
    for what in ("open('../other/new', 'w')", "open('../other/there', 'w')", "open('../other/there', 'a')", "os.unlink('../other/there')",
                 "os.mkdir('../other/x')", "os.truncate('../other/there', 0)", "os.symlink('a', '../other/s')",
                 "os.rename('../other/there', 'mine')"):  # fmt: skip
        assert in_child(f"import os\nprint(tried(lambda: {what}))", own) in ("13", "18"), what  # EACCES, EXDEV
    assert (other / "there").read_text() == "kept" and len(list(other.iterdir())) == 1
    assert in_child("print(open('/dev/null', 'w').write('lost'))", own) == "4"  # by which networks are silenced
