"""How fast the page is in a real browser, with a photo of 24 million pixels, and the server against an empty route.

Times of a page are absolute, since what a person waits for is. Run alone on the machine: `python benchmarks/page.py`.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

HERE = Path(__file__).parent
DOCUMENT = HERE.parent / "docs" / "benchmarks.md"
BEGIN, END = "<!-- page: begin -->", "<!-- page: end -->"
BROWSER = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
EMPTY = """
from fastapi import FastAPI
app = FastAPI()
@app.post("/")
def empty() -> dict[str, str]:
    return {}
"""


@dataclass(frozen=True)
class Figure:
    """One measured figure and its goal; `most` is an upper limit, else a lower one."""

    what: str
    value: float
    unit: str
    goal: float
    most: bool = True

    @property
    def met(self) -> bool:
        """Whether the goal is reached."""
        return self.value <= self.goal if self.most else self.value >= self.goal


# -- servers ---------------------------------------------------------------------------------------------


def free_port() -> int:
    """A port nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def running(command: list[str], port: int, **environment: str) -> Iterator[None]:
    """A server in a process of its own, once it listens."""
    process = subprocess.Popen(
        command, env={**os.environ, **environment}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(400):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 0.2):
                break
            time.sleep(0.05)
        time.sleep(0.5)
        yield
    finally:
        process.terminate()
        process.wait()


@contextlib.contextmanager
def ours(folder: str) -> Iterator[tuple[str, str]]:
    """Our server: address and token."""
    port = free_port()
    command = [str(Path(sys.executable).with_name("subtense")), "serve", "--no-browser", "--port", str(port)]
    with running(command, port, SUBTENSE_STATE=folder):
        yield f"http://127.0.0.1:{port}", (Path(folder) / "token").read_text()


# -- requests per second ---------------------------------------------------------------------------------


