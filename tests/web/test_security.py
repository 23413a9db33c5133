"""Every row of the table of what the server answers, on a page, a POST, a file, and an upgrade to WebSocket."""

import json
import os
import re
import subprocess

import httpx
import pytest
from running import STATIC, Server, awaited, command, free_port, needs_page, picture, serving

from subtense.web.app import create_app
from subtense.web.settings import Settings
from subtense.web.static import PAGES

JSON = "Content-Type: application/json"
CALC = json.dumps(
    {"focal": "35", "sensor_width": "14.1", "image_width": "4096", "size": "200", "extent": "150"}
).encode()
UPGRADE = ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13",
           "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==")  # fmt: skip


def assets() -> list[str]:
    return [f"/assets/{file.name}" for file in sorted((STATIC / "assets").glob("*"))[:1]]


@pytest.fixture(scope="module")
def tile(server) -> str:
    return f"/api/photos/{server.photo(picture(40, 30))['id']}/tiles/0/0_0.png"


@pytest.fixture(params=["page", "post", "asset", "tile", "socket"])
def ask(request, server, tile):
    """A way to ask, with further headers; and what a good answer to it is."""

    def page(*headers, **more):
        return server.ask("GET /", *headers, **more), {200, 503}

    def post(*headers, **more):
        return server.ask("POST /api/calc", JSON, *headers, body=CALC, **more), {200}

    def asset(*headers, **more):
        path = (assets() or ["/api/openapi.json"])[0]
        return server.ask(f"GET {path}", *headers, **more), {200}

    def tiles(*headers, **more):
        return server.ask(f"GET {tile}", *headers, **more), {200}

    def upgrade(*headers, **more):
        return server.ask("GET /ws", *UPGRADE, *headers, **more), {400}

    return {"page": page, "post": post, "asset": asset, "tile": tiles, "socket": upgrade}[request.param]


# -- the table -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["127.0.0.1", "[::1]", "localhost", "LOCALHOST"])
def test_its_own_names_are_answered(ask, server, name):
    answer, good = ask(host=f"{name}:{server.port}")
    assert answer.status in good


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:{port}", "127.0.0.1.nip.io:{port}", "0.0.0.0:{port}", "my-laptop:{port}", "my-laptop.local:{port}",
     "127.0.0.1", "127.0.0.1:{other}", "localhost.:{port}", "127.1:{port}", "2130706433:{port}", "localhost:{port}.evil.example",
     "evil.example#localhost:{port}", "user@localhost:{port}", "[::ffff:127.0.0.1]:{port}"],
)  # fmt: skip
def test_other_names_are_refused(ask, server, host):
    answer, _ = ask(host=host.format(port=server.port, other=server.port + 1))
    assert answer.status in (400, 403)
    if answer.status == 403:
        assert answer.error["name"] == "host"


def test_no_host_an_empty_one_and_two_are_refused(ask, server):
    assert ask(host=None)[0].status == 400
    assert ask("Host:", host=None)[0].status in (400, 403)
    assert ask(f"Host: {server.host}")[0].status == 400
    assert ask("Host: evil.example")[0].status == 400


def test_an_old_request_without_host_is_refused(server):
    line = f"GET /api/presets HTTP/1.0\r\nAuthorization: Bearer {server.token}\r\n\r\n"
    assert server.raw(line.encode()).status == 400


def test_without_the_token_nothing_is_answered(ask, server):
    assert ask(token=False)[0].status == 401
    for wrong in (
        "x",
        server.token[:-1],
        server.token + "x",
        server.token.upper(),
        "",
        "é",
        "\u00a0" + server.token[1:],
    ):
        assert ask(f"Authorization: Bearer {wrong}", token=False)[0].status == 401
        assert ask(f"Cookie: subtense_{server.port}={wrong}", token=False)[0].status == 401
    assert ask(f"Authorization: Basic {server.token}", token=False)[0].status == 401
    assert ask(f"Cookie: subtense_{server.port + 1}={server.token}", token=False)[0].status == 401


