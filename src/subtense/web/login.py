"""The form that asks a stranger for the token or the password; one page without scripts."""

from __future__ import annotations

import base64
import hashlib

from starlette.responses import HTMLResponse

PATH = "/login"
_STYLE = """:root{color-scheme:light dark}body{margin:0;min-height:100vh;display:grid;place-items:center;background:Canvas;color:CanvasText;
font:16px/1.5 system-ui,sans-serif}main{max-width:26rem;padding:2rem}h1{font-size:1.3rem;font-weight:600;margin:0 0 .5rem}
label{display:block;margin:1.2rem 0 .3rem}input,button{font:inherit;padding:.55rem .8rem;border-radius:.5rem;border:1px solid #7a7f87}
input{width:100%;box-sizing:border-box}button{margin-top:.8rem;background:#0b57a4;border-color:#0b57a4;color:#fff}
code{font-family:ui-monospace,monospace}"""
_CSP = (
    "default-src 'none'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'; img-src data:; style-src 'sha256-"
    + base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
    + "'"
)
_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>subtense: {what} needed</title>
<meta name="viewport" content="width=device-width,initial-scale=1"><link rel="icon" href="data:,"><style>{style}</style></head>
<body><main><h1>subtense</h1><p role="status">{text}</p><form method="post" action="/login"><label for="secret">{label}</label>
<input id="secret" name="secret" type="password" autocomplete="current-password" required autofocus>
<button>Open</button></form></main></body></html>"""


def page(*, password: bool, message: str = "", status: int = 401) -> HTMLResponse:
    """The form; `message` replaces its first sentence."""
    if password:
        what, label, text = "password", "Password", "This page is opened with the password it was started with."
    else:
        what, label = "token", "Token"
        text = (
            "Open the address that <code>subtense serve</code> printed in the terminal, or paste the token in it here."
        )
    html = _PAGE.format(what=what, label=label, text=message or text, style=_STYLE)
    return HTMLResponse(html, status, {"content-security-policy": _CSP, "cache-control": "no-store"})


class Attempts:
    """Counts wrong secrets, so that they can't be tried by the thousand."""

    MOST = 10
    WINDOW_S = 60.0

    def __init__(self) -> None:
        self.wrong: list[float] = []

    def wait_s(self, now_s: float) -> float:
        """How long to wait before the next attempt; 0 if it may be made now."""
        self.wrong = [t for t in self.wrong if now_s - t < self.WINDOW_S]
        return self.WINDOW_S - (now_s - self.wrong[0]) if len(self.wrong) >= self.MOST else 0.0
