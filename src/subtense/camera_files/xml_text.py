"""The XML that OpenCV's FileStorage writes, to a tree; no document type, no entities of its own, bounded depth."""

from __future__ import annotations

import re
from typing import Any

from ..errors import FileFormatError
from . import flow_text, scalars
from .reading import MOST_DEPTH

_WORD = re.compile(r'"(?:[^"\\]|\\.)*"|\S+', re.DOTALL)
_STORAGE = "opencv_storage"


def tree(path: object, content: bytes) -> Any:
    """The tree of a FileStorage file.

    Raises:
        FileFormatError: where it is no XML, or no FileStorage.
    """
    from xml.parsers import expat

    elements = _Elements(path)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = elements.doctype
    parser.StartElementHandler = elements.start
    parser.EndElementHandler = elements.end
    parser.CharacterDataHandler = elements.text
    elements.line = lambda: parser.CurrentLineNumber
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise FileFormatError(path, f"is not XML: {error}") from None
    except FileFormatError:
        raise
    except (ValueError, LookupError):
        raise FileFormatError(path, "is not XML: its encoding is unknown; save it as UTF-8") from None
    return elements.root


class _Elements:
    """What expat reports, gathered into dicts, lists, numbers and texts."""

    def __init__(self, path: object) -> None:
        self.path, self.root = path, None
        self.open: list[tuple[str, dict[str, Any], list[Any], list[str]]] = []
        self.line: Any = int

    def error(self, what: str) -> FileFormatError:
        return FileFormatError(self.path, f"line {self.line()}: {what}")

    def doctype(self, *_: Any) -> None:
        raise self.error("a document type is not read here; take the line out")

    def start(self, name: str, _: dict[str, str]) -> None:
        if len(self.open) >= MOST_DEPTH:
            raise self.error(f"nested deeper than {MOST_DEPTH} levels, no calibration is")
        if not self.open and name != _STORAGE:
            raise self.error(f"<{name[:40]}> is not OpenCV's <{_STORAGE}>")
        self.open.append((name, {}, [], []))

    def text(self, data: str) -> None:
        self.open[-1][3].append(data)

    def end(self, name: str) -> None:
        _, keys, items, text = self.open.pop()
        said = "".join(text).strip()
        if bool(said) + bool(keys) + bool(items) > 1:
            raise self.error(f"<{name[:40]}> holds texts and elements, or elements of two kinds")
        value: Any = keys if keys else items if items else _leaf(said)
        if not self.open:
            self.root = value if keys else {}
        elif name == "_":
            self.open[-1][2].append(value)
        elif name in self.open[-1][1]:
            raise self.error(f"<{name[:40]}> stands here twice; keep the right one")
        else:
            self.open[-1][1][name] = value


def _leaf(text: str) -> Any:
    """A number, a text, or a list of them where several stand there."""
    words = [_word(word) for word in _WORD.findall(text)]
    return None if not words else words[0] if len(words) == 1 else words


def _word(word: str) -> Any:
    quoted = len(word) > 1 and word[0] == word[-1] == '"'
    return flow_text.unquoted(word) if quoted else scalars.value(word)