def test_the_cookie_is_as_good_as_the_header(ask, server):
    answer, good = ask(f"Cookie: a=b; subtense_{server.port}={server.token}", token=False)
    assert answer.status in good


@pytest.mark.parametrize(
    "origin",
    ["https://evil.example", "null", "http://localhost:{other}", "http://127.0.0.1:{other}", "http://127.0.0.1",
     "https://127.0.0.1:{port}", "http://localhost:{port}", "http://127.0.0.1:{port}.evil.example", "", "file://", "*"],
)  # fmt: skip
def test_other_origins_are_refused(ask, server, origin):
    """The request is addressed to 127.0.0.1, so even localhost is another origin."""
    answer, _ = ask(f"Origin: {origin.format(port=server.port, other=server.port + 1)}")
    assert answer.status == 403
    assert answer.error["name"] == "origin"
    assert answer.get("access-control-allow-origin") is None


def test_two_origins_are_refused(ask, server):
    assert ask(f"Origin: {server.address}", "Origin: https://evil.example")[0].status == 403
    assert ask("Origin: https://evil.example", f"Origin: {server.address}")[0].status == 403


def test_its_own_origin_is_answered(ask, server):
    answer, good = ask(f"Origin: {server.address}", "Sec-Fetch-Site: same-origin")
    assert answer.status in good


@pytest.mark.parametrize("site", ["cross-site", "same-site", "CROSS-SITE", "anything"])
@pytest.mark.parametrize("mode", ["cors", "no-cors", "navigate"])
def test_an_unsafe_request_from_another_site_is_refused(server, site, mode):
    for line in ("POST /api/calc", "POST /api/photos", "POST /login", "DELETE /api/jobs/aaaaaaaaaaaaaaaa"):
        answer = server.ask(line, JSON, f"Sec-Fetch-Site: {site}", f"Sec-Fetch-Mode: {mode}", body=CALC)
        assert (answer.status, answer.error["name"]) == (403, "origin")


def test_a_picture_or_script_of_another_site_gets_nothing_of_the_api(server, tile):
    for path in (tile, "/api/presets", "/api/openapi.json"):
        answer = server.ask(f"GET {path}", "Sec-Fetch-Site: cross-site", "Sec-Fetch-Mode: no-cors")
        assert answer.status == 403


def test_a_link_from_another_site_opens_the_page(server):
    answer = server.ask("GET /", "Sec-Fetch-Site: cross-site", "Sec-Fetch-Mode: navigate", "Accept: text/html")
    assert answer.status in (200, 503)


def test_curl_with_the_token_is_answered(ask):
    answer, good = ask()
    assert answer.status in good


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x", "", "text/json",
             "application/jsonp", "text/plain; application/json", "application/json-patch"],
)  # fmt: skip
def test_only_json_is_taken_as_json(server, kind):
    for path in (
        "/api/calc",
        "/api/measure",
        "/api/measure/known_size",
        "/api/camera",
        "/api/jobs",
        "/api/photos/keep",
    ):
        answer = server.ask(f"POST {path}", *([f"Content-Type: {kind}"] if kind else []), body=CALC)
        assert (answer.status, answer.error["name"]) == (415, "content-type")


def test_only_a_form_is_taken_as_a_photo(server):
    for kind in ("image/png", "application/json", "text/plain", "application/x-www-form-urlencoded"):
        assert server.ask("POST /api/photos", f"Content-Type: {kind}", body=picture(8, 8)).status == 415


@pytest.mark.parametrize("token", [True, False])
def test_a_preflight_is_never_allowed(server, token):
    for path in ("/api/calc", "/api/photos", "/", "/login"):
        for extra in ((), ("Access-Control-Request-Private-Network: true",)):
            answer = server.ask(f"OPTIONS {path}", "Origin: https://evil.example", "Access-Control-Request-Method: POST",
                                "Access-Control-Request-Headers: content-type", *extra, token=token)  # fmt: skip
            assert answer.status == 403
            assert not [name for name, _ in answer.headers if name.startswith("access-control")]


