"""The part of YAML that calibration files are written in, to a tree; nothing else of it, and no objects.

Read: maps and lists by indentation, bracketed ones over several lines, quoted and plain values, block texts, comments,
one document, the tags `!!opencv-matrix`, `!!map`, `!!seq`, `!!str`, `!!int`, `!!float`. Refused by name: anchors,
aliases, other tags, a second document, doubled keys, tabs as indentation.
"""

from __future__ import annotations

import re
from typing import Any

from ..errors import FileFormatError
from . import flow_text, scalars
from .reading import MOST_DEPTH

_KEY = re.compile(
    r"""(?P<key>"(?:[^"\\]|\\.)*"|'[^']*'|[^\s\[\]{}"'#&*!|>%@`,?-][^:#]{0,120}?|-[^\s:#][^:#]{0,120}?)[ ]{0,9}:(?:[ ]+|$)"""
)
_TAG = re.compile(r"!\S*")
_TAGS = {"!!opencv-matrix", "!!opencv-nd-matrix", "!!map", "!!seq", "!!str", "!!int", "!!float"}
_QUOTED = re.compile(r"\"(?:[^\"\\]|\\.)*\"|'(?:[^']|'')*'", re.DOTALL)
_INSIDE_QUOTES = re.compile(r"""\"(?:[^\"\\]|\\.)*\"?|'[^']*'?""", re.DOTALL)
_BETWEEN_QUOTES = re.compile(r"""[^"'#]+|"(?:[^"\\]|\\.)*"?|'[^']*'?|\#""")


def tree(path: object, text: str) -> Any:
    """The tree of a text.

    Raises:
        FileFormatError: where it is not of this part of YAML; with the line.
    """
    lines = _lines(path, text)
    if not lines:
        raise FileFormatError(path, "is empty")
    if not (_KEY.match(lines[0].text) or lines[0].text[0] in "-[{!"):
        raise FileFormatError(
            path, "is no calibration file that is known here: neither YAML, JSON, XML, nor COLMAP's or mrcal's text"
        )
    blocks = _Blocks(path, lines)
    found = blocks.block(lines[0].indent, 1)
    if blocks.at < len(lines):
        raise blocks.error("this line fits to no line above; check its indentation")
    return found


class _Line:
    """A line that says something: its number, its indentation, and the rest without comment."""

    __slots__ = ("indent", "number", "text")

    def __init__(self, number: int, indent: int, text: str) -> None:
        self.number, self.indent, self.text = number, indent, text


def _lines(path: object, text: str) -> list[_Line]:
    found: list[_Line] = []
    ended = False
    for number, raw in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        line = raw.rstrip()
        bare = line.lstrip(" ")
        if not bare or bare.startswith("#") or (not found and line.startswith("%")):
            continue
        if line == "..." or line == "---" or line.startswith("--- "):
            ended = bool(found)
            continue
        if ended:
            raise FileFormatError(path, f"line {number}: a second document begins here; keep one in the file")
        if bare.startswith("\t"):
            raise FileFormatError(path, f"line {number}: is indented by tabs; use spaces")
        found.append(_Line(number, len(line) - len(bare), _without_comment(bare)))
    return found


def _without_comment(text: str) -> str:
    if "#" not in text:
        return text
    place = 0
    for part in _BETWEEN_QUOTES.finditer(text):
        if part[0] == "#" and (part.start() == 0 or text[part.start() - 1] in " \t"):
            return text[: part.start()].rstrip()
        place = part.end()
    return text[:place]


