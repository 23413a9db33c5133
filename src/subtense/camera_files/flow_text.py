"""Bracketed text to a tree: {key: value, ...} and [value, ...], as in YAML's flow style and in a Python literal.

Strings are in single or double quotes, # begins a comment, a comma may stand before a closing bracket. Nothing is
evaluated.
"""

from __future__ import annotations

import re
from typing import Any

from ..errors import FileFormatError
from . import scalars
from .reading import MOST_DEPTH

_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\n]+|(?:(?<=[\s,\[\]{}()])|^)\#[^\n]*)
    |(?P<mark>[\[\]{}(),]|:(?=[\s,\[\]{}()'"]|$))
    |(?P<double>b?"(?:[^"\\]|\\.)*")
    |(?P<single>b?'[^']*')
    |(?P<plain>[^\s\[\]{}(),'"\#:&*!|>%@`][^\[\]{}(),\n\#:]*(?::(?![\s,\[\]{}()'"]|$)[^\[\]{}(),\n\#:]*)*)""",
    re.VERBOSE | re.DOTALL,
)
_CLOSING = {"[": "]", "{": "}", "(": ")"}
_ESCAPED = {"n": "\n", "t": "\t", "r": "\r", '"': '"', "\\": "\\", "/": "/"}


def tree(path: object, text: str, line: int = 1) -> Any:
    """The tree of a text that is one bracket.

    Args:
        path: for messages.
        text: from its opening bracket on.
        line: the number of its first line.

    Raises:
        FileFormatError: where it is none.
    """
    return _Flow(path, text, line).whole()


def unquoted(text: str) -> str:
    """What a quoted string says."""
    inner = text.removeprefix("b")
    if inner[0] == "'":
        return inner[1:-1]
    return re.sub(r"\\(.)", lambda m: _ESCAPED.get(m[1], m[1]), inner[1:-1], flags=re.DOTALL)


class _Flow:
    """A cursor over the marks and values of the text."""

    def __init__(self, path: object, text: str, line: int) -> None:
        self.path, self.text, self.line, self.place = path, text, line, 0
        self.kind, self.word = "", ""
        self.next()

    def next(self) -> None:
        """Go to the next mark or value; at the end the kind is empty."""
        while self.place < len(self.text):
            found = _TOKEN.match(self.text, self.place)
            if found is None:
                raise self.error(f"{self.text[self.place]!r} can't stand here")
            self.place = found.end()
            if found.lastgroup != "space":
                self.kind, self.word = str(found.lastgroup), found[0]
                return
        self.kind, self.word = "", ""

    def error(self, what: str) -> FileFormatError:
        line = self.line + self.text.count("\n", 0, self.place)
        return FileFormatError(self.path, f"line {line}: {what}")

    def whole(self) -> Any:
        found = self.value(1)
        if self.kind:
            raise self.error(f"{self.word[:20]!r} follows the end")
        return found

    def value(self, depth: int) -> Any:
        if depth > MOST_DEPTH:
            raise self.error(f"nested deeper than {MOST_DEPTH} levels, no calibration is")
        kind, word = self.kind, self.word
        if kind == "":
            raise self.error("the text ends too early; the file may be cut off")
        self.next()
        if kind in ("double", "single"):
            return unquoted(word)
        if kind == "plain":
            return scalars.value(word.strip())
        if word == "{":
            return self.mapping(depth)
        if word in _CLOSING:
            return self.sequence(_CLOSING[word], depth)
        raise self.error(f"{word!r} can't stand here")

    def sequence(self, closing: str, depth: int) -> list[Any]:
        found = []
        while self.word != closing or self.kind != "mark":
            found.append(self.value(depth + 1))
            self.comma(closing)
        self.next()
        return found

    def mapping(self, depth: int) -> dict[str, Any]:
        found: dict[str, Any] = {}
        while self.word != "}" or self.kind != "mark":
            if self.kind == "mark":
                raise self.error(f"{self.word!r} can't stand for a key")
            key = self.value(MOST_DEPTH)
            if not (self.kind == "mark" and self.word == ":"):
                raise self.error(f"a : is missing behind {str(key)[:40]!r}")
            if str(key) in found:
                raise self.error(f"the key {str(key)[:40]!r} stands here twice; keep the right one")
            self.next()
            found[str(key)] = self.value(depth + 1)
            self.comma("}")
        self.next()
        return found

    def comma(self, closing: str) -> None:
        """A comma or the closing bracket must follow."""
        if self.kind == "mark" and self.word == ",":
            self.next()
        elif not (self.kind == "mark" and self.word == closing):
            raise self.error(
                f"a comma or {closing} is missing" if self.kind else "the text ends too early; the file may be cut off"
            )