async def _asking(port: int, requests: list[bytes], seconds: float) -> int:
    """How many requests one connection gets answered, the next sent when the one before is."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    count, until = 0, time.perf_counter() + seconds
    while time.perf_counter() < until:
        writer.write(requests[count % len(requests)])
        head = await reader.readuntil(b"\r\n\r\n")
        if not head.startswith(b"HTTP/1.1 200"):
            raise SystemExit(head.decode("latin-1"))
        length = re.search(rb"content-length: (\d+)", head)
        assert length is not None
        await reader.readexactly(int(length.group(1)))
        count += 1
    writer.close()
    return count


def per_second(port: int, requests: list[bytes], connections: int = 8, seconds: float = 4.0) -> float:
    """Requests per second over some connections."""

    async def all_of_them() -> int:
        return sum(await asyncio.gather(*(_asking(port, requests, seconds) for _ in range(connections))))

    return asyncio.run(all_of_them()) / seconds


def posted(path: str, port: int, body: dict[str, Any], token: str = "") -> bytes:
    """A request as bytes."""
    content = json.dumps(body).encode()
    lines = [
        f"POST {path} HTTP/1.1",
        f"Host: 127.0.0.1:{port}",
        "Content-Type: application/json",
        f"Content-Length: {len(content)}",
    ]
    return "\r\n".join([*lines, *([f"Authorization: Bearer {token}"] if token else []), "", ""]).encode() + content


def throughput(address: str, token: str, folder: str) -> list[Figure]:
    """POST /api/calc with numbers that are new each time, against an empty route, by turns."""
    (Path(folder) / "empty.py").write_text(EMPTY)
    port, other = int(address.rpartition(":")[2]), free_port()
    bodies = [{"focal": "35", "sensor_width": "14.1", "image_width": "4096", "size": f"{200 + i * 0.01:.2f}", "extent": f"{150 + i % 997}"}
              for i in range(20_000)]  # fmt: skip
    requests = [posted("/api/calc", port, body, token) for body in bodies]
    command = [
        sys.executable,
        "-m",
        "uvicorn",
        "empty:app",
        "--app-dir",
        folder,
        "--port",
        str(other),
        "--log-level",
        "error",
    ]
    with running(command, other):
        ratios, rates = [], []
        for turn in range(5):
            part = requests[turn * 4000 : (turn + 1) * 4000]
            calc, empty = per_second(port, part), per_second(other, [posted("/", other, bodies[0])])
            rates.append((calc, empty))
            ratios.append(calc / empty)
    calc, empty = (median(column) for column in zip(*rates, strict=True))
    name = f"`POST /api/calc`, {calc:.0f} requests a second, to an empty FastAPI route, {empty:.0f}"
    return [Figure(name, median(ratios), "", 0.5, most=False)]


# -- the page --------------------------------------------------------------------------------------------

FRAMES = "window.frames=[];(function tick(t){window.frames.push(t);requestAnimationFrame(tick)})(performance.now())"
USABLE = """(function look() {
  if (document.querySelector('[data-testid=value]')?.textContent === '13.56') window.usable = performance.now()
  else requestAnimationFrame(look)
})()"""
KEY_TO_PAINT = """() => new Promise(resolve => {
  const field = document.querySelector('#extent'), shown = document.querySelector('[data-testid=nominal]'), before = shown.textContent
  const start = performance.now()
  const painted = () => {  // a message that is sent in a frame arrives when that is painted
    const channel = new MessageChannel()
    channel.port1.onmessage = () => resolve(performance.now() - start)
    channel.port2.postMessage(0)
  }
  new MutationObserver((_, observer) => {
    if (shown.textContent === before) return
    observer.disconnect()
    requestAnimationFrame(painted)
  }).observe(shown, {characterData: true, childList: true, subtree: true})
  field.value = String(100 + Math.floor(Math.random() * 3000)); field.dispatchEvent(new InputEvent('input', {bubbles: true}))
})"""


def calculator(browser: Any, address: str, token: str) -> list[Figure]:
    """Until the calculator can be used, what that transfers, and from a key to the painted answer."""
    waits, sizes, keys = [], [], []
    for _ in range(7):
        context = browser.new_context(viewport={"width": 1280, "height": 860})
        context.add_cookies([{"name": f"subtense_{address.rpartition(':')[2]}", "value": token, "url": address}])
        page = context.new_page()
        session = context.new_cdp_session(page)
        session.send("Network.enable")
        received: list[int] = []
        session.on(
            "Network.loadingFinished", lambda event, received=received: received.append(event["encodedDataLength"])
        )
        page.add_init_script(USABLE)
        page.goto(address + "/")
        page.wait_for_timeout(1200)
        usable = page.evaluate("window.usable")
        waits.append(usable / 1000)
        sizes.append(sum(received))  # with what loads behind it
        for _ in range(9):  # at the pace of a quick typist
            page.wait_for_timeout(120)
            keys.append(page.evaluate(KEY_TO_PAINT))
        context.close()
    return [
        Figure("calculator: usable after", median(waits), "s", 0.6),
        Figure("calculator: transferred, chart and explanation included", max(sizes) / 1000, "kB", 150),
        Figure("key to paint, median", median(keys), "ms", 30),
    ]


def photo_of_24_mp(path: Path) -> None:
    """6000 x 4000 px with detail in it, and a camera."""
    from PIL import Image
    from PIL.TiffImagePlugin import IFDRational

    rng = np.random.default_rng(1)
    coarse = Image.fromarray(rng.integers(0, 256, (500, 750, 3), np.uint8)).resize(
        (6000, 4000), Image.Resampling.BICUBIC
    )
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x920A: IFDRational(24, 1), 0xA405: 24})
    coarse.save(path, quality=90, exif=exif)


def stage(browser: Any, address: str, token: str, photo: Path) -> list[Figure]:
    """The first view after decoding, and frames while a handle is dragged, the picture zoomed and moved."""
    page = browser.new_page(viewport={"width": 1280, "height": 860})
    page.goto(f"{address}/measure?token={token}")
    page.locator("input[type=file]").first.set_input_files(photo)
    page.locator("[data-testid=stage] canvas").first.wait_for()
    page.wait_for_timeout(2500)
    first = page.evaluate("""() => {
      const all = performance.getEntriesByType('resource'), decoded = all.find(e => e.name.endsWith('/api/photos') && e.encodedBodySize)
      const sent = all.filter(e => e.name.endsWith('/api/photos')).map(e => e.responseEnd).sort((a, b) => b - a)[0]
      const tiles = all.filter(e => e.name.includes('/tiles/')).map(e => e.responseEnd)
      return (Math.max(...tiles) - sent) / 1000 }""")
    box = page.locator("[data-testid=stage]").bounding_box()
    page.get_by_role("button", name="Known size", exact=True).click()
    for x in (300, 500):
        page.mouse.click(box["x"] + x, box["y"] + 300)
    page.keyboard.type("200 mm")
    page.wait_for_timeout(800)
    page.evaluate(FRAMES)
    session = page.context.new_cdp_session(page)
    figures = [
        Figure("first view after decoding", first, "s", 0.6),
        Figure("handle behind the pointer", _lag(page, box), "px", 0.5),
    ]
    for name, work in (("dragging a handle", _drag), ("zooming", _zoom), ("moving the picture", _pan)):
        page.wait_for_timeout(500)
        page.evaluate("window.frames.length = 0")
        work(page, session, box)
        steps = np.diff(page.evaluate("window.frames"))[2:]
        figures += [Figure(f"frames while {name}, median", float(np.median(steps)), "ms", 17),
                    Figure(f"frames while {name}, 95 %", float(np.quantile(steps, 0.95)), "ms", 25)]  # fmt: skip
    page.close()
    return figures


def _lag(page: Any, box: dict[str, float]) -> float:
    """The largest distance of a dragged handle from the pointer, where the pointer rests."""
    handle = page.locator("[data-handle='A-ends-1']")
    page.mouse.move(box["x"] + 500, box["y"] + 300)
    page.mouse.down()
    worst = 0.0
    for x, y in ((520, 340), (610, 420), (333, 222), (700, 500), (500, 300)):
        page.mouse.move(box["x"] + x, box["y"] + y)
        spot = handle.bounding_box()
        worst = max(
            worst, abs(spot["x"] + spot["width"] / 2 - box["x"] - x), abs(spot["y"] + spot["height"] / 2 - box["y"] - y)
        )
    page.mouse.up()
    return worst


def _mouse(session: Any, kind: str, x: float, y: float, **more: Any) -> None:
    session.send("Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, "button": "left", "buttons": 1, **more})


def _moving(page: Any, session: Any, places: list[tuple[float, float]]) -> None:
    """Press, move through places at about 60 a second, release."""
    _mouse(session, "mousePressed", *places[0], clickCount=1)
    for x, y in places:
        _mouse(session, "mouseMoved", x, y)
        page.wait_for_timeout(12)
    _mouse(session, "mouseReleased", *places[-1], clickCount=1)


def _drag(page: Any, session: Any, box: dict[str, float]) -> None:
    turns = np.linspace(0, 6, 150)
    places = [(box["x"] + 500 + 120 * float(np.sin(t)), box["y"] + 300 + 90 * float(np.sin(2 * t))) for t in turns]
    _moving(page, session, places)


def _zoom(page: Any, session: Any, box: dict[str, float]) -> None:
    for step in range(60):
        delta = -60 if step % 30 < 15 else 60
        session.send(
            "Input.dispatchMouseEvent",
            {"type": "mouseWheel", "x": box["x"] + 600, "y": box["y"] + 400, "deltaX": 0, "deltaY": delta},
        )
        page.wait_for_timeout(30)


def _pan(page: Any, session: Any, box: dict[str, float]) -> None:
    turns = np.linspace(0, 6, 150)
    places = [(box["x"] + 600 + 200 * float(np.sin(t)), box["y"] + 550 + 120 * float(np.sin(2 * t))) for t in turns]
    _moving(page, session, places)


# -- what is written down --------------------------------------------------------------------------------


def table(figures: list[Figure]) -> str:
    """As in the documentation."""
    lines = ["| what | measured | goal | |", "|---|---|---|---|"]
    for f in figures:
        sign = "≤" if f.most else "≥"
        lines.append(
            f"| {f.what} | {f.value:.3g} {f.unit} | {sign} {f.goal:g} {f.unit} | {'met' if f.met else 'MISSED'} |"
        )
    return "\n".join(lines).replace("  |", " |")


def main() -> None:
    """Measure, print, and renew the table of the documentation."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, ours(folder) as (address, token):
        photo = Path(folder) / "large.jpg"
        photo_of_24_mp(photo)
        figures = throughput(address, token, folder)
        with sync_playwright() as play:
            browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=BROWSER)
            figures += calculator(browser, address, token)
            figures += stage(browser, address, token, photo)
            browser.close()
    print(table(figures))
    (HERE / "page.json").write_text(
        json.dumps([{**asdict(f), "met": f.met} for f in figures], indent=1) + "\n", encoding="utf-8"
    )
    text = DOCUMENT.read_text(encoding="utf-8")
    DOCUMENT.write_text(
        re.sub(f"{BEGIN}.*{END}", lambda _: f"{BEGIN}\n{table(figures)}\n{END}", text, flags=re.DOTALL),
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