class _Blocks:
    """A cursor over the lines."""

    def __init__(self, path: object, lines: list[_Line]) -> None:
        self.path, self.lines, self.at = path, lines, 0

    def error(self, what: str, line: _Line | None = None) -> FileFormatError:
        line = line or self.lines[min(self.at, len(self.lines) - 1)]
        return FileFormatError(self.path, f"line {line.number}: {what}")

    def here(self, indent: int) -> _Line | None:
        """The next line if it stands at this indentation."""
        line = self.lines[self.at] if self.at < len(self.lines) else None
        return line if line is not None and line.indent == indent else None

    def block(self, indent: int, depth: int) -> Any:
        """The map or list at this indentation, or the single value."""
        if depth > MOST_DEPTH:
            raise self.error(f"nested deeper than {MOST_DEPTH} levels, no calibration is")
        line = self.lines[self.at]
        if line.text == "-" or line.text.startswith("- "):
            return self.sequence(indent, depth)
        if _KEY.match(line.text):
            return self.mapping(indent, depth)
        self.at += 1
        return self.value(line, line.text, depth)

    def sequence(self, indent: int, depth: int) -> list[Any]:
        found = []
        while self.dash_at(indent):
            line = self.lines[self.at]
            rest = line.text[1:].lstrip(" ")
            if not rest:
                self.at += 1
                found.append(self.below(indent + 1, depth))
            elif rest == "-" or rest.startswith("- ") or _KEY.match(rest):
                # what begins behind the dash goes on below it, at the same column
                self.lines[self.at] = _Line(line.number, indent + len(line.text) - len(rest), rest)
                found.append(self.block(self.lines[self.at].indent, depth + 1))
            else:
                self.at += 1
                found.append(self.value(line, rest, depth))
        return found

    def mapping(self, indent: int, depth: int) -> dict[str, Any]:
        found: dict[str, Any] = {}
        while line := self.here(indent):
            key = _KEY.match(line.text)
            if key is None:
                raise self.error("a key and a : are needed here")
            name = flow_text.unquoted(key["key"]) if key["key"][0] in "\"'" else key["key"]
            if name in found:
                raise self.error(f"the key {name[:40]!r} stands here twice; keep the right one")
            self.at += 1
            found[name] = self.value(line, line.text[key.end() :], depth, of_key=True)
        return found

    def below(self, indent: int, depth: int) -> Any:
        """The block that stands below, at this indentation or deeper; None where nothing does."""
        if self.at < len(self.lines) and self.lines[self.at].indent >= indent:
            return self.block(self.lines[self.at].indent, depth + 1)
        return None

    def value(self, line: _Line, text: str, depth: int, *, of_key: bool = False) -> Any:
        """What stands behind a key or a dash, on the line and on those below."""
        if tag := _TAG.match(text):
            if tag[0] not in _TAGS:
                raise self.error(f"the tag {tag[0][:40]} is not read here", line)
            text = text[tag.end() :].lstrip()
        if not text:
            # the dashes of a key's list may stand at the key's own column
            return self.below(line.indent if of_key and self.dash_at(line.indent) else line.indent + 1, depth)
        if text[0] in "&*":
            raise self.error("anchors and aliases are not read here; write the value out", line)
        if text[0] in "|>":
            return "\n".join(below.text for below in self.deeper(line.indent))
        if text[0] in "[{":
            return flow_text.tree(self.path, self.bracketed(line, text), line.number)
        if text[0] in "\"'":
            return self.quoted(line, text)
        return self.plain(line, text)

    def dash_at(self, indent: int) -> bool:
        """Whether the next line is an item of a list at this indentation."""
        line = self.here(indent)
        return line is not None and (line.text == "-" or line.text.startswith("- "))

    def deeper(self, indent: int) -> list[_Line]:
        """The lines below that are indented further, consumed."""
        first = self.at
        while self.at < len(self.lines) and self.lines[self.at].indent > indent:
            self.at += 1
        return self.lines[first : self.at]

    def bracketed(self, line: _Line, text: str) -> str:
        """A bracket with the lines that it goes on over."""
        parts, number = [text], line.number
        depth = _opened(text)
        while depth > 0 and self.at < len(self.lines):
            below = self.lines[self.at]
            parts += [""] * (below.number - number - 1) + [below.text]  # empty lines keep the numbers of lines right
            number = below.number
            depth += _opened(below.text)
            self.at += 1
        return "\n".join(parts)

    def quoted(self, line: _Line, text: str) -> str:
        """A quoted text, which may go on over lines."""
        parts = [text]
        while not _ends_quoted(parts) and self.at < len(self.lines):
            parts.append(self.lines[self.at].text)
            self.at += 1
            if len(parts) > 1000:
                raise self.error("a quoted text does not end", line)
        found = _QUOTED.fullmatch(" ".join(parts))
        if found is None:
            raise self.error("a quoted text does not end, or something follows it", line)
        return flow_text.unquoted(found[0])

    def plain(self, line: _Line, text: str) -> Any:
        more = self.deeper(line.indent)
        for below in more:
            if _KEY.match(below.text):
                raise self.error("a key can't stand below a value; check the indentation", below)
        return scalars.value(" ".join([text, *(below.text for below in more)]))


def _opened(text: str) -> int:
    """How many brackets of a text stay open."""
    if '"' in text or "'" in text:
        text = _INSIDE_QUOTES.sub("", text)
    return sum(map(text.count, "[{")) - sum(map(text.count, "]}"))


def _ends_quoted(parts: list[str]) -> bool:
    """Whether the last line closes the quotation mark that the first one opens."""
    mark, last = parts[0][0], parts[-1]
    body = last[1:] if len(parts) == 1 else last
    if mark == '"':
        body = body.replace("\\\\", "").replace('\\"', "")
    return body.endswith(mark) and (mark == '"' or body.count("'") % 2 == 1)
