"""A real browser at the real page: every test fails on a request to elsewhere, a console message, or an error of the page."""

import re
import shutil
from dataclasses import dataclass, field

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Response, expect
from running import STATIC, Server

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
]  # fmt: skip
expect.set_options(timeout=15_000)  # a busy machine may take seconds for draws
SIZES = {"desktop": (1280, 860), "phone": (390, 800)}

in_browser = pytest.mark.skipif(
    CHROMIUM is None or not (STATIC / "index.html").is_file(),
    reason="needs Chromium (Debian: apt-get install chromium) and the built page",
)


@dataclass
class Visit:
    """One context of the browser, and what went wrong in it."""

    context: BrowserContext
    server: Server
    wrong: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    expected: str = r"^$"

    def open(self, path: str = "/") -> Page:
        """A page of the server, with its cookie."""
        page = self.context.new_page()
        page.on("console", lambda message: self.wrong.append(f"console {message.type}: {message.text}"))
        page.on("pageerror", lambda error: self.wrong.append(f"error: {error}"))
        page.on("response", self._note)
        page.on("request", lambda request: self._watch(request.url))
        if not self.context.cookies():
            page.goto(f"{self.server.address}/?token={self.server.token}")
        page.goto(self.server.address + path)
        return page

    def _watch(self, url: str) -> None:
        if not url.startswith((self.server.address, "blob:", "data:")):
            self.wrong.append(f"request to {url}")

    def _note(self, response: Response) -> None:
        """What the server refused, for the message of a test that fails by it."""
        if response.status >= 400:
            self.refused.append(f"{response.status} {response.url} {response.request.post_data}")

    def unexpected(self) -> list[str]:
        wrong = [text for text in self.wrong if not re.search(self.expected, text)]
        return [*wrong, *self.refused] if wrong else []


def visiting(browser: Browser, server: Server, size: str = "desktop", theme: str = "light") -> Visit:
    width, height = SIZES[size]
    phone = {"has_touch": True, "is_mobile": True} if size == "phone" else {}
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=theme, accept_downloads=True,
        permissions=["clipboard-read", "clipboard-write"], **phone,
    )  # fmt: skip
    context.set_default_timeout(15_000)
    return Visit(context, server)