PATHS = [
    "/files/../../etc/passwd", "/../../../../etc/passwd", "/assets/../../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd",
    "/assets/%2e%2e%2f%2e%2e%2f%2e%2e%2fetc/passwd", "/..%5c..%5cetc%5cpasswd", "/..\\..\\etc\\passwd", "//etc/passwd",
    "/%2fetc/passwd", "/etc/passwd", "/index.html%00.png", "/%00", "/assets/%00", "/C:/Windows/win.ini", "/app.py",
    "/static/index.html", "/.git/config", "/%c0%ae%c0%ae/%c0%ae%c0%ae/etc/passwd", "/%252e%252e/etc/passwd", "/proc/self/environ",
    "/api/photos/..%2f..%2f..%2fetc%2fpasswd", "/api/photos/../../etc/passwd/tiles/0/0_0.png", "/api/../../../etc/passwd",
]  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_what_is_no_page_does_not_exist(server, path):
    answer = server.ask(f"GET {path}")
    assert answer.status in ((404, 422) if "/api/" in path else (404,))
    assert b"root:" not in answer.body and b"def create_app" not in answer.body


def test_the_whole_address_as_a_target_is_only_a_path(server):
    assert server.ask("GET http://evil.example/etc/passwd").status in (400, 403, 404)
    assert server.ask("GET file:///etc/passwd").status in (400, 403, 404)


def test_a_raw_nul_and_a_very_long_path_end_as_bad_requests(server):
    assert server.raw(f"GET /\0/etc/passwd HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode()).status in (400, 404)
    assert server.ask("GET /" + "a" * 10_000).status == 404
    assert server.raw(b"GET /" + b"a" * 200_000 + f" HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode()).status in (
        0,
        400,
    )
    assert server.client.get("/api/presets").status_code == 200


def test_a_link_in_the_folder_of_the_page_is_not_followed_out_of_it(tmp_path, monkeypatch):
    from subtense.web import static

    (tmp_path / "page" / "assets").mkdir(parents=True)
    (tmp_path / "secret.txt").write_text("secret")
    (tmp_path / "page" / "index.html").write_text("<p>page")
    (tmp_path / "page" / "assets" / "link.txt").symlink_to(tmp_path / "secret.txt")
    (tmp_path / "page" / "out").symlink_to(tmp_path, target_is_directory=True)
    monkeypatch.setattr(static, "FOLDER", tmp_path / "page")
    static.assets.cache_clear()
    try:
        assert set(static.assets()) == {"/", "/index.html"}
    finally:
        static.assets.cache_clear()


# -- WebSocket -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/", "/ws", "/api/jobs", "/api/presets", "/login"])
@pytest.mark.parametrize("token", [True, False])
def test_nothing_is_ever_upgraded(server, path, token):
    answer = server.ask(f"GET {path}", *UPGRADE, token=token)
    assert answer.status == (400 if token else 401)
    assert answer.get("upgrade") is None and answer.get("sec-websocket-accept") is None


def test_http_2_is_not_spoken(server):
    answer = server.ask(
        "GET /api/presets", "Connection: Upgrade, HTTP2-Settings", "Upgrade: h2c", "HTTP2-Settings: AAMAAABk"
    )
    assert answer.status == 200 and answer.get("upgrade") is None
    assert server.raw(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n").status in (0, 400)


def test_an_asgi_websocket_is_closed_before_it_opens():
    """Whatever server runs the application."""
    said = []

    async def send(message):
        said.append(message)

    async def receive():
        return {"type": "websocket.connect"}

    scope = {
        "type": "websocket",
        "path": "/",
        "headers": [(b"host", b"127.0.0.1:8517")],
        "query_string": b"",
        "scheme": "ws",
    }
    awaited(create_app(Settings("t" * 32))(scope, receive, send))
    assert [message["type"] for message in said] == ["websocket.close"]


# -- headers ---------------------------------------------------------------------------------------------


def every_kind(server, tile):
    yield server.ask("GET /")
    yield server.ask("GET /", "Accept: text/html", token=False)
    yield server.ask("GET /api/presets", token=False)
    yield server.ask("GET /api/presets")
    yield server.ask(f"GET {tile}")
    yield server.ask("GET /nothing")
    yield server.ask("GET /", host="evil.example")
    yield server.ask("GET /", "Origin: https://evil.example")
    yield server.ask(f"GET /?token={server.token}", token=False)
    yield server.ask("POST /api/calc", "Content-Type: text/plain", body=CALC)
    yield server.ask("POST /api/calc", JSON, body=b"{")
    yield server.ask("POST /api/calc", JSON, body=b"[" * 100)
    yield server.ask("POST /api/calc", JSON, body=b"{}")
    yield server.ask("POST /api/calc?format=pdf", JSON, body=CALC)
    yield server.ask("PUT /api/calc", JSON, body=CALC)
    yield server.ask("OPTIONS /api/calc", "Origin: https://evil.example")
    yield server.ask("GET /ws", *UPGRADE)
    yield server.ask(
        "POST /login", "Content-Type: application/x-www-form-urlencoded", body=b"secret=" + server.token.encode()
    )
    yield from (server.ask(f"GET {path}") for path in assets())


def test_every_answer_has_the_headers_that_shut_it_in(server, tile):
    seen = set()
    for answer in every_kind(server, tile):
        seen.add(answer.status)
        policy = answer.get("content-security-policy")
        assert policy is not None and len(answer.all("content-security-policy")) == 1, answer
        words = dict(part.strip().partition(" ")[::2] for part in policy.split(";"))
        assert (
            words["default-src"] == "'none'" and words["frame-ancestors"] == "'none'" and words["base-uri"] == "'none'"
        )
        assert words["form-action"] == "'self'"
        assert "unsafe" not in policy and "http" not in policy and "*" not in policy
        assert words.get("script-src", "'none'") in ("'self'", "'none'")
        assert answer.get("x-content-type-options") == "nosniff"
        assert answer.get("x-frame-options") == "DENY"
        assert answer.get("cross-origin-resource-policy") == answer.get("cross-origin-opener-policy") == "same-origin"
        assert answer.get("referrer-policy") == "same-origin"
        assert answer.get("server") is None
        assert not [name for name, _ in answer.headers if name.startswith("access-control")]
    assert seen >= {200, 303, 400, 401, 403, 404, 405, 413, 415, 422}


def test_an_answer_to_a_failure_has_them_too_and_tells_nothing():
    app = create_app(Settings("t" * 32))

    @app.get("/api/broken")
    def broken():
        raise RuntimeError("secret inside")

    app.router.routes.insert(0, app.router.routes.pop())
    transport = httpx.ASGITransport(app, raise_app_exceptions=False)

    async def ask():
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1:8517") as client:
            return await client.get("/api/broken", headers={"authorization": "Bearer " + "t" * 32})

    answer = awaited(ask())
    app.state.subtense.photos.close()
    assert answer.status_code == 500 and answer.json()["error"]["type"] == "Failure"
    assert "secret" not in answer.text
    assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]


def test_a_method_that_is_not_there_names_those_that_are(server):
    answer = server.ask("PUT /api/calc", JSON, body=CALC)
    assert answer.status == 405 and answer.get("allow") == "POST"


@needs_page
@pytest.mark.parametrize(
    "path", [path for path, name in PAGES.items() if name.endswith(".html") and (STATIC / name).is_file()]
)
def test_the_pages_hold_nothing_the_policy_forbids(server, path):
    answer = server.ask(f"GET {path}")
    text = answer.body.decode()
    assert answer.status == 200 and answer.get("content-type") == "text/html; charset=utf-8"
    assert not re.search(r"<script(?![^>]*\ssrc=)|\son\w+=|javascript:", text)
    places = re.findall(r"""(?:src|href)=["']?([^"'\s>]+)""", text)
    assert places and not [place for place in places if re.match(r"(\w+:)?//", place)]
    for place in places:
        assert server.client.get(place.partition("#")[0] or "/").status_code == 200, place


@needs_page
def test_the_page_is_asked_anew_and_its_parts_are_kept(server):
    assert server.ask("GET /").get("cache-control") == "no-cache"
    for path in assets():
        assert "immutable" in server.ask(f"GET {path}").get("cache-control")


# -- the token -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/", "/measure", "/api/presets"])
def test_the_token_leaves_the_address_on_first_use(server, path):
    answer = server.ask(f"GET {path}?token={server.token}", token=False)
    assert (answer.status, answer.get("location")) == (303, path)
    [cookie] = answer.all("set-cookie")
    words = [word.strip().lower() for word in cookie.split(";")]
    assert cookie.startswith(f"subtense_{server.port}={server.token};")
    assert {"httponly", "samesite=lax", "path=/"} <= set(words)
    assert not any(word.startswith("domain") for word in words)


def test_the_token_in_an_address_leads_nowhere_else(server):
    for path in (
        "//evil.example/",
        "/\\evil.example/",
        "/%2f%2fevil.example/",
        "/http://evil.example",
        "/%5cevil.example",
    ):
        answer = server.ask(f"GET {path}?token={server.token}", token=False)
        place = answer.get("location") or "/"
        assert place.startswith("/") and not place.startswith(("//", "/\\"))


def test_no_cookie_without_need(server, tile):
    for answer in every_kind(server, tile):
        if answer.get("set-cookie"):
            assert answer.status == 303


def test_a_wrong_token_in_an_address_is_refused(server):
    for wrong in ("", "x", server.token + "x", server.token[:-1]):
        answer = server.ask(f"GET /?token={wrong}", token=False)
        assert answer.status == 401 and answer.get("set-cookie") is None


def test_the_token_in_an_address_is_good_for_looking_only(server):
    assert server.ask(f"POST /api/calc?token={server.token}", JSON, token=False, body=CALC).status == 401
    assert server.ask(f"DELETE /api/photos/{'0' * 32}?token={server.token}", token=False).status == 401


def test_a_stranger_gets_a_form_without_scripts(server):
    answer = server.ask("GET /measure", "Accept: text/html,*/*;q=0.8", token=False)
    assert answer.status == 401 and answer.get("content-type").startswith("text/html")
    assert answer.get("cache-control") == "no-store"
    assert "script-src" not in answer.get("content-security-policy")
    text = answer.body.decode()
    assert '<form method="post" action="/login">' in text and "<script" not in text and server.token not in text


def test_a_stranger_gets_no_form_from_the_api(server):
    answer = server.ask("GET /api/presets", "Accept: text/html", token=False)
    assert answer.status == 401 and answer.error["name"] == "token"


def test_the_stored_token_is_for_its_owner_only(server):
    file = server.temp.parent / "state" / "token"
    assert file.stat().st_mode & 0o777 == 0o600 and len(server.token) >= 32
    assert f"?token={server.token}" in server.said


def test_wrong_attempts_are_slowed_and_then_stopped(tmp_path):
    form = {"content-type": "application/x-www-form-urlencoded"}
    with serving(tmp_path) as own, httpx.Client(base_url=own.address, headers=form) as client:
        for _ in range(10):
            answer = client.post("/login", content="secret=wrong")
            assert answer.status_code == 401 and "set-cookie" not in answer.headers
        late = client.post("/login", content=f"secret={own.token}")
        assert late.status_code == 429 and "set-cookie" not in late.headers
        assert own.client.get("/api/presets").status_code == 200  # who is in stays in


def test_the_form_lets_in(server):
    body = f"secret=+{server.token}%20".encode()
    answer = server.ask("POST /login", "Content-Type: application/x-www-form-urlencoded", f"Origin: {server.address}",
                        token=False, body=body)  # fmt: skip
    assert answer.status == 303 and answer.get("location") == "/"
    assert answer.get("set-cookie").startswith(f"subtense_{server.port}={server.token};")


def test_the_form_lets_in_from_a_real_browser(server, browser):
    """What a browser sends as Origin depends on the policy of the page that the form is in."""
    page = browser.new_page()
    page.goto(f"{server.address}/")
    page.get_by_label("Token").fill(server.token)
    with page.expect_response(lambda r: r.request.method == "POST") as posted:
        page.get_by_role("button").click()
    assert posted.value.status == 303
    names = {cookie["name"]: cookie for cookie in page.context.cookies()}
    assert names[f"subtense_{server.port}"]["httpOnly"]
    page.wait_for_url(re.compile(rf"^{server.address}/(#.*)?$"))
    page.close()


# -- other machines --------------------------------------------------------------------------------------


def run(*words, password=None, state="/nonexistent"):
    environment = {k: v for k, v in os.environ.items() if k != "SUBTENSE_PASSWORD"} | {"SUBTENSE_STATE": state}
    environment |= {} if password is None else {"SUBTENSE_PASSWORD": password}
    return subprocess.run(command("--no-browser", *words), env=environment, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("password", [None, "", "short"])
@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.1", "my-laptop"])
def test_other_machines_need_a_password(host, password):
    ended = run("--host", host, "--port", str(free_port()), password=password)
    assert ended.returncode == 2 and ended.stdout == ""
    assert ended.stderr.count("\n") == 1 and "SUBTENSE_PASSWORD" in ended.stderr


@pytest.fixture(scope="module")
def open_server(tmp_path_factory):
    words = ("--host", "0.0.0.0", "--name", "Measure.Local")
    with serving(tmp_path_factory.mktemp("open"), *words, password="a long password") as found:
        yield found


def enter(server: Server, said: str, host: str = "") -> object:
    return server.ask("POST /login", "Content-Type: application/x-www-form-urlencoded", host=host, token=False,
                      body=f"secret={said}".encode())  # fmt: skip


def test_with_a_password_it_warns_and_shows_no_token(open_server):
    assert "unencrypted" in open_server.said and "token=" not in open_server.said
    assert "a long password" not in open_server.said
    assert not (open_server.temp.parent / "state" / "token").exists()


def test_with_a_password_named_hosts_only(open_server):
    for host in ("0.0.0.0", "evil.example", "127.0.0.1.nip.io"):
        assert open_server.ask("GET /", host=f"{host}:{open_server.port}", token=False).status == 403
    for host in ("127.0.0.1", "measure.local", "MEASURE.LOCAL"):
        assert open_server.ask("GET /", host=f"{host}:{open_server.port}", token=False).status == 401


def test_with_a_password_only_that_opens(open_server):
    right = enter(open_server, "a+long+password")
    token = re.match(r"subtense_\d+=([^;]+);", right.get("set-cookie"))[1]
    assert right.status == 303 and "password" not in token
    for line in (f"GET /?token={token}", "GET /?token=a+long+password", "GET /?token="):
        answer = open_server.ask(line, "Accept: text/html", token=False)
        assert answer.status == 401 and answer.get("set-cookie") is None
        assert "Password" in answer.body.decode()
    assert open_server.ask("GET /api/presets", "Authorization: Bearer a long password", token=False).status == 401
    assert (
        open_server.ask("GET /api/presets", f"Cookie: subtense_{open_server.port}={token}", token=False).status == 200
    )
    assert enter(open_server, token).status == 401
    assert enter(open_server, "").status == 401


def test_an_address_of_this_machine_alone_needs_none(tmp_path):
    """The whole of 127.0.0.0/8 is loopback, and the address that is printed must be one that is answered."""
    from subtense.web.serve import settings_for

    for host in ("127.0.0.2", "::1", "localhost"):
        shown = f"[{host}]:8000" if ":" in host else f"{host}:8000"
        assert shown in settings_for(host, 8000, None).hosts
    assert "0.0.0.0:8000" not in settings_for("0.0.0.0", 8000, "a long password").hosts


def test_a_taken_port_is_one_line(server):
    ended = run("--port", str(server.port))
    assert ended.returncode == 2 and ended.stderr.count("\n") == 1 and "--port" in ended.stderr


def test_an_unknown_limit_is_one_line():
    for text in ("upload=5", "upload_bytes=x", "upload_bytes=-1", "cpu_s=0", "wall_s=nan"):
        ended = run("--limit", text)
        assert ended.returncode == 2 and ended.stderr.count("\n") == 1 and "--limit" in ended.stderr
